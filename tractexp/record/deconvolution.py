"""The voltage at the load, computed back from phasors that are averages over a window.

With a window h, U = h * u and I = h * i are recorded, and P + jQ = U conj(I). A load whose current is linear in the
voltage would not show it; any other does wherever the voltage bends. u is computed back from U near the edges of the
dip, where it is free to bend; the current a model draws at u is then averaged as the recorder does
(`tractexp.model.window`).

Source: IEC/IEEE 60255-118-1. Departures: the angle of the voltage is taken as steady over a window.
"""

import functools
from dataclasses import replace
from typing import Any

import numpy as np

from tractexp.record.event import Event

EDGE = 0.05  # s on either side of a window around an edge, in which the voltage may bend
BENT, CALM = 0.01, 3e-4  # pu: second differences of the voltage there, and elsewhere
ERROR = 2e-4  # pu: how exactly the averaged voltage must be the recorded one, if its noise allows


def sharpened(event: Event, weights: np.ndarray, window: float) -> Event:
    """The event with the voltage at the load, where the record's was averaged with weights over `window` [s].

    That which bends least, weighted, among those whose average is the recorded one: least squares.
    """
    from scipy.linalg import cho_solve_banded

    step, U = event.record.step, event.record.U
    at, near = np.arange(1 - len(weights) // 2, len(U) + len(weights) // 2 - 1), (window + EDGE) / step
    free = (np.abs(at - event.start) < near) | (np.abs(at - event.end) < near)
    error = max(ERROR, event.noise_U)
    factor = _factor(weights.tobytes(), len(U), free.tobytes(), error)
    u = cho_solve_banded((factor, False), np.convolve(U, weights) / error**2)
    return replace(event, record=replace(event.record, U=u[len(weights) // 2 :][: len(U)]))


@functools.lru_cache(maxsize=32)
def _factor(weights: bytes, n: int, free: bytes, error: float) -> np.ndarray:
    """The banded Cholesky factor of the normal equations: the same for every voltage of one event."""
    from scipy.linalg import cholesky_banded
    from scipy.sparse import diags_array

    w, bends = np.frombuffer(weights), np.where(np.frombuffer(free, bool), BENT, CALM) ** -2.0
    wide, most = n + len(w) - 1, max(len(w) - 1, 2)
    across: Any = list(range(len(w)))  # SciPy's type of it is inferred from its default, one diagonal
    second: Any = [0, 1, 2]
    box = diags_array(list(w), offsets=across, shape=(n, wide))
    bend = diags_array([1.0, -2.0, 1.0], offsets=second, shape=(wide - 2, wide))
    normal = box.T @ box / error**2 + bend.T @ diags_array(bends) @ bend
    return cholesky_banded(np.array([np.pad(normal.diagonal(k), (k, 0)) for k in range(most, -1, -1)]))
