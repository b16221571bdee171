"""What a fitted model promises of the next dip: the band of P and Q, as `result.json` has it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.domain import domain_of
from tractexp.domain.playback import LAST_SHARE, STALLED_POWER
from tractexp.errors import UserError
from tractexp.inference.interval import INTERVAL_LEVEL
from tractexp.inference.model_error import STALL, in_percent
from tractexp.inference.prediction_band import (
    PredictionBand,
    find_largest_change,
    find_scatter,
    measure_band,
)
from tractexp.model.model import Model
from tractexp.record import Event

if TYPE_CHECKING:
    from tractexp.identification.grade import GradedModel

TOLD_DEPTH = 0.4  # of the dip that is told of
CALCULATED_BEFORE, CALCULATED_AFTER = 0.3, 1.5  # s calculated before and after it
EDGE = 0.02  # s of its fall and of its recovery
UNIFORM = 12.0  # squares of a range over the variance of what is as likely everywhere in it

Calculate = Callable[[np.ndarray], np.ndarray]  # values (d,) -> P and Q (2, N) [pu]


@dataclass(frozen=True, eq=False)
class Forecast:
    """The band that a model at values (d,) promises; `root` (k, d) are rows whose products add up
    to the covariance of the values.
    """

    values: np.ndarray
    root: np.ndarray
    band: PredictionBand

    @classmethod
    def from_content(
        cls, content: Mapping[str, Any], names: Sequence[str], values: np.ndarray
    ) -> "Forecast | None":
        """Of `next_dip` as `result.json` has it, for the parameters `names` (d,); None of a result
        that has none.
        """
        if not content:
            return None
        noise, share, rows = content["noise"], content["share"], content["scatter"]
        band = PredictionBand((noise[0], noise[1]), (share[0], share[1]), content["events"])
        width = len(next(iter(rows.values()), ()))
        root = np.array([rows.get(name, [0.0] * width) for name in names]).T
        return cls(values, root, band)

    def find_half_width(
        self, calculate: Calculate, drawn: complex, t: np.ndarray, start: int, frequency: float
    ) -> np.ndarray:
        """Half the band of P and Q (2,) [pu] of an event at times t (N,) [s] from sample `start`
        on, before which the load drew S = `drawn` [pu]. Raises `UserError` where there is no
        steady state.
        """
        power = calculate(self.values)
        change = power[0] + 1j * power[1] - drawn
        step = float(t[-1] - t[0]) / (len(t) - 1)
        largest = find_largest_change(change[start:], step, frequency)
        scatter = find_scatter(calculate, self.values, self.root)
        return self.band.find_half_width(largest, len(t) - start, scatter)


def forecast_next_dip(graded: "GradedModel") -> dict[str, Any]:
    """The content of `next_dip`: what the band hangs on, and its half widths P and Q, as shares of
    S before it, for a dip of 40 % as long as the known ones in the mean.

    {} where the motor stalls on a known event; no P and Q where it does so on this dip.
    """
    band = measure_band(graded.fits)
    if band is None:
        return {}
    problem, information = graded.problem, graded.uncertainty.information
    values = problem.full(graded.values)[0]
    root = problem.full(graded.values + _find_root(information.J) * information.width) - values
    duration = float(np.mean([fit.event.duration for fit in graded.fits]))
    half, sentence = tell_of_dip(
        problem.model, problem.events[0], Forecast(values, root, band), duration
    )
    return {
        "depth": TOLD_DEPTH,
        "duration": duration,
        "P": half and half[0],
        "Q": half and half[1],
        "level": INTERVAL_LEVEL,
        "events": band.events,
        "noise": [*band.noise],
        "share": [*band.share],
        "scatter": {
            name: column.tolist()
            for name, column in zip(problem.model.names, root.T, strict=True)
            if column.any()
        },
        "sentence": sentence,
    }


def tell_of_dip(
    model: Model, first: Event, forecast: Forecast, duration: float
) -> tuple[list[float] | None, str]:
    """Half the bands of a dip of 40 % as shares of S, and the sentence, where the load draws what
    it did before the event `first`; None where there are none.
    """
    before = {"U0": first.U0, "P0": first.P0, "Q0": first.Q0, "frequency": first.f0}
    t, U, start = draw_dip(first.U0, duration, first.record.step)
    dip = f"the next dip of {100 * TOLD_DEPTH:.0f} %"

    def calculate(values: np.ndarray) -> np.ndarray:
        return np.stack(domain_of(model).play(model, values, t, U, before))

    drawn = complex(first.P0, first.Q0)
    try:
        power = calculate(forecast.values)
    except UserError:
        return None, f"{dip}: this model has no steady state before it"
    end = np.hypot(*power)[round((1 - LAST_SHARE) * len(t)) :]
    if not np.isfinite(power).all() or end.mean() > STALLED_POWER * abs(drawn):
        return None, f"{dip}: {STALL} in this model"
    half = forecast.find_half_width(calculate, drawn, t, start, first.f0) / abs(drawn)
    P, Q = half.tolist()
    return [P, Q], f"{dip}: P within {in_percent(P)} and Q within {in_percent(Q)} of S"


def _find_root(J: np.ndarray) -> np.ndarray:
    """Rows (d, d), in ranges, whose products add up to the covariance, by sensitivities J (R, d)
    within a box that is as likely everywhere.
    """
    d = J.shape[1]
    stacked = np.vstack([J, np.sqrt(UNIFORM) * np.eye(d)])
    _, singular, directions = np.linalg.svd(stacked, full_matrices=False)
    return directions / singular[:, None]


def draw_dip(U0: float, duration: float, step: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Times (N,) [s], voltage (N,) [pu] and first sample of the dip that is told of."""
    t = np.arange(round((CALCULATED_BEFORE + duration + CALCULATED_AFTER) / step)) * step
    edge = max(EDGE, step)
    fall, back = (
        np.clip((t - s) / edge, 0.0, 1.0) for s in (CALCULATED_BEFORE, CALCULATED_BEFORE + duration)
    )
    return t, U0 * (1 - TOLD_DEPTH * (fall - back)), int(np.searchsorted(t, CALCULATED_BEFORE))
