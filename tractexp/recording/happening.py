"""What happened to a voltage: its kind, its size, and whether a load model can be fitted to it."""

from dataclasses import dataclass

KINDS = (
    "dip", "swell", "interruption", "step", "ramp", "open pole", "dead line", "pole slip", "inrush",
)  # fmt: skip


@dataclass(frozen=True)
class Happening:
    """One event of a feeder. Voltages relative to that before it, powers in MW and Mvar."""

    kind: str  # of `KINDS`
    start: float  # s
    end: float  # s
    depth: float  # 1 - residual voltage over that before: negative for a swell
    jump: float  # degrees, of the positive-sequence voltage at its start
    U2: float  # greatest negative-sequence voltage during it, over V1 before
    before: tuple[float, float]  # P, Q
    after: tuple[float, float]
    worth: bool  # fitting
    why: str  # what makes it (not) worth fitting, one sentence
