"""Rivals that somebody names, fitted to records: what to record next for them, without a whole
investigation.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from tractexp.discrepancy.gap import compute_curves
from tractexp.discrepancy.next_event.choose import NextEvent, find_next_event
from tractexp.domain import find_domain
from tractexp.errors import TASK, UserError
from tractexp.inference.base_fit import fit_base_model
from tractexp.inference.catalogue import Catalogue, build_catalogue
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.fitting import Names, Start, refit
from tractexp.inference.records import Records, check_events
from tractexp.model.model import Model
from tractexp.record import Event
from tractexp.text.wording import join_words


def choose_event_for(
    model: Model,
    events: Sequence[Event],
    rivals: Sequence[Sequence[str]],
    bounds: Mapping[str, Sequence[float]],
    fixed: Mapping[str, float],
    *,
    substeps: int | None,
    tell: Callable[[str], None],
) -> NextEvent:
    """Fit sets of effects to all events, and choose the event that tells them apart.

    Parameters
    ----------
    model : Model
        The base model.
    events : sequence of Event
        All of them are fitted.
    rivals : sequence of names
        Two sets of effects or more.
    bounds, fixed, substeps, tell
        As of `tractexp.discrepancy.investigate.investigate`.

    Returns
    -------
    NextEvent

    Raises
    ------
    UserError
        For fewer than two sets, and for effects that cannot be told on these events or are no
        load's.
    """
    sets = list(dict.fromkeys(tuple(sorted(names)) for names in rivals))
    if len(sets) < 2:
        raise UserError(
            f"{TASK.rivals}={[list(s) for s in sets]}: an event is planned to tell two explanations"
            " or more apart; name"
            f" another one, such as '{TASK.rivals}=[stator_resistance,feeder_impedance]'"
        )
    events = find_domain(model).events(events)
    check_events(events, ())
    named = sorted({name for names in sets for name in names})
    missing = build_catalogue(model, events, named)
    _check(missing, named)
    with Effort(tell).tell_when_silent() as effort:
        context = Context.from_records(
            model, missing, Records.from_events(events), bounds, fixed, Criteria(), effort, substeps
        )
        base = fit_base_model(context)
        effort.say(f"fitting {len(sets)} explanations")
        noise = base.noise
        begin = [start for names in sets for start in _list_starts(context, base.fit.unit, names)]
        for _ in range(2):  # the second time under the noise that the best of them leaves
            fits = refit(context, noise, begin)
            noise = base.quiet.of_fit(fits[0].unit, fits[0].names)
            begin = [fit.start for fit in fits]
        bare, *fits = sorted(
            refit(context, noise, [((), base.fit.unit), *begin]), key=lambda fit: bool(fit.names)
        )
        labels = [join_words(list(fit.names)) for fit in fits]
        error = min(compute_curves(context, f.unit, noise, f.names).error.certain for f in fits)
        return find_next_event(context, noise, bare, fits, labels, error=error)


def _check(missing: Catalogue, named: Sequence[str]) -> None:
    """Raise `UserError` for a name that is no effect of the load, or one that the events do not
    show.
    """
    for name in named:
        if name in missing.untestable:
            raise UserError(
                f"{TASK.rivals} names '{name}', which cannot be tested here:"
                f" {missing.untestable[name]}"
            )
        if name not in missing.of_load:
            raise UserError(
                f"{TASK.rivals} names '{name}', which is in the model already, a fault of the"
                " measurement, or of "
                "another law or place; give effects that the model lacks, by the catalogue's names"
            )


def _list_starts(context: Context, unit: np.ndarray, names: Names) -> list[Start]:
    """The base fit with every setting of each effect and its sizes at what matters least, either
    way.
    """
    at = context.coordinates
    result = []
    for name in names:
        candidate = context.catalogue[name]
        for setting in candidate.settings:
            for sign in (1, -1):
                point = at.place_values(unit, setting)
                for p in context.catalogue.sizes(names):
                    step = candidate.relevant(p) * (candidate.sign(p) or sign)
                    point[at.column[p.name]] = np.clip(
                        at.to_unit(p.name, p.absent + step), 0.0, 1.0
                    )
                result.append((names, point))
                if all(candidate.sign(p) for p in candidate.sizes):
                    break
    return result
