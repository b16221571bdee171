"""Whether each event bears out a set of effects that was fitted to all others: what confirms a name
where the held-out events took part in choosing it.

By the model's error in S: of what the set takes away of an event's squares when all events are
fitted, it must take away a share when that event is left out. Events of which so little is taken
away that noise hides it are not asked.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tractexp.discrepancy.gap import SPREAD
from tractexp.discrepancy.prediction import predict
from tractexp.inference.context import Context
from tractexp.inference.fitting import Names, Refit, key_by_names, leave_each_out, refit
from tractexp.inference.model_error import estimate_noise_variance
from tractexp.inference.noise_in_quiet import assume_residual_noise
from tractexp.record import Event

FEWEST_EVENTS = 3  # of which one can be left out


def find_least_share(
    expected: Sequence[float], gained: Sequence[float], hidden: Sequence[float]
) -> float:
    """The least share of what is expected that is gained, of the events that show a set.

    Parameters
    ----------
    expected, gained : E floats [pu²]
        What the set takes away of the squares of each event where that is fitted with all others,
        and where it is left out.
    hidden : E floats [pu²]
        Less than that noise hides.

    Returns
    -------
    float
        nan where no event shows the set.

    Examples
    --------
    >>> find_least_share((4.0, 2.0, 0.05), (4.0, 1.5, -9.0), (0.1, 0.1, 0.1))
    0.75
    """
    shares = [
        1.0 if own == most else own / most
        for most, own, least in zip(expected, gained, hidden, strict=True)
        if most > least
    ]
    return min(shares, default=np.nan)


def replicate(
    context: Context, events: Sequence[Event], base: Refit, chosen: Refit, faults: Names = ()
) -> float | None:
    """The least share of what a set takes away of an event's squares that is left where it was
    fitted to all others by least squares: against the base model, and of several effects against
    all but each.

    None of fewer than three events, the context's and further `events`; nan where noise hides the
    set in each of them.
    """
    every = [*context.records.recorded, *events]
    if len(every) < FEWEST_EVENTS:
        return None
    context.effort.say("leaving each event out in turn")
    plain = context.with_measured_power.held_to_usual
    at = plain.coordinates
    noise = assume_residual_noise(plain, replace(chosen, unit=at.at_measured_power(chosen.unit)))
    smaller: list[tuple[Names, np.ndarray]] = [((), base.unit)]
    if len(chosen.names) > 1:
        smaller += leave_each_out(plain, chosen)

    own = chosen.names, chosen.unit

    def forget(names: Names, unit: np.ndarray) -> np.ndarray:
        """Sizes back at their nulls: events that show nothing of an effect shall find none."""
        unit = unit.copy()
        sizes = at.sizes(names)
        unit[sizes] = at.null[sizes]
        return unit

    def fit_to(some: Sequence[Event]) -> dict[Names, Refit]:
        there = plain.move_to_events(some)
        move = there.coordinates.at_measured_power
        starts = [(names, move(forget(names, unit))) for names, unit in (*smaller, own)]
        return key_by_names(refit(there, noise, starts, faults))

    def measure_gains(fits: dict[Names, Refit], event: Event) -> list[float]:
        there = plain.move_to_events([event])
        after = predict(there, fits[chosen.names]).squares.sum()
        before = [predict(there, fits[names]).squares.sum() for names, _ in smaller]
        with np.errstate(invalid="ignore"):  # the motor stalls with and without
            return [float(one - after) for one in before]

    whole = fit_to(every)
    others = [fit_to([*every[:k], *every[k + 1 :]]) for k in range(len(every))]
    expected = zip(*(measure_gains(whole, event) for event in every), strict=True)
    gained = zip(*map(measure_gains, others, every), strict=True)
    hidden = tuple(map(find_hidden, every))
    pairs = zip(expected, gained, strict=True)
    return float(np.min([find_least_share(most, left, hidden) for most, left in pairs]))


def find_hidden(event: Event) -> float:
    """The sum of squares [pu²] by which that of the noise of an event scatters, in 95 % of cases
    to either side.
    """
    samples = event.record.samples - event.start
    return SPREAD * estimate_noise_variance(event) * samples**0.5
