"""What a recorder's filter makes of a jump that an effect puts into the currents, of waveforms.

Voltage and currents pass the same anti-alias filter, which a linear load does not notice: what it
makes of the filtered voltage is the filtered current. A contactor that opens is not linear. Its
jump is recorded over two or three samples, with an overshoot of a few per cent, by a filter that
nobody told us, while it is calculated between two samples. So the samples at a jump tell of its
size and time, but nothing by how steep it is.
"""

import functools

import numpy as np

from tractexp.domain.wave_errors import measure_offset_from_neighbors
from tractexp.inference.context import Context

MOST_JUMPS = 4  # samples of one channel and event that are the least smooth
AROUND = 3  # samples on either side that a filter may spread a jump over
# of how far a sample lies off its neighbors: what may be wrong with it and with those around it
SPREAD = 1.0
# of the most that the effects change: from there a sample off its neighbors is a jump
LEAST_JUMP = 0.02


def find_jump_errors(context: Context, unit: np.ndarray) -> np.ndarray | None:
    """The errors that a recorder's filter may make at the jumps of the effects.

    Parameters
    ----------
    context : Context
        The records and kernels.
    unit : (D,)
        Coordinates of a fit; the effects that are present there make the jumps.

    Returns
    -------
    (k, C, N) array [pu] or None
        One standard deviation at one sample each. None where samples are averages over a window, in
        which no jump stays.
    """
    return None if context.domain.windowed else _compute_jump_errors(context, unit.tobytes())


# of the two fits that are examined side by side; it holds their context
@functools.lru_cache(maxsize=2)
def _compute_jump_errors(context: Context, key: bytes) -> np.ndarray:
    """The errors (k, C, N) [pu] at the jumps, for the bytes of the coordinates as a key that a
    cache can take.
    """
    at = context.coordinates
    unit = np.frombuffer(key)
    there = at.present(unit)
    if not there:
        return np.empty((0, *context.drive.measurements.shape))
    without = unit.copy()
    columns = at.sizes(there)
    without[columns] = at.null[columns]
    added = context.residual(unit, there) - context.residual(without, there)
    shapes = []
    for part in context.drive.parts:
        for c, change in enumerate(np.nan_to_num(added[:, part])):
            for k, size in _find_jump_samples(change):
                shapes.append(np.zeros(context.drive.measurements.shape))
                shapes[-1][c, part.start + k] = size
    return np.array(shapes).reshape(-1, *context.drive.measurements.shape)


def _find_jump_samples(added: np.ndarray) -> list[tuple[int, float]]:
    """The samples around the jumps of one channel (N,), each with the standard deviation [pu] of
    its error.
    """
    off = np.abs(measure_offset_from_neighbors(added))
    least = LEAST_JUMP * np.abs(added).max(initial=0.0)
    doubt: dict[int, float] = {}
    for k in np.argsort(-off)[:MOST_JUMPS].tolist():
        if off[k] > least:
            for near in range(max(k - AROUND, 0), min(k + AROUND + 1, len(off))):
                doubt[near] = max(doubt.get(near, 0.0), SPREAD * float(off[k]))
    return sorted(doubt.items())
