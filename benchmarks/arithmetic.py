"""How fast a kernel could be: its operations, counted in the machine code, at the rate this
processor is seen to do.

Counted are the packed floating-point instructions of the loop over groups of candidates: what is
run once a sample (power, its squared errors) and what is run once a step. A fused multiply-add is
one operation; what a load, a store, a move or an integer shift costs is not counted, so the limit
is one that no code with these operations can pass.
"""

import ctypes
import re
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tractexp.kernel import objects
from tractexp.kernel.function import Function
from tractexp.kernel.kernel import Room
from tractexp.kernel.numbers import Numbers

PACKED = re.compile(r"v(fn?m|mul|div|sqrt|add|sub|max|min|rndscale|round)\w*pd\b|vcvt")
MULTIPLIES = re.compile(r"vfn?m|vmul")
DIVIDES = re.compile(r"vdiv|vsqrt")
# of the loop that shows the rate: enough to hide that an operation takes 4 cycles
CHAINS, DEPTH, TIMES = 12, 20, 400


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


def limit(text: str, substeps: int, rounds: int) -> Limit:
    """Of a kernel by its IR."""
    width = Room.from_text(text).width
    sample, step = counts(objects.write_assembly(text), Room.from_text(text).outputs)
    mix = (
        step.multiplications * substeps + sample.multiplications,
        step.others * substeps + sample.others,
    )
    measured = rate(Count(*mix), width)
    return Limit(sample, step, substeps, width, max(measured() for _ in range(rounds)))


def counts(assembly: str, outputs: int) -> tuple[Count, Count]:
    """Operations once a sample and once a step, of a kernel without memories. Raises `ValueError`
    for other code.

    A step is the run of instructions with most operations; outputs and sums are stored by one of
    their own.
    """
    blocks = [_operations(body) for body in _blocks(assembly)]
    samples = [operations for stores, operations in blocks if stores == 2 * outputs]
    steps = [operations for stores, operations in blocks if stores != 2 * outputs]
    sample, step = (max(some, key=Counter.total, default=Counter()) for some in (samples, steps))
    if not sample or not step:
        raise ValueError("the loop over candidates is not that of a kernel on x86 with AVX")
    if sample["divides"] or step["divides"]:
        raise ValueError(
            "a division takes many times as long as other operations; its kernel has no limit"
            " stated here"
        )
    return tuple(Count(o["multiplies"], o["other"]) for o in (sample, step))


def _blocks(assembly: str) -> list[list[str]]:
    """Instructions from label to label."""
    blocks: list[list[str]] = [[]]
    for line in assembly.splitlines():
        if re.match(r"\.?L\w+:", line):
            blocks.append([])
        elif line.startswith("\t") and not line.startswith("\t."):
            blocks[-1].append(line.split("#")[0].strip())
    return blocks


def _operations(body: list[str]) -> tuple[int, Counter]:
    """Vectors stored, and operations by kind."""
    packed = [line for line in body if re.search(r"%[xyz]mm", line)]
    stores = sum(bool(re.match(r"vmov[au]pd\s+%[yz]mm\d+, .*\)$", line)) for line in packed)
    operations = Counter()
    for line in packed:
        if PACKED.match(line) and re.search(r"%[yz]mm", line):
            kind = (
                "divides"
                if DIVIDES.match(line)
                else "multiplies"
                if MULTIPLIES.match(line)
                else "other"
            )
            operations[kind] += 1
    return stores, operations


def rate(mix: Count, width: int) -> Callable[[], float]:
    """A call that does such a mix of operations in registers only, and returns vector operations
    per nanosecond.
    """
    fused = round(CHAINS * mix.multiplications / mix.all)
    f = Function()
    n = Numbers(f, width)
    x = n.load("%work")
    with f.loop(0, TIMES):
        values = [n.load(f.offset_address("%work", c * width)) for c in range(CHAINS)]
        for _ in range(DEPTH):
            values = [
                n.multiply_add(a, x, x, "contract") if c < fused else n.add(a, x, "")
                for c, a in enumerate(values)
            ]
        for c, a in enumerate(values):
            n.store(a, f.offset_address("%work", c * width))
    loaded = objects.load(
        "\n".join([*f.intrinsics.values(), f.text("define void @run(ptr %work)")])
    )
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(loaded.address)
    work = np.full(CHAINS * width + 8, 0.5)
    address = -(-work.ctypes.data // 64) * 64

    def measured() -> float:
        work[:] = 0.5
        started = time.perf_counter()
        call(address)
        return TIMES * CHAINS * DEPTH / (time.perf_counter() - started) * 1e-9

    measured.code = loaded  # type: ignore[attr-defined] # which goes with the last that holds it
    measured()
    return measured
