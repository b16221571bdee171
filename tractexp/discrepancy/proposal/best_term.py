"""The best term of the library as a rival of names: what has no name may predict the held-out
events better.
"""

from collections.abc import Sequence

from tractexp.discrepancy.proposal.bed import carried_over, context_of_terms
from tractexp.discrepancy.proposal.library import terms
from tractexp.discrepancy.proposal.refit import MOST_JUDGED_TERMS, term_fits
from tractexp.discrepancy.proposal.screen import Ground, screen
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit, refit
from tractexp.noise import Noise


def best_terms(context: Context, bare: Refit, noise: Noise) -> tuple[Context, Sequence[Refit]]:
    """The terms that explain most beside the base model's fit `bare` under `noise`, and the context
    of their fits.

    As the sets they are rivals of they take P0 and Q0 as measured, and are fitted without faults of
    the measurement, which are free while they are looked for.
    """
    context.effort.say("looking for a term of the library that predicts better")
    under = context_of_terms(context).with_measured_power.held_to_usual
    ground = Ground.from_coordinates(under, carried_over(under, context, bare.unit), noise)
    result = term_fits(screen(ground, terms(), seed=0, draws=0), [])
    there, at = result.context, result.context.coordinates
    chosen = [
        (fit.names, at.without_faults(fit.unit, ())) for fit in result.fits[:MOST_JUDGED_TERMS]
    ]
    return there, refit(there, noise, chosen, faults=())
