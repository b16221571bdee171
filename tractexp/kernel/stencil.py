"""An expression of the samples about each sample, computed as machine code: for the loops of a plugin.

What a recorder does to a response is of this kind, and every candidate passes through it as often as it is simulated.
"""

import ctypes
import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.kernel import objects
from tractexp.kernel.kernel import NUMBERS, WHOLE
from tractexp.kernel.layout import WIDTH
from tractexp.texts import text_in

FUNCTION = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 3)


class Stencil:
    """An expression in the samples of rows, such as responses of candidates, of arrays that all rows share, and in one
    number a row.

    `expression` is called by name with a function `y(k)` for each array, which gives the symbol of its element k
    samples further, and with the symbol of each number; it returns a SymPy expression.
    """

    def __init__(
        self, expression: Callable[..., Any], rows: Sequence[str], shared: Sequence[str] = (),
        numbers: Sequence[str] = (),
    ):  # fmt: skip
        self.expression, self.rows, self.shared, self.numbers = expression, tuple(rows), tuple(shared), tuple(numbers)

    @functools.cached_property
    def _ir(self) -> tuple[str, int, int]:
        settings = repr((self.expression.__qualname__, self.rows, self.shared, self.numbers))
        description = text_in(self.expression.__module__, settings, lambda: "\n".join(map(str, ir_of(self))), "stencil")
        first, last, text = description.split("\n", 2)
        return text, int(first), int(last)

    @functools.cached_property
    def _function(self) -> tuple[Any, Any]:
        code = objects.load(self._ir[0])
        return FUNCTION(code.address), code

    def __call__(self, out: np.ndarray, shifts: np.ndarray | Mapping[str, np.ndarray], **given: np.ndarray) -> None:
        """Write the expression at the samples `shifts` (rows,) + 0, 1, ... of each row to out (rows, N).

        Arrays of rows are (rows, M), shared ones (M,), numbers (rows,), of float64 and C-contiguous; shifts are
        integers, the same for all arrays or by the names of those of rows, of which shared ones follow the first.
        Raises `ValueError` for another shape or type, and where a sample asked for is not there.
        """
        _, first, last = self._ir
        count, samples = out.shape
        length = given[(*self.rows, *self.shared)[0]].shape[-1]
        shapes = dict.fromkeys(self.rows, (count, length)) | dict.fromkeys(self.shared, (length,))
        shapes |= dict.fromkeys(self.numbers, (count,))
        arrays = [np.ascontiguousarray(given[name], dtype=NUMBERS) for name in shapes]
        for (name, shape), array in zip(shapes.items(), arrays, strict=True):
            if array.shape != shape:
                raise ValueError(f"a stencil's {name} has the shape {array.shape}, and must have {shape}")
        if out.dtype != NUMBERS or not out.flags.c_contiguous:
            raise ValueError(f"a stencil writes to C-contiguous arrays of float64, and out is {out.dtype} {out.shape}")
        each = [shifts[name] if isinstance(shifts, Mapping) else shifts for name in self.rows]
        shifts = np.array(each, dtype=WHOLE)
        if shifts.shape != (len(self.rows), count):
            raise ValueError(f"a stencil's shifts have the shape {shifts.shape[1:]}, and must have {(count,)}")
        if count and (shifts.min() + first < 0 or shifts.max() + samples - 1 + last >= length):
            raise ValueError(
                f"a stencil of the samples {first} to {last} about each of {samples}, {shifts.min()} to {shifts.max()}"
                f" further, does not fit arrays of {length} samples"
            )
        places = np.array([array.ctypes.data for array in arrays], dtype=WHOLE)
        self._function[0](out.ctypes.data, shifts.ctypes.data, places.ctypes.data, count, samples, length)


def ir_of(stencil: Stencil) -> tuple[int, int, str]:
    """The first and last sample that a stencil reads, counted from each one's own, and its IR for this machine."""
    import sympy

    from tractexp.kernel.expressions import Expressions
    from tractexp.kernel.function import Function
    from tractexp.kernel.graph import symbols_of
    from tractexp.kernel.numbers import Numbers

    elements: dict[Any, tuple[str, int]] = {}

    def element(name: str, k: int) -> Any:
        symbol = sympy.Symbol(f"{name}_at_{k}".replace("-", "minus_"), real=True)
        elements[symbol] = name, k
        return symbol

    single = {name: sympy.Symbol(name, real=True) for name in stencil.numbers}
    arrays = {name: functools.partial(element, name) for name in (*stencil.rows, *stencil.shared)}
    expression = stencil.expression(**arrays, **single)
    f = Function()
    lanes, scalars = Numbers(f, WIDTH), Numbers(f, 1)
    addresses = (f.value(f"getelementptr ptr, ptr %places, i64 {k}") for k in itertools.count())
    names = (*stencil.rows, *stencil.shared, *stencil.numbers)
    places = {name: f.value(f"load ptr, ptr {a}, align 8") for name, a in zip(names, addresses, strict=False)}
    with f.loop(0, "%rows") as row:
        shifts = [
            f.count("%shifts", f.integer("add", f.integer("mul", "%rows", k), row)) for k in range(len(stencil.rows))
        ]
        scope: dict[Any, str] = {
            symbol: lanes.everywhere(scalars.part(f.at(places[name], row), "")) for name, symbol in single.items()
        }
        begin = {name: f.at(places[name], shifts[0]) for name in stencil.shared}
        for name, shift in zip(stencil.rows, shifts, strict=True):
            begin[name] = f.at(places[name], f.integer("add", f.integer("mul", row, "%length"), shift))
        with f.loop(0, "%samples", lanes.width) as i:
            left = f.integer("sub", "%samples", i)
            used = symbols_of(expression)
            for symbol, (name, k) in elements.items():
                if symbol in used:
                    scope[symbol] = lanes.part(f.at(begin[name], f.integer("add", i, k)), left)
            place = f.at("%out", f.integer("add", f.integer("mul", row, "%samples"), i))
            lanes.store_part(Expressions(lanes, scope)(expression), place, left)
    arguments = (*(f"ptr noalias %{a}" for a in ("out", "shifts", "places")), "i64 %rows, i64 %samples, i64 %length")
    text = "\n".join([*f.intrinsics.values(), f.text(f"define void @run({', '.join(arguments)}) nounwind")])
    offsets = [k for _, k in elements.values()]
    return min(offsets), max(offsets), text
