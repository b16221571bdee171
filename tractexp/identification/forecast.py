"""What a fitted model promises of the next dip: the band of P and Q, as `result.json` has it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.domain import find_domain
from tractexp.domain.playback import LAST_SHARE, STALLED_POWER
from tractexp.errors import UserError
from tractexp.inference.information import UNIFORM_PRECISION
from tractexp.inference.interval import INTERVAL_LEVEL
from tractexp.inference.model_error import STALL, format_percent
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

Calculate = Callable[[np.ndarray], np.ndarray]  # values (d,) -> P and Q (2, N) [pu]


@dataclass(frozen=True, eq=False)
class Forecast:
    """The band that a model promises for a dip that it has not seen.

    Attributes
    ----------
    values : (d,)
        Parameters of the model.
    root : (k, d)
        Rows whose products add up to the covariance of the values.
    band : PredictionBand
        What the width hangs on.
    """

    values: np.ndarray
    root: np.ndarray
    band: PredictionBand

    @classmethod
    def from_content(
        cls, content: Mapping[str, Any], names: Sequence[str], values: np.ndarray
    ) -> "Forecast | None":
        """The forecast of a stored result.

        Parameters
        ----------
        content : mapping
            `next_dip` of `result.json`.
        names : names
            The d parameters, in the order of the values.
        values : (d,)
            Their values.

        Returns
        -------
        Forecast or None
            None of a result that promises nothing.
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
        """Half the band of P and Q for one event.

        Parameters
        ----------
        calculate : (d,) -> (2, N) [pu]
            P and Q of the event for values of the parameters.
        drawn : complex [pu]
            P + jQ before the event.
        t : (N,) [s]
            Times of the samples.
        start : int
            First sample of the event.
        frequency : float [Hz]
            Of the network: over a cycle of it changes are averaged.

        Returns
        -------
        (2,) array [pu]

        Raises
        ------
        UserError
            Where the model has no steady state before the event.
        """
        power = calculate(self.values)
        change = power[0] + 1j * power[1] - drawn
        step = float(t[-1] - t[0]) / (len(t) - 1)
        largest = find_largest_change(change[start:], step, frequency)
        scatter = find_scatter(calculate, self.values, self.root)
        return self.band.find_half_width(largest, len(t) - start, scatter)


def forecast_next_dip(graded: "GradedModel") -> dict[str, Any]:
    """The content of `next_dip` of `result.json`.

    It holds what the band hangs on, and for a dip of 40 %, as long as the known ones in the mean,
    half the bands of P and Q as shares of S before it, with a sentence.

    Parameters
    ----------
    graded : GradedModel
        The model, played over all events.

    Returns
    -------
    dict
        {} where the motor stalls on a known event; P and Q are None where it does so on this dip.
    """
    band = measure_band(graded.fits)
    if band is None:
        return {}
    problem = graded.problem
    information = graded.uncertainty.information
    values = problem.full(graded.values)[0]
    root = (
        problem.full(graded.values + _find_covariance_root(information.J) * information.width)
        - values
    )
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
    """Half the bands of a dip of 40 %, and the sentence on it.

    Parameters
    ----------
    model : Model
        The equations of the load.
    first : Event
        The load draws before the dip what it drew before this event.
    forecast : Forecast
        The band.
    duration : float [s]
        Of the dip.

    Returns
    -------
    [P, Q] or None
        As shares of S; None where the motor stalls or there is no steady state.
    str
    """
    before = {"U0": first.U0, "P0": first.P0, "Q0": first.Q0, "frequency": first.f0}
    t, U, start = draw_dip(first.U0, duration, first.record.step)
    dip = f"the next dip of {100 * TOLD_DEPTH:.0f} %"

    def calculate(values: np.ndarray) -> np.ndarray:
        return np.stack(find_domain(model).play(model, values, t, U, before))

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
    return [
        P,
        Q,
    ], f"{dip}: P within {format_percent(P)} and Q within {format_percent(Q)} of S"


def _find_covariance_root(J: np.ndarray) -> np.ndarray:
    """Rows r (d, d) with sum r^T r = (J^T J + 12 I)^-1: the covariance in the unit box, where each
    parameter is a priori as likely everywhere (variance 1/12). J: sensitivities (R, d) over noise.
    """
    d = J.shape[1]
    stacked = np.vstack([J, np.sqrt(UNIFORM_PRECISION) * np.eye(d)])
    _, singular, directions = np.linalg.svd(stacked, full_matrices=False)
    return directions / singular[:, None]


def draw_dip(U0: float, duration: float, step: float) -> tuple[np.ndarray, np.ndarray, int]:
    """A dip of 40 % with straight edges.

    Parameters
    ----------
    U0 : float [pu]
        Voltage before it.
    duration : float [s]
        From edge to edge.
    step : float [s]
        Between samples.

    Returns
    -------
    (N,) array [s]
        Times.
    (N,) array [pu]
        Voltage.
    int
        First sample of the dip.

    Examples
    --------
    >>> t, U, start = draw_dip(1.0, 0.2, 0.01)
    >>> len(t), round(float(U.min()), 3), start
    (200, 0.6, 30)
    """
    t = np.arange(round((CALCULATED_BEFORE + duration + CALCULATED_AFTER) / step)) * step
    edge = max(EDGE, step)
    fall, back = (
        np.clip((t - s) / edge, 0.0, 1.0) for s in (CALCULATED_BEFORE, CALCULATED_BEFORE + duration)
    )
    return t, U0 * (1 - TOLD_DEPTH * (fall - back)), int(np.searchsorted(t, CALCULATED_BEFORE))
