"""The window over which a recorder averages phasors, as a model's setting says it
(`model.window`).
"""

from numbers import Real
from typing import NamedTuple

import numpy as np

from tractexp.configuration.plugin import discover, find
from tractexp.errors import MODEL, UserError, list_allowed
from tractexp.model.model import WAVES, Model
from tractexp.record import Event
from tractexp.record.window import LONGEST_WINDOW, build_mean_weights
from tractexp.recording.estimator import Estimator, estimator_of

RECORDED = "recorded"  # the window that each record says


class Averaging(NamedTuple):
    """A window on the samples of an event: weights (odd,) around the middle one, and its length
    [s].
    """

    weights: np.ndarray
    length: float


def check_window(window: object, domain: str) -> None:
    """Raise `UserError` for a setting that is no window: None, seconds, an estimator's name or
    `recorded`.
    """
    if window is not None and domain == WAVES:
        raise UserError(
            f"{MODEL.window}={window} has no meaning on waveforms, which are samples; leave it out"
        )
    if window in (None, RECORDED):
        return
    if isinstance(window, str) and find(Estimator.group, window) is not None:
        return
    names = (RECORDED, *sorted(discover()[Estimator.group]))
    if isinstance(window, str):
        raise UserError(
            f"{MODEL.window}={window}: there is no such window"
            f"{list_allowed(window, names)}; or give seconds"
        )
    if (
        isinstance(window, bool)
        or not isinstance(window, Real)
        or not 0 < float(window) <= LONGEST_WINDOW
    ):
        raise UserError(
            f"{MODEL.window}={window} is no window: give its length, at most {LONGEST_WINDOW:g} s,"
            f" or one of {', '.join(names)}"
        )


def find_averaging(event: Event, model: Model | None) -> Averaging | None:
    """The window through which a model is looked at in an event: the one it is set to, else that of
    the record.

    That of the record counts where the model follows what happens within a cycle. None: no window,
    or none known.
    """
    if model is None:
        return None
    window, step = model.window, event.record.step
    if window is None and not model.motor.within_a_cycle:
        return None
    if isinstance(window, Real):
        return Averaging(build_mean_weights(float(window) / step), float(window))
    if window is None or window == RECORDED:
        shape = event.record.window
    else:
        shape = estimator_of(str(window)).window(event.record.base.frequency)
    return None if shape is None else Averaging(shape.compute_weights(step), shape.length)
