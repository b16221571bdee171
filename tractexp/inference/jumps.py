"""What a recorder's filter makes of a jump that an effect puts into the currents, of waveforms.

Voltage and currents pass the same anti-alias filter, which a linear load does not notice: what it
makes of the filtered voltage is the filtered current. A contactor that opens is not linear. Its
jump is recorded over two or three samples, with an overshoot of a few per cent, by a filter that
nobody told us, while it is calculated between two samples. So the samples at a jump tell of its
size and time, but nothing by how steep it is.
"""

import functools

import numpy as np

from tractexp.domain.wave_errors import off_neighbors
from tractexp.inference.context import Context

MOST_JUMPS = 4  # samples of one channel and event that are the least smooth
AROUND = 3  # samples on either side that a filter may spread a jump over
# of how far a sample lies off its neighbors: what may be wrong with it and with those around it
SPREAD = 1.0
# of the most that the effects change: from there a sample off its neighbors is a jump
LEAST_JUMP = 0.02


def jumps(context: Context, unit: np.ndarray) -> np.ndarray | None:
    """What may be wrong at the jumps that effects make at coordinates (D,), one standard deviation:
    (k, C, N) [pu].

    None where samples are averages over a window, in which no jump stays.
    """
    return None if context.domain.windowed else _jumps(context, unit.tobytes())


# of the two fits that are examined side by side; it holds their context
@functools.lru_cache(maxsize=2)
def _jumps(context: Context, key: bytes) -> np.ndarray:
    """The shapes (k, C, N) of the jumps that the effects present at these coordinates make, for a
    key of the coordinates' bytes; the caller caches them.
    """
    at, unit = context.coordinates, np.frombuffer(key)
    there = at.present(unit)
    if not there:
        return np.empty((0, *context.drive.measurements.shape))
    without = unit.copy()
    columns = at.sizes(there)
    without[columns] = at.null[columns]
    added = context.residuals(unit[None], there)[0] - context.residuals(without[None], there)[0]
    shapes = []
    for e in range(len(context.events)):
        part = context.drive.part(e)
        for c, change in enumerate(np.nan_to_num(added[:, part])):
            for k, size in _at_jumps(change):
                shapes.append(np.zeros(context.drive.measurements.shape))
                shapes[-1][c, part.start + k] = size
    return np.array(shapes).reshape(-1, *context.drive.measurements.shape)


def _at_jumps(added: np.ndarray) -> list[tuple[int, float]]:
    """The samples around the jumps of one channel (N,), each with what may be wrong
    with it [pu].
    """
    off, least = np.abs(off_neighbors(added)), LEAST_JUMP * np.abs(added).max(initial=0.0)
    doubt: dict[int, float] = {}
    for k in np.argsort(-off)[:MOST_JUMPS].tolist():
        if off[k] > least:
            for near in range(max(k - AROUND, 0), min(k + AROUND + 1, len(off))):
                doubt[near] = max(doubt.get(near, 0.0), SPREAD * float(off[k]))
    return sorted(doubt.items())
