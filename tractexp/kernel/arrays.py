"""The arithmetic of kernels on arrays of NumPy: what expressions give at some points, without
compiling anything.
"""

from typing import Any

import numpy as np

COMPARISONS = {
    "olt": np.less,
    "ole": np.less_equal,
    "ogt": np.greater,
    "oge": np.greater_equal,
    "oeq": np.equal,
    "une": np.not_equal,
}
LOGIC = {"and": np.logical_and, "or": np.logical_or, "xor": np.logical_xor}
INTEGERS = {
    "add": np.add,
    "sub": np.subtract,
    "shl": np.left_shift,
    "ashr": np.right_shift,
    "and": np.bitwise_and,
    "xor": np.bitwise_xor,
}
CALLS = {"fabs": np.abs, "floor": np.floor, "ceil": np.ceil, "sqrt": np.sqrt}


class Arrays:
    """As `numbers.Numbers`, of arrays (points,); `flags` mean nothing here."""

    divide, negative, size, root, differ = np.divide, np.negative, np.abs, np.sqrt, np.not_equal
    select = staticmethod(np.where)

    def __init__(self, points: int):
        """Numbers that are arrays of so many points."""
        self.points = points

    def constant(self, x: float) -> np.ndarray:
        """A number at every point."""
        return np.full(self.points, float(x))

    def whole(self, x: int) -> np.ndarray:
        """An integer at every point."""
        return np.full(self.points, x, dtype=np.int64)

    def truth(self, holds: bool) -> np.ndarray:
        """A truth value at every point."""
        return np.full(self.points, holds)

    def add(self, a: np.ndarray, b: np.ndarray, flags: str = "") -> np.ndarray:
        """a + b."""
        return a + b

    def subtract(self, a: np.ndarray, b: np.ndarray, flags: str = "") -> np.ndarray:
        """a - b."""
        return a - b

    def multiply(self, a: np.ndarray, b: np.ndarray, flags: str = "") -> np.ndarray:
        """a b."""
        return a * b

    def multiply_add(
        self, a: np.ndarray, b: np.ndarray, c: np.ndarray, flags: str = ""
    ) -> np.ndarray:
        """a b + c, rounded twice where a processor may round once."""
        return a * b + c

    def polynomial(
        self, x: np.ndarray, coefficients: tuple[float, ...], flags: str = ""
    ) -> np.ndarray:
        """The polynomial at x, the coefficient of the highest power first."""
        return np.polyval(coefficients, x)

    def compare(self, how: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Where a comparison holds, by LLVM's name of it."""
        return COMPARISONS[how](a, b)

    def larger(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The larger of both; b where one is nan."""
        return np.where(a > b, a, b)

    def smaller(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The smaller of both; b where one is nan."""
        return np.where(a < b, a, b)

    def logic(self, operation: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """and, or, xor of truth values."""
        return LOGIC[operation](a, b)

    def call(self, name: str, a: np.ndarray) -> np.ndarray:
        """A function of LLVM, by its name."""
        return CALLS[name](a)

    def as_bits(self, a: np.ndarray) -> np.ndarray:
        """The 64 bits of each number."""
        return a.view(np.int64)

    def of_bits(self, a: np.ndarray) -> np.ndarray:
        """The numbers of which these are the bits."""
        return a.view(np.float64)

    def integer(self, operation: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """An operation on integers, by LLVM's name of it."""
        return INTEGERS[operation](a, b)


def evaluate_phase(phase: Any, scope: dict[Any, np.ndarray], points: int) -> list[np.ndarray]:
    """The values (points,) of a phase's expressions; nan and infinity where they have none."""
    from tractexp.kernel.expressions import Expressions

    with np.errstate(all="ignore"):
        return Expressions(Arrays(points), scope).evaluate_phase(phase)
