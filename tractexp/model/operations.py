"""The arithmetic of a kernel, counted in its IR: what a simulation costs, whatever machine runs it.

Additions, multiplications and divisions are those written, an exponential or a logarithm taken
apart into its own; what does not differ between the lanes counts for one in all of them. Signs,
choices, conversions and the indices of arrays count for nothing.
"""

import re
from collections import Counter
from dataclasses import astuple, dataclass

from tractexp.kernel.layout import LANES

PASSAGE = re.compile(r"  ; (begin|end) (\w+)$")
VALUE = re.compile(r"  %\w+ = (\w+) [^<]*<\d+ x (?:double|i64)> ")
CALL = re.compile(r"  %\w+ = call [^@]*@llvm\.(sqrt|floor|ceil)\.")
KINDS = {
    "fadd": "additions",
    "fsub": "additions",
    "fmul": "multiplications",
    "fdiv": "divisions",
    "fcmp": "others",
    "shl": "others",
    "ashr": "others",
}
# of each step, at which what is the same in all lanes is computed: its beginning and its middle
POINTS_A_STEP = 2


@dataclass(frozen=True)
class Operations:
    """Operations in double precision. `others` are comparisons, minima and maxima among them,
    roots, roundings and shifts.
    """

    additions: float = 0
    multiplications: float = 0
    divisions: float = 0
    others: float = 0

    @property
    def total(self) -> float:
        """All of them together."""
        return sum(astuple(self))

    def __add__(self, other: "Operations") -> "Operations":
        """Those of both."""
        return Operations(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def __mul__(self, times: float) -> "Operations":
        """So many times these."""
        return Operations(*(times * each for each in astuple(self)))


@dataclass(frozen=True)
class Cost:
    """The operations that one candidate costs: of a Runge-Kutta step, and of a sample without
    its steps.
    """

    step: Operations
    sample: Operations

    def per_sample(self, substeps: int) -> Operations:
        """The operations of a sample with so many steps."""
        return self.sample + self.step * substeps


def count(text: str) -> Cost:
    """The operations of a kernel as `emit.text` writes it."""
    totals: dict[str, Counter[str]] = {
        name: Counter() for name in ("points", "signals", "outputs", "step")
    }
    inside: list[str] = []
    for line in text.splitlines():
        if passage := PASSAGE.match(line):
            if passage[1] == "begin":
                inside.append(passage[2])
            else:
                inside.pop()
        elif inside:
            value = VALUE.match(line)
            kind = "others" if CALL.match(line) else KINDS.get(value[1]) if value else None
            if kind:
                totals[inside[-1]][kind] += 1
    points, signals, outputs, step = (Operations(**total) for total in totals.values())
    return Cost(step + points * (POINTS_A_STEP / LANES), outputs + signals * (1 / LANES))
