"""An expression of the samples about each sample, computed as machine code: for the loops of a
plugin.

What a recorder does to a response is of this kind, and every candidate passes through it as often
as it is simulated. Each row is copied into a room of its own that stays in the processor's cache,
whatever its expression then reads.
"""

import ctypes
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.cache.texts import get_text_of_module
from tractexp.kernel import objects
from tractexp.kernel.kernel import NUMBERS, WHOLE
from tractexp.kernel.layout import VECTOR_LANES
from tractexp.kernel.numbers import ORDERED, Numbers

FUNCTION = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)


class Stencil:
    """An expression in the samples of responses, of arrays that all of them share, and in numbers
    of each.

    `expression` is called by name with a function for each array and with the symbol of each
    number; it returns a SymPy expression. `y(k)` is the symbol of an array's element k samples
    further, `y(k, "later")` that of the element k samples further than the shift of that name, by
    default the first. `sums` {name: row} are running sums of rows. Beyond the ends of a part an
    array is what it is there; `onward` lets rows go on by one step of their slope first.
    """

    def __init__(
        self,
        expression: Callable[..., Any],
        rows: Sequence[str],
        shared: Sequence[str] = (),
        numbers: Sequence[str] = (),
        sums: Mapping[str, str] | None = None,
        shifts: Sequence[str] = ("shift",),
        onward: bool = False,
    ):
        self.expression, self.rows, self.shared, self.numbers = (
            expression,
            tuple(rows),
            tuple(shared),
            tuple(numbers),
        )
        self.sums, self.shifts, self.onward = dict(sums or {}), tuple(shifts), onward

    @functools.cached_property
    def _generated_code(self) -> tuple[str, int, int]:
        """The LLVM text, and the first and last sample that it reads, counted from each one."""
        arrays = self.rows, self.shared, self.numbers, self.sums, self.shifts, self.onward
        settings = repr((self.expression.__qualname__, *arrays))
        description = get_text_of_module(
            self.expression.__module__,
            settings,
            lambda: "\n".join(map(str, write_ir(self))),
            "stencil",
        )
        first, last, text = description.split("\n", 2)
        return text, int(first), int(last)

    @functools.cached_property
    def _function(self) -> tuple[Any, Any]:
        """The compiled function, and what must live as long as it does."""
        code = objects.load(self._generated_code[0])
        return FUNCTION(code.address), code

    def __call__(
        self,
        out: np.ndarray,
        parts: Sequence[slice],
        shifts: np.ndarray | Mapping[str, np.ndarray],
        **given: np.ndarray,
    ) -> None:
        """Write the expression at each sample within the E `parts` of responses to `out` (C, n, N).

        Arrays of rows are (C, n, N), shared ones (N,), of float64 and contiguous in their last
        axis; `out` may be one of the rows. `shifts` are integers, and they and the numbers fit (E,
        C, n). Raises `ValueError` for another shape or type.
        """
        _, first, last = self._generated_code
        channels, count, samples = out.shape
        whole = (len(parts), channels, count)
        named = [shifts[name] for name in self.shifts] if isinstance(shifts, Mapping) else [shifts]
        each = np.stack([_broadcast("shifts", shift, whole, WHOLE) for shift in named])
        numbers = [_broadcast(name, given[name], whole, NUMBERS) for name in self.numbers]
        for name in self.rows:
            _check(name, given[name], out.shape)
        for name in self.shared:
            _check(name, given[name], (samples,))
        _check("out", out, out.shape)
        ends = np.array([part.indices(samples)[:2] for part in parts], dtype=WHOLE).reshape(-1, 2)
        if not each.size or not len(ends):
            return
        lengths = ends[:, 1] - ends[:, 0]
        if lengths.min() < 1:
            raise ValueError(
                f"a stencil's parts must have a sample each, and {parts} of {samples} have"
                f" {lengths}"
            )
        beyond = max(int(each.max()) + last, -int(each.min()) - first, 0)
        rows, shared = [given[name] for name in self.rows], [given[name] for name in self.shared]
        rooms = np.empty(
            (
                len(rows) + len(shared) + len(self.sums),
                int(lengths.max()) + 2 * beyond + 3 * VECTOR_LANES,
            )
        )
        given_at = [array.ctypes.data for array in (out, *rows, *shared, *numbers)]
        rooms_at = rooms.ctypes.data + rooms.itemsize * (
            VECTOR_LANES + rooms.shape[1] * np.arange(len(rooms))
        )
        places = np.array([*given_at, *rooms_at], dtype=WHOLE)
        steps = [step // array.itemsize for array in (out, *rows) for step in array.strides[:2]]
        sizes = np.concatenate([np.array([*whole, beyond, *steps], dtype=WHOLE), ends.ravel()])
        self._function[0](places.ctypes.data, each.ctypes.data, sizes.ctypes.data)


def _broadcast(name: str, array: np.ndarray, shape: tuple[int, ...], kind: np.dtype) -> np.ndarray:
    """An array as large as `shape`, which it must fit."""
    try:
        return np.ascontiguousarray(np.broadcast_to(np.asarray(array, dtype=kind), shape))
    except ValueError:
        raise ValueError(
            f"a stencil's {name} has the shape {np.shape(array)}, and must fit {shape}"
        ) from None


def _check(name: str, array: np.ndarray, shape: tuple[int, ...]) -> None:
    """Raise ValueError for an array of another shape or type than the compiled code reads."""
    if array.shape != shape:
        raise ValueError(f"a stencil's {name} has the shape {array.shape}, and must have {shape}")
    if array.dtype != NUMBERS or (array.size > 1 and array.strides[-1] != array.itemsize):
        raise ValueError(
            f"a stencil's {name} is {array.dtype}, and must be float64, its last axis contiguous"
        )


def write_ir(stencil: Stencil) -> tuple[int, int, str]:
    """The first and last sample that a stencil reads, counted from each one's own, and its IR for
    this machine.
    """
    import sympy

    from tractexp.kernel.expressions import Expressions
    from tractexp.kernel.function import Function
    from tractexp.kernel.graph import collect_symbols

    elements: dict[Any, tuple[str, int, str]] = {}

    def element(name: str, k: int, shift: str = stencil.shifts[0]) -> Any:
        symbol = sympy.Symbol(f"{name}_at_{k}_{shift}".replace("-", "minus_"), real=True)
        elements[symbol] = name, k, shift
        return symbol

    single = {name: sympy.Symbol(name, real=True) for name in stencil.numbers}
    arrays = {
        name: functools.partial(element, name)
        for name in (*stencil.rows, *stencil.sums, *stencil.shared)
    }
    expression = stencil.expression(**arrays, **single)
    used = collect_symbols(expression)
    elements = {symbol: element for symbol, element in elements.items() if symbol in used}
    f = Function()
    lanes, scalars = Numbers(f, VECTOR_LANES), Numbers(f, 1)
    given = ("out", *stencil.rows, *stencil.shared, *stencil.numbers)
    place = {name: f.address("%places", k) for k, name in enumerate(given)}
    held = (*stencil.rows, *stencil.shared, *stencil.sums)
    room = {name: f.address("%places", len(given) + k) for k, name in enumerate(held)}
    parts, channels, count, beyond = (f.count("%sizes", k) for k in range(4))
    steps = {
        name: [f.count("%sizes", 4 + 2 * k + m) for m in (0, 1)]
        for k, name in enumerate(("out", *stencil.rows))
    }
    every = f.integer("mul", parts, f.integer("mul", channels, count))
    with f.loop(0, parts) as e:
        at = f.integer("add", f.integer("mul", e, 2), 4 + 2 * len(steps))
        begin, end = f.count("%sizes", at), f.count("%sizes", f.integer("add", at, 1))
        samples = f.integer("sub", end, begin)
        for name in stencil.shared:
            _emit_copy(lanes, f.offset_address(place[name], begin), room[name], samples, beyond)
        with f.loop(0, channels) as c, f.loop(0, count) as i:
            row = f.integer(
                "add",
                f.integer("mul", f.integer("add", f.integer("mul", e, channels), c), count),
                i,
            )
            where = {}
            for name, (channel, candidate) in steps.items():
                further = f.integer(
                    "add", f.integer("mul", c, channel), f.integer("mul", i, candidate)
                )
                where[name] = f.offset_address(place[name], f.integer("add", begin, further))
            for name in stencil.rows:
                _emit_copy(lanes, where[name], room[name], samples, beyond, stencil.onward)
            for name, summed in stencil.sums.items():
                _emit_running_sum(lanes, room[summed], room[name], samples, beyond)
            scope: dict[Any, str] = {
                symbol: lanes.everywhere(scalars.part(f.offset_address(place[name], row), ""))
                for name, symbol in single.items()
            }
            shifted = {}
            for k, shift in enumerate(stencil.shifts):
                own = f.count("%shifts", f.integer("add", f.integer("mul", every, k), row))
                shifted[shift] = f.integer("add", beyond, own)
            with f.loop(0, samples, lanes.width) as t:
                for symbol, (name, k, shift) in elements.items():
                    at = f.integer("add", f.integer("add", t, k), shifted[shift])
                    scope[symbol] = lanes.load(f.offset_address(room[name], at), alignment=8)
                value = Expressions(lanes, scope)(expression)
                lanes.store_part(
                    value, f.offset_address(where["out"], t), f.integer("sub", samples, t)
                )
    body = f.text("define void @run(ptr %places, ptr %shifts, ptr %sizes) nounwind")
    text = "\n".join([*f.intrinsics.values(), body])
    offsets = [k for _, k, _ in elements.values()]
    return min(offsets), max(offsets), text


def _emit_copy(
    lanes: Numbers, row: str, room: str, samples: str, beyond: str, onward: bool = False
) -> None:
    """A row into its room, between what it is beyond its first and its last sample, each `beyond`
    times.
    """
    f, last = lanes.f, lanes.f.integer("sub", samples, 1)

    def edge(at: str, inside: str) -> str:
        end, next_to_it = (
            lanes.everywhere(f.fresh(f"load double, ptr {f.offset_address(row, k)}, align 8"))
            for k in (at, inside)
        )
        return lanes.add(end, lanes.subtract(end, next_to_it)) if onward else end

    edges = edge("0", f.smaller(1, last)), edge(last, f.integer("sub", last, f.smaller(1, last)))
    body = f.offset_address(room, beyond)
    with f.loop(0, beyond, lanes.width) as i:
        lanes.store(edges[0], f.offset_address(room, i), alignment=8)
    with f.loop(0, samples, lanes.width) as i:
        lanes.store(
            lanes.part(f.offset_address(row, i), f.integer("sub", samples, i)),
            f.offset_address(body, i),
            alignment=8,
        )
    with f.loop(0, beyond, lanes.width) as i:
        lanes.store(edges[1], f.offset_address(body, f.integer("add", samples, i)), alignment=8)


def _emit_running_sum(lanes: Numbers, row: str, room: str, samples: str, beyond: str) -> None:
    """The running sum of a row in its room from its first sample on, into another room.

    Beyond the ends it is a straight line. No sum depends on `beyond`, and so on what other rows
    need.
    """
    f = lanes.f
    body, before = f.offset_address(row, beyond), f.integer("sub", beyond, 1)
    total, end = f.offset_address(room, beyond), f.integer("sub", samples, 1)
    first, last = (
        lanes.everywhere(f.fresh(f"load double, ptr {f.offset_address(body, k)}, align 8"))
        for k in ("0", end)
    )
    with f.loop(0, beyond, lanes.width) as i:
        line = lanes.multiply(first, lanes.ramp(f.integer("sub", i, before)))
        lanes.store(line, f.offset_address(room, i), alignment=8)
    f.do(f"store double 0.0, ptr {f.offset_address(total, '-1')}, align 8")
    with f.loop(0, samples, lanes.width) as i:
        so_far = f.fresh(
            f"load double, ptr {f.offset_address(total, f.integer('sub', i, 1))}, align 8"
        )
        sums = lanes.prefix_sums(lanes.load(f.offset_address(body, i), alignment=8))
        lanes.store(
            lanes.add(lanes.everywhere(so_far), sums, ORDERED),
            f.offset_address(total, i),
            alignment=8,
        )
    whole = lanes.everywhere(f.fresh(f"load double, ptr {f.offset_address(total, end)}, align 8"))
    with f.loop(0, beyond, lanes.width) as i:
        line = lanes.multiply_add(last, lanes.ramp(f.integer("add", i, 1)), whole)
        lanes.store(line, f.offset_address(total, f.integer("add", samples, i)), alignment=8)
