"""Measured, before and after, event by event, on one time axis: what a page overlays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.discrepancy.gap import GapTest
from tractexp.discrepancy.held_out import carry_fits
from tractexp.discrepancy.nearest import Nearest
from tractexp.discrepancy.places import DisagreementInterval
from tractexp.discrepancy.remainder import Remainder, find_remainders
from tractexp.domain import find_domain
from tractexp.identification.grade import GradedModel
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.noise import Noise
from tractexp.record import Event


@dataclass(frozen=True, eq=False)
class Overlay:
    """One event as recorded, and as the models calculate it.

    Attributes
    ----------
    event : Event
        As recorded.
    held_out : bool
        Whether it was held out.
    driving : (n,) [pu]
        The voltage that the load saw.
    before : (C, n) [pu]
        The base model's P and Q, or the currents of a `WaveEvent`.
    after : (C, n) [pu] or None
        Those of the extended model, where there is one.
    nearest : (C, n) [pu] or None
        Those of the candidates that come nearest, where nothing explains.
    deviation : (C, n) [pu]
        Standard deviation of the noise.
    places : tuple of DisagreementInterval
        Where base model and record disagree.
    """

    event: Event
    held_out: bool
    driving: np.ndarray
    before: np.ndarray
    after: np.ndarray | None
    nearest: np.ndarray | None
    deviation: np.ndarray
    places: tuple[DisagreementInterval, ...]

    @property
    def measurements(self) -> np.ndarray:
        """What the models are compared with (C, n) [pu], nan in gaps."""
        return find_domain(self.event).excitation(self.event).measurements


def overlay_fitted(
    context: Context,
    gap: GapTest,
    nearest: Nearest | None,
    places: Sequence[DisagreementInterval],
    *,
    extended: bool,
) -> list[Overlay]:
    """The fitted events; `extended` tells whether there is an extended model."""
    after = gap.after.calculated if extended else None
    near = None if nearest is None else nearest.fitted.after.calculated
    return _cut_events(
        context, gap.noise, (gap.before.calculated, after, near), places, held_out=False
    )


def overlay_held_out(
    context: Context,
    withheld: Sequence[Event],
    gap: GapTest | None,
    bare: Refit,
    nearest: Nearest | None,
) -> list[Overlay]:
    """The held-out events: by the `gap` of the names on them or, without any, the base model
    carried over.
    """
    if not withheld:
        return []
    if gap is not None:
        assert gap.context is not None
        return _cut_events(
            gap.context,
            gap.noise,
            (gap.before.calculated, gap.after.calculated, None),
            (),
            held_out=True,
        )
    fits = [bare, *([nearest.row.fit] if nearest else [])]
    other, units, noise = carry_fits(context, withheld, fits)
    before, *near = [
        other.calculate(unit, fit.names) for unit, fit in zip(units, fits, strict=True)
    ]
    return _cut_events(other, noise, (before, None, near[0] if near else None), (), held_out=True)


def draw_graded(
    overlays: Sequence[Overlay], base: GradedModel, extended: GradedModel | None
) -> list[Overlay]:
    """The same events as the graded models calculate them; as the fits do by which effects are
    ranked where a graded model cannot be simulated.
    """

    def draw(overlay: Overlay) -> Overlay:
        before = base.find_curves(overlay.event)
        after = overlay.after if extended is None else extended.find_curves(overlay.event)
        return replace(
            overlay,
            before=overlay.before if before is None else before,
            after=overlay.after if after is None else after,
        )

    return [draw(overlay) for overlay in overlays]


def overlay_fit(context: Context, fit: Refit, noise: Noise) -> list[Overlay]:
    """The fitted events by one fit alone."""
    before = context.calculate(fit.unit, fit.names)
    return _cut_events(context, noise, (before, None, None), (), held_out=False)


def find_remainder(
    overlays: Sequence[Overlay], noise: Noise, false_alarms: float
) -> list[Remainder]:
    """What the model that comes nearest leaves of these events, the loudest shape first."""
    if not overlays:
        return []
    curves = [next(m for m in (o.nearest, o.after, o.before) if m is not None) for o in overlays]
    rest = np.concatenate(
        [np.nan_to_num(o.measurements - m) for o, m in zip(overlays, curves, strict=True)], axis=1
    )
    return find_remainders(rest, [o.event for o in overlays], noise, false_alarms)


def _cut_events(
    context: Context,
    noise: Noise,
    curves: tuple[np.ndarray, np.ndarray | None, np.ndarray | None],
    places: Sequence[DisagreementInterval],
    *,
    held_out: bool,
) -> list[Overlay]:
    """Curves (C, N) of events end to end, cut into events."""
    deviation = noise.deviation(context.drive)
    overlays = []
    of_events = zip(context.records.recorded, context.events, context.drive.parts, strict=True)
    for event, smooth, part in of_events:
        before, after, nearest = (None if c is None else c[:, part] for c in curves)
        assert before is not None
        here = tuple(p for p in places if p.event == event.record.name)
        overlays.append(
            Overlay(
                event, held_out, smooth.record.U, before, after, nearest, deviation[:, part], here
            )
        )
    return overlays
