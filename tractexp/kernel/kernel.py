"""A kernel to call: the arrays it is given are looked at first, since machine code
looks at none.
"""

import ctypes
import functools
import itertools
import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.kernel import objects, steady
from tractexp.kernel.layout import INPUTS, LANES, PHASOR_INPUTS

# releases Python's lock
FUNCTION = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 15, *[ctypes.c_int64] * 6)
VECTOR = 64  # bytes: a vector across two cache lines would take twice the time
NOTHING = np.empty((0, 0, 0))
NUMBERS, WHOLE = np.dtype(np.float64), np.dtype(np.int64)
PREFIX = "; room "  # of the line of a kernel's text that tells its `Room`


@dataclass(frozen=True)
class Room:
    """The room that a call needs beside its arrays: numbers of each candidate, of each event, and
    of the work space.
    """

    width: int  # lanes of a vector
    given: int  # of each candidate: its parameters, then P0 and Q0
    event: int  # of each event
    outputs: int
    starts: int  # states and memories before the event
    rows: int  # of each group of lanes
    points: int  # at each point in time that a step looks at
    signals: int  # at each sample

    @classmethod
    def from_text(cls, text: str) -> "Room":
        """As a kernel's text tells it."""
        line = text.split("\n", 2)[1]
        return cls(**json.loads(line.removeprefix(PREFIX)))


class Kernel:
    """The kernel of a text of `emit`. Safe in threads: each call has a work space of its own."""

    def __init__(self, text: str):
        """The kernel of a module's text, which says the room it needs."""
        self.text, self.room = text, Room.from_text(text)

    @functools.cached_property
    def _machine_code(self) -> tuple[Any, Any, int]:
        """The compiled simulation, what has to live as long as it, and the address in memory of
        Newton's method, which it calls.
        """
        code, newton = objects.load(self.text), objects.load(steady.write_steady(self.room.width))
        return FUNCTION(code.address), (code, newton), newton.address

    def run(
        self,
        candidates: np.ndarray,
        event: np.ndarray,
        first: np.ndarray,
        inputs: np.ndarray,
        measured: np.ndarray,
        weights: np.ndarray,
        substeps: np.ndarray,
        sums: np.ndarray,
        miss: np.ndarray,
        outputs: np.ndarray = NOTHING,
        starts: np.ndarray = NOTHING,
    ) -> None:
        """Simulate candidates over events and sum their weighted squared errors.

        All arrays are C-contiguous, of float64; `first` and `substeps` are of int64.

        Parameters
        ----------
        candidates : (E, given, n)
            Parameters, then P0 and Q0.
        event : (E, columns as in EVENT)
            Numbers of each event.
        first : (E + 1,)
            Where each event begins in the samples, and the end.
        inputs : (rows as in INPUTS or PHASOR_INPUTS, N)
            What drives the load.
        measured, weights : (C, N)
            What it is compared with, and weights of squared errors.
        substeps : (E,)
            Runge-Kutta steps per sample.
        sums : (E, C, n)
            Written: sums of weighted squared errors.
        miss : (E, n)
            Written: how far a candidate is from a steady state.
        outputs : (C, n, N)
            Written, unless it is empty.
        starts : (E, K, n)
            Written, unless it is empty: states and memories before the event.

        Raises
        ------
        ValueError
            For an array of another shape, order or type.
        """
        room = self.room
        rows = len(PHASOR_INPUTS), len(INPUTS)
        if candidates.ndim != 3 or inputs.ndim != 2 or inputs.shape[0] not in rows:
            raise ValueError(
                f"candidates {candidates.shape} and inputs {inputs.shape} must have shapes (events,"
                f" {room.given}, n) and ({rows[0]} or {rows[1]}, samples)"
            )
        (events, _, n), samples = candidates.shape, inputs.shape[1]
        _check("candidates", candidates, (events, room.given, n))
        _check("event", event, (events, room.event))
        _check("first", first, (events + 1,), WHOLE)
        _check("inputs", inputs, (inputs.shape[0], samples))
        _check("measured", measured, (room.outputs, samples))
        _check("weights", weights, (room.outputs, samples))
        _check("substeps", substeps, (events,), WHOLE)
        _check("sums", sums, (events, room.outputs, n))
        _check("miss", miss, (events, n))
        stored, started = int(outputs.size > 0), int(starts.size > 0)
        if stored:
            _check("outputs", outputs, (room.outputs, n, samples))
        if started:
            _check("starts", starts, (events, room.starts, n))
        lengths = _list_lengths(first.tolist(), substeps.tolist(), samples)
        block, work, points, signals, space = self._space(n, lengths)
        arrays = (candidates, event, first, inputs, measured, weights, substeps, sums, miss)
        further = _find_address(outputs) if stored else 0, _find_address(starts) if started else 0
        function, _, newton = self._machine_code
        function(
            *map(_find_address, arrays),
            *further,
            work,
            points,
            signals,
            newton,
            events,
            n,
            samples,
            block,
            stored,
            started,
        )
        del space  # not before the call has ended

    def starts(self, candidates: np.ndarray, event: np.ndarray) -> np.ndarray:
        """States and memories before the events (E, K, n); candidates and event as `run` takes
        them.
        """
        events, _, n = candidates.shape
        none, whole = np.empty((0, 0)), np.zeros(events + 1, dtype=np.int64)
        room = self.room
        starts = np.empty((events, room.starts, n))
        self.run(
            candidates,
            event,
            whole,
            none.reshape(len(INPUTS), 0),
            none.reshape(room.outputs, 0),
            none.reshape(room.outputs, 0),
            whole[1:] + 1,
            np.empty((events, room.outputs, n)),
            np.empty((events, n)),
            NOTHING,
            starts,
        )
        return starts

    def _space(
        self, n: int, lengths: list[tuple[int, int]]
    ) -> tuple[int, int, int, int, np.ndarray]:
        """Lanes of a block, addresses of work space, points and signals, and the array in which
        they lie.
        """
        room, width = self.room, self.room.width
        groups = -(-n // width)
        blocks = max(-(-groups * width // LANES), 1)
        block = max(width * -(-groups // blocks), width)
        work = room.rows * block  # whole vectors
        points = signals = 0
        for length, steps in lengths:
            whole = -(-length // width) * width
            points, signals = (
                max(points, room.points * (2 * steps * whole + 1)),
                max(signals, room.signals * whole),
            )
        space = np.empty(work + points + signals + VECTOR // 8)
        address = -(-_find_address(space) // VECTOR) * VECTOR
        return block, address, address + 8 * work, address + 8 * (work + points), space


def _check(name: str, array: np.ndarray, shape: tuple[int, ...], kind: np.dtype = NUMBERS) -> None:
    """Raise ValueError for an array of another shape, order or type than the compiled code
    reads.
    """
    if array.shape == shape and array.flags.c_contiguous and array.dtype == kind:
        return
    order = "" if array.flags.c_contiguous else ", not C-contiguous"
    raise ValueError(
        f"a kernel's {name} is {array.dtype} {array.shape}{order}; it must be {kind} {shape},"
        " C-contiguous"
    )


def _find_address(array: np.ndarray) -> int:
    """Where its first element lies; a third of the time that `array.ctypes` takes, where the array
    can be written.
    """
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))  # pyright: ignore[reportArgumentType] # it is a buffer
    except (TypeError, ValueError):  # of what is empty or must not be written
        return array.ctypes.data


def _list_lengths(first: list[int], substeps: list[int], samples: int) -> list[tuple[int, int]]:
    """Samples and steps a sample of each event. Raises `ValueError` where they point outside the
    arrays.
    """
    lengths = [end - begin for begin, end in itertools.pairwise(first)]
    if first[0] < 0 or first[-1] > samples or any(length < 0 for length in lengths):
        raise ValueError(
            f"a kernel's first = {first} must rise from 0 at least to at most the {samples} samples"
        )
    if any(steps < 1 for steps in substeps):
        raise ValueError(f"a kernel's substeps = {substeps}: each must be 1 or more")
    return list(zip(lengths, substeps, strict=True))
