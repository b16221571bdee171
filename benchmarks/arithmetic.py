"""How fast a kernel could be: its operations, counted in the machine code, at the rate this processor is seen to do.

Counted are the packed floating-point instructions of the two loops over candidates: the one run once a sample (power,
its squared errors) and the one run once a step. A fused multiply-add is one operation; what a load, a store, a move or
an integer shift costs is not counted, so the limit is one that no code with these operations can pass.
"""

import re
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from tractexp.doors.numba_vector_width import prefer_vectors

PACKED = re.compile(r"v(fn?m|mul|div|sqrt|add|sub|max|min|rndscale|round)\w*pd\b|vcvt")
MULTIPLIES = re.compile(r"vfn?m|vmul")
DIVIDES = re.compile(r"vdiv|vsqrt")
CHAINS, DEPTH, LANES = 12, 20, 64  # of the loop that shows the rate: enough to hide that an operation takes 4 cycles


@dataclass(frozen=True)
class Count:
    """Operations per vector of candidates."""

    multiplications: int  # fused or not
    others: int  # additions, minima, maxima, roundings, conversions

    @property
    def all(self) -> int:
        return self.multiplications + self.others


@dataclass(frozen=True)
class Limit:
    """What the arithmetic alone takes."""

    sample: Count
    step: Count
    substeps: int
    lanes: int  # candidates in a vector
    rate: float  # vector operations per nanosecond

    @property
    def nanoseconds(self) -> float:
        """Per Runge-Kutta step and candidate."""
        return (self.sample.all / self.substeps + self.step.all) / self.lanes / self.rate


def limit(run: Any, states: int, substeps: int, bits: int, rounds: int) -> Limit:
    """Of a kernel's `run`, compiled in this process with vectors of so many bits."""
    sample, step = counts(run.inspect_asm(run.signatures[0]), states)
    mix = (step.multiplications * substeps + sample.multiplications, step.others * substeps + sample.others)
    measured = rate(Count(*mix), bits)
    return Limit(sample, step, substeps, bits // 64, max(measured() for _ in range(rounds)))


def counts(assembly: str, states: int) -> tuple[Count, Count]:
    """Operations once a sample and once a step, of a kernel without memories. Raises `ValueError` for other code."""
    loops = [_operations(body) for body in _loops(assembly)]
    loops = [(stores, operations) for stores, operations in loops if operations.total() > 5]
    samples = [operations for stores, operations in loops if stores == 4]  # P, Q and both sums
    steps = [operations for stores, operations in loops if stores == states != 4]
    if len(samples) != 1 or len(steps) != 1:
        raise ValueError("the loops over candidates are not those of a kernel on x86 with AVX")
    if samples[0]["divides"] or steps[0]["divides"]:
        raise ValueError("a division takes many times as long as other operations; its kernel has no limit stated here")
    return tuple(Count(o["multiplies"], o["other"]) for o in (samples[0], steps[0]))


def _loops(assembly: str) -> list[list[str]]:
    """Bodies of the loops that are one run of instructions."""
    found, label, body = [], "", []
    for line in assembly.splitlines():
        if named := re.match(r"(\.L\w+):", line):
            label, body = named[1], []
        elif line.startswith("\t") and not line.startswith("\t."):
            body.append(line.split("#")[0].strip())
            if re.fullmatch(rf"j\w+\s+{re.escape(label)}", body[-1]):
                found.append(body)
    return found


def _operations(body: list[str]) -> tuple[int, Counter]:
    """Vectors stored, and operations by kind."""
    packed = [line for line in body if re.search(r"%[yz]mm", line)]
    stores = sum(bool(re.match(r"vmov[au]pd\s+%[yz]mm\d+, .*\)$", line)) for line in packed)
    operations = Counter()
    for line in packed:
        if PACKED.match(line):
            kind = "divides" if DIVIDES.match(line) else "multiplies" if MULTIPLIES.match(line) else "other"
            operations[kind] += 1
    return stores, operations


def rate(mix: Count, bits: int) -> Callable[[], float]:
    """A call that does such a mix of operations in registers only, and returns vector operations per nanosecond."""
    fused = round(CHAINS * mix.multiplications / mix.all)
    names = [f"a{c}" for c in range(CHAINS)]
    once = [f"{a} = {a} * x + y" if c < fused else f"{a} = {a} + y" for c, a in enumerate(names)]
    body = [f"{a} = W[{c * LANES} + k]" for c, a in enumerate(names)]
    body += once * DEPTH + [f"W[{c * LANES} + k] = {a}" for c, a in enumerate(names)]
    text = ["def work(W, x, y, times):", "    prefer_vectors(bits)", "    for _ in range(times):"]
    text += [f"        for k in range({LANES}):", *(f"            {line}" for line in body)]
    space = {"prefer_vectors": prefer_vectors, "bits": bits}
    exec("\n".join(text), space)
    work, W, times = njit(fastmath={"contract"})(space["work"]), np.ones(CHAINS * LANES + 8), 50
    W = W[(64 - W.ctypes.data % 64) // 8 :]

    def measured() -> float:
        started = time.perf_counter()
        work(W, 0.5, 0.5, times)
        seconds = time.perf_counter() - started
        return times * CHAINS * DEPTH * LANES / (bits / 64) / seconds * 1e-9

    measured()
    return measured
