"""Kernels by themselves: their mathematics, what they are given, what they are compiled to."""

import copy
import ctypes
import subprocess
import sys
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import sympy
from llvmlite import binding as llvm

from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.kernel import arrays, emit, listing, math, objects
from tractexp.kernel.expressions import Expressions
from tractexp.kernel.function import Function
from tractexp.kernel.kernel import Kernel
from tractexp.kernel.layout import LANES, VECTOR_LANES
from tractexp.kernel.lowered import Phase
from tractexp.kernel.numbers import Numbers
from tractexp.kernel.stencil import Stencil
from tractexp.model.drive import Drive, Excitation
from tractexp.model.lowering import lower
from tractexp.model.model import compose

X, Y = sympy.symbols("x y", real=True)


def computed(expression, x, y=None, width=None):
    """An expression in X and Y as machine code computes it, (n,)."""
    f = Function()
    n = Numbers(f, width or VECTOR_LANES)
    with f.loop(0, "%n", n.width) as i:
        left = f.integer("sub", "%n", i)
        known = {
            X: n.part(f.offset_address("%x", i), left),
            Y: n.part(f.offset_address("%y", i), left),
        }
        n.store_part(Expressions(n, known)(expression), f.offset_address("%out", i), left)
    text = "\n".join(
        [*f.intrinsics.values(), f.text("define void @run(ptr %x, ptr %y, ptr %out, i64 %n)")]
    )
    loaded, out = objects.load(text), np.full(len(x), 77.0)
    y = np.zeros(len(x)) if y is None else y
    run = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, ctypes.c_int64)(loaded.address)
    run(x.ctypes.data, y.ctypes.data, out.ctypes.data, len(x))
    return out


# Mathematics

# half powers of 2
WIDE = np.concatenate([np.linspace(-699, 699, 20001), np.arange(-1000, 1000) * 0.34657359027997264])
SMALL = np.concatenate([np.linspace(-1, 1, 4001), 10.0 ** np.arange(-300, 0)])
ANGLES = np.concatenate(
    [np.linspace(-20, 20, 4001), np.random.default_rng(0).uniform(-1e6, 1e6, 4000)]
)
POSITIVE = np.concatenate([10.0 ** np.linspace(-300, 300, 4001), np.linspace(0.5, 2, 4001)])


def test_the_exponential():
    x = WIDE[abs(WIDE) < 700]
    assert np.abs(computed(sympy.exp(X), x) / np.exp(x) - 1).max() < 2e-13
    odd = computed(sympy.exp(X), np.array([0.0, np.nan, 800.0, 700.0, -np.inf, -700.0]))
    assert odd[0] == 1.0
    assert np.isnan(odd[1])
    assert odd[2] == odd[3]
    assert odd[4] == odd[5] > 0


def test_the_logarithm():
    off = np.abs(computed(sympy.log(X), POSITIVE) - np.log(POSITIVE))
    assert (off / np.maximum(1, np.abs(np.log(POSITIVE)))).max() < 1e-14
    odd = computed(sympy.log(X), np.array([1.0, 0.0, np.nan]))
    assert odd[0] == 0.0
    assert odd[1] == pytest.approx(-709, abs=1)
    assert np.isnan(odd[2])


@pytest.mark.parametrize("p", [0.3, -1.7, 2.345])
def test_a_power_of_a_number(p):
    x = POSITIVE[(POSITIVE > 1e-40) & (POSITIVE < 1e40)]
    assert np.abs(computed(X**p, x) / x**p - 1).max() < 2e-13 + 100 * 1e-14 * abs(p)
    assert np.isnan(computed(X**p, np.array([-1.0, np.nan]))).all()


def test_a_power_whose_exponent_is_no_number():
    """A steady state and a constant may have one: a term of the library before a static load."""
    x, y = np.linspace(0.01, 3.0, 101), np.linspace(-2.0, 2.0, 101)
    assert np.abs(computed((1 + X) ** Y, x, y) / (1 + x) ** y - 1).max() < 1e-12


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_waves(name):
    x = ANGLES
    assert np.abs(computed(getattr(sympy, name)(X), x) - getattr(np, name)(x)).max() < 1e-15
    assert np.isnan(computed(getattr(sympy, name)(X), np.array([np.nan]))).all()


@pytest.mark.parametrize(
    ("name", "x", "most"),
    [
        ("tan", ANGLES[np.abs(np.cos(ANGLES)) > 0.1], 2e-13),
        ("atan", np.concatenate([WIDE, SMALL]), 1e-15),
        ("asin", SMALL, 1e-15),
        ("acos", SMALL, 1e-15),
        ("tanh", np.concatenate([WIDE, SMALL]), 2e-13),
    ],
)
def test_further_functions(name, x, most):
    theirs = {"atan": np.arctan, "asin": np.arcsin, "acos": np.arccos}.get(name) or getattr(
        np, name
    )
    assert np.abs(computed(getattr(sympy, name)(X), x) - theirs(x)).max() < most


@pytest.mark.parametrize("name", ["sinh", "cosh"])
def test_hyperbolic_functions(name):
    x = WIDE[abs(WIDE) < 600]
    theirs = getattr(np, name)(x)
    assert (
        np.abs(computed(getattr(sympy, name)(X), x) - theirs) / np.maximum(1, np.abs(theirs))
    ).max() < 2e-13


def test_the_angle_of_a_point():
    x, y = np.random.default_rng(1).normal(size=(2, 999))
    x[:6], y[:6] = (0, 0, 1, -1, 0, 2), (1, -1, 0, 0, 0, -2)
    assert np.abs(computed(sympy.atan2(Y, X), x, y) - np.arctan2(y, x)).max() < 1e-15


EVERY = [
    X**3 - 2 * X * Y + 1 / (Y**2 + 1),
    X**-2,
    sympy.sqrt(X**2 + 1) ** 3,
    sympy.Max(X, Y, 0.5) - sympy.Min(X, Y, 0),
    sympy.Abs(X - Y),
    sympy.sign(X),
    sympy.Heaviside(X, 0.5),
    sympy.floor(3 * X) + sympy.ceiling(Y),
    -X,
    X - X * Y / 3,
    sympy.Piecewise(
        (X, sympy.And(X > 0, Y > 0)), (Y, sympy.Or(X < -1, sympy.Not(Y <= 1))), (2, True)
    ),
    sympy.Piecewise((X, X >= Y), (Y, True)),
    sympy.pi * X - sympy.Rational(2, 7),
    (X + Y) ** 5,
    sympy.exp(X * Y) / 3,
]


@pytest.mark.parametrize("expression", EVERY, ids=str)
def test_an_expression_is_what_sympy_says(expression):
    rng = np.random.default_rng(2)
    x, y = np.round(rng.normal(size=(2, 61)), 1)
    theirs = np.array([float(expression.subs({X: a, Y: b})) for a, b in zip(x, y, strict=True)])
    assert computed(expression, x, y) == pytest.approx(theirs, rel=1e-12, abs=1e-12)
    played = arrays.evaluate_phase(sympy_phase(expression), {X: x, Y: y}, len(x))[0]
    assert played == pytest.approx(theirs, rel=1e-12, abs=1e-12)


def sympy_phase(expression):
    from tractexp.kernel.lowered import Phase

    return Phase((), (), (expression,))


@pytest.mark.parametrize("expression", EVERY, ids=str)
def test_every_width_of_vectors_gives_the_same_bits(expression):
    x, y = np.random.default_rng(3).normal(size=(2, 37))
    whole = computed(expression, x, y)
    assert all(np.array_equal(computed(expression, x, y, width), whole) for width in (2, 4, 8))


def test_what_a_kernel_cannot_compute_is_said():
    with pytest.raises(
        UserError,
        match="the equations contain gamma, in gamma\\(x\\), which kernels cannot compute",
    ):
        computed(sympy.gamma(X), np.ones(1))


def test_what_is_written_twice_is_computed_once():
    f = Function()
    n = Numbers(f, 4)
    values = Expressions(n, {X: "%x", Y: "%y"})
    assert values(X * Y + 1) == values(1 + Y * X)
    lines = len(f.lines)
    assert Expressions(n, {X: "%x", Y: "%y"})(X * Y + 1) == values(X * Y + 1)
    assert len(f.lines) == lines
    with f.when("%c"):
        Expressions(n, {X: "%x", Y: "%y"})(X * Y + 2)
    assert sum("fmul" in line for line in f.lines) == 1
    with f.when("%d"):
        Expressions(n, {X: "%x", Y: "%y"})(X * Y + 2)  # what stands in another branch is not there
    assert sum("fadd" in line for line in f.lines) == 3


# What a kernel is given


@pytest.fixture(scope="module")
def model():
    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


@pytest.fixture(scope="module")
def drive():
    t = np.arange(30) * 1e-2
    one = Excitation(
        1e-2, 1 - 0.3 * (abs(t - 0.1) < 0.05), np.ones(30), np.full(30, 0.6), 1.0, 1.0, 0.6
    )
    return Drive.from_events([one, one])


def arguments(model, drive, n=9):
    candidates = model._candidates(drive, np.tile([p.default for p in model.parameters], (n, 1)))
    return {
        "candidates": candidates,
        "event": drive.event,
        "first": drive.first,
        "inputs": drive.inputs,
        "measured": drive.measurements,
        "weights": drive.weights,
        "substeps": np.ones(2, dtype=np.int64),
        "sums": np.empty((2, 2, n)),
        "miss": np.empty((2, n)),
        "outputs": np.empty((2, n, 60)),
        "starts": np.empty((2, 3, n)),
    }


def test_what_fits_is_taken(model, drive):
    given = arguments(model, drive)
    model.kernel.run(**given)
    assert np.isfinite(given["sums"]).all()
    assert (given["miss"] == 0).all()
    assert np.isfinite(given["outputs"]).all()
    assert given["starts"][0, 2, 0] < 0  # a motor slips
    empty = arguments(model, drive, 0)
    model.kernel.run(**empty)


@pytest.mark.parametrize(
    "name", ["candidates", "event", "measured", "weights", "sums", "miss", "outputs", "starts"]
)
@pytest.mark.parametrize(
    "wrong",
    [
        lambda a: a[..., :-1].copy(),
        lambda a: np.concatenate([a, a[:1]]),
        lambda a: np.zeros(a.shape, dtype=np.float32),
        lambda a: np.asfortranarray(np.stack([a, a], axis=-1))[..., 0] if a.ndim > 1 else a[::-1],
        lambda a: a[None],
    ],
    ids=["short", "long", "single precision", "strided", "deep"],
)
def test_a_wrong_array_is_a_value_error(model, drive, name, wrong):
    given = arguments(model, drive)
    given[name] = wrong(given[name])
    with pytest.raises(ValueError, match=r"kernel's \w+ is |must have shapes"):
        model.kernel.run(**given)


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("first", [0, 30, 61], "must rise from 0"),
        ("first", [-1, 30, 60], "must rise from 0"),
        ("first", [0, 40, 30], "must rise from 0"),
        ("substeps", [1, 0], "each must be 1 or more"),
    ],
)
def test_a_count_that_points_outside_is_a_value_error(model, drive, name, value, why):
    with pytest.raises(ValueError, match=why):
        model.kernel.run(**arguments(model, drive) | {name: np.array(value)})


@pytest.mark.parametrize("n", [1, 7, 8, 9, LANES, LANES + 1, 3 * LANES + 5])
def test_nothing_is_written_beside_the_results(model, drive, n):
    given = arguments(model, drive, n)
    frames = {}
    for name in ("sums", "miss", "outputs", "starts"):
        frame = np.full(given[name].size + 64, 7.0)
        frames[name], given[name] = frame, frame[32:-32].reshape(given[name].shape)
    model.kernel.run(**given)
    for frame in frames.values():
        assert (frame[:32] == 7.0).all()
        assert (frame[-32:] == 7.0).all()
        assert not (frame[32:-32] == 7.0).any()


def test_an_event_without_samples_has_no_errors(model, drive):
    given = arguments(model, drive)
    given["first"] = np.array([0, 60, 60])
    model.kernel.run(**given)
    assert (given["sums"][1] == 0).all()
    assert (given["sums"][0] > 0).all()


# What it is compiled to

FOREIGN = ("aarch64-unknown-linux-gnu", "x86_64-unknown-linux-gnu", "riscv64-unknown-linux-gnu")


@pytest.mark.parametrize("triple", FOREIGN)
def test_a_kernel_is_compiled_for_other_processors(model, triple):
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    try:
        machine = llvm.Target.from_triple(triple).create_target_machine(opt=2, reloc="pic")
    except RuntimeError:
        pytest.skip(f"this LLVM does not know {triple}")
    text = emit.write_kernel(lower(model.equations), model.title, "classical")
    assert objects.compile_machine_code(text, machine)[:4] == b"\x7fELF"


@pytest.mark.parametrize("motor", ["electromechanical", "double_cage"])
def test_a_kernel_of_any_width_gives_the_same_response(drive, motor):
    model = compose(get("model/motor", motor)(), get("model/static", "exponential")())
    rng = np.random.default_rng(1)
    values = np.array([p.default for p in model.parameters]) * rng.uniform(
        0.9, 1.1, (70, len(model.names))
    )
    responses = []
    for width in (2, 4, 8):
        other = copy.copy(model)
        other.__dict__["kernel"] = Kernel(
            emit.write_kernel(lower(model.equations), model.title, "classical", width)
        )
        responses.append(other.simulate(drive, values, [1, 3]).outputs)
    assert np.isfinite(responses[0]).any()
    assert all(np.array_equal(responses[0], one, equal_nan=True) for one in responses[1:])


@pytest.mark.parametrize("more", [0, 1])
def test_an_expression_is_printed_whole_up_to_so_many_nodes(more):
    terms = sympy.symbols(f"x:{listing.MOST_PRINTED_NODES - 1 + more}")
    none, start = Phase((), (), ()), Phase((), (), (sympy.Add(*terms),))
    lowered = SimpleNamespace(
        start=start,
        rest=None,
        constant=none,
        derivative=none,
        renewal=none,
        output=none,
        starts=["s"],
        constants=[],
        states=[],
        memories=[],
        outputs=[],
    )
    _, line = listing.list_equations(cast(Any, lowered))
    assert (f"x{listing.MOST_PRINTED_NODES - 2}" in line, "terms and more" in line) == (
        not more,
        bool(more),
    )


def test_a_kernel_is_printed_for_people(model):
    told = model.format_listing()
    assert "in each stage of a step:" in told
    assert "d omega/dt = " in told
    assert "define void @run(" in told
    lines = [*listing.list_equations(lower(model.equations))]
    assert any(line.strip().startswith("P = ") for line in lines)
    assert any(line.strip().startswith("slack 1 = ") for line in lines)


def test_the_steady_state_is_told_and_is_one(drive):
    model = compose(get("model/motor", "double_cage")(), get("model/static", "exponential")())
    values = np.array([p.default for p in model.parameters])
    starts = model.kernel.starts(model._candidates(drive, values), drive.event)
    assert np.array_equal(starts[0], starts[1])
    flat = Drive.from_events(
        [Excitation(1e-2, np.ones(50), np.ones(50), np.full(50, 0.6), 1.0, 1.0, 0.6)]
    )
    assert np.ptp(model.simulate(flat, values).P) < 1e-12


# Stencils


def second_difference(y, each, r):
    return (y(-1) - 2 * y(0) + y(1)) * each(0) + r


SECOND = Stencil(second_difference, rows=("y",), shared=("each",), numbers=("r",))


def held(x, at):
    """What an array is at indices beyond its ends, too."""
    return x[..., np.clip(at, 0, x.shape[-1] - 1)]


def test_a_stencil_is_its_expression_within_parts_which_go_on_as_they_end():
    rng = np.random.default_rng(4)
    y, each, r, shifts = (
        rng.normal(size=(2, 5, 70)),
        rng.normal(size=70),
        rng.normal(size=5),
        np.array([1, -4, 2, 9, 0]),
    )
    parts, out = [slice(0, 30), slice(30, 31), slice(33, 70)], np.full((2, 5, 70), 7.0)
    SECOND(out, parts, shifts, y=y, each=each, r=r)
    for part in parts:
        own, shared, n = y[..., part], each[part], part.stop - part.start
        for k, shift in enumerate(shifts):
            at = shift + np.arange(n)
            second = held(own, at - 1) - 2 * held(own, at) + held(own, at + 1)
            theirs = second * held(shared, at) + r[k]
            assert out[:, k, part] == pytest.approx(theirs[:, k], rel=1e-12, abs=1e-12)
    assert np.all(out[..., 31:33] == 7.0)
    SECOND(y, parts, shifts, y=y, each=each, r=r)  # in place
    assert np.array_equal(y[..., :31], out[..., :31])
    assert np.array_equal(y[..., 33:], out[..., 33:])


@pytest.mark.parametrize("n", [1, 2, 20])
def test_rows_may_go_on_by_one_step_of_their_slope(n):
    onward = Stencil(lambda y: y(0), rows=("y",), onward=True)
    y = np.random.default_rng(n).normal(size=(1, 2, n))
    onward(out := np.empty_like(y), [slice(0, n)], np.array([-n - 2, n + 2]), y=y)
    before, after = (
        (2 * y[..., 0] - y[..., 1], 2 * y[..., -1] - y[..., -2])
        if n > 1
        else (y[..., 0], y[..., 0])
    )
    assert out[0, 0] == pytest.approx(np.full(n, before[0, 0]))
    assert out[0, 1] == pytest.approx(np.full(n, after[0, 1]))


@pytest.mark.parametrize("n", [1, 7, 8, 9, 64, 65])
def test_a_running_sum_goes_on_as_a_straight_line_and_hangs_on_no_other_row(n):
    def between(y, total):
        return total(0, "ahead") - total(0, "behind")

    summed = Stencil(between, rows=("y",), sums={"total": "y"}, shifts=("ahead", "behind"))
    y = np.random.default_rng(n).normal(size=(1, 3, n))
    ahead = np.array([0, 2, 11])
    summed(out := np.empty_like(y), [slice(0, n)], {"ahead": ahead, "behind": -ahead}, y=y)
    for k, reach in enumerate(ahead):
        theirs = [held(y[0, k], np.arange(t - reach + 1, t + reach + 1)).sum() for t in range(n)]
        assert out[0, k] == pytest.approx(theirs, rel=1e-12, abs=1e-12)
    summed(
        alone := np.empty((1, 1, n)),
        [slice(0, n)],
        {"ahead": ahead[1:2], "behind": -ahead[1:2]},
        y=y[:, 1:2],
    )
    assert np.array_equal(alone[0, 0], out[0, 1])


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"shifts": np.array([1, 2, 3])}, "a stencil's shifts has the shape"),
        ({"y": np.zeros((1, 3, 40))}, "a stencil's y has the shape"),
        ({"each": np.zeros(41)}, "a stencil's each has the shape"),
        ({"r": np.zeros(3)}, "a stencil's r has the shape"),
        ({"parts": [slice(40, 50)]}, "a sample each"),
        ({"y": np.zeros((1, 2, 40), dtype=np.float32)}, "must be float64"),
        ({"out": np.empty((1, 2, 80))[..., ::2]}, "contiguous"),
    ],
)
def test_a_stencil_does_not_read_or_write_beside_its_arrays(change, why):
    given = {"out": np.empty((1, 2, 40)), "parts": [slice(0, 40)], "shifts": np.array([1, 2])}
    given |= {"y": np.zeros((1, 2, 40)), "each": np.zeros(40), "r": np.zeros(2)} | change
    with pytest.raises(ValueError, match=why):
        SECOND(**given)


def test_constants_of_the_exponential_are_those_of_a_polynomial_close_to_it():
    x = np.linspace(-np.log(2) / 2, np.log(2) / 2, 10001).astype(np.longdouble)
    exact = np.exp(x)
    assert (
        np.abs(np.polyval(np.array(math.EXP, dtype=np.longdouble), x) / exact - 1).max() < 1.7e-14
    )


CROWDED = """
import ctypes
from tractexp.kernel import objects, steady

memory = ctypes.CDLL(None)
memory.mmap.restype, memory.mmap.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_size_t, \
*[ctypes.c_int] * 4]
memory.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]
UNUSED = 0x4022  # private, of no file, and never reserved: it costs addresses alone
room = lambda size: memory.mmap(None, size, 0, UNUSED, -1, 0)

objects.load(steady.write_steady(2))
far, pieces = room(4 << 30), []
for size in (1 << 24, 1 << 20, 1 << 16, 1 << 12):  # all that is free above is taken
    while (piece := room(size)) > far:
        pieces.append((piece, size))
    memory.munmap(piece, size)
for piece, size in [entry for entry in pieces if entry[1] > 1 << 12][:3]:  # but single pages
    memory.munmap(piece + (1 << 13), 1 << 12)
for width in (4, 8):
    objects.load(steady.write_steady(width))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="memory is mapped by Linux's call")
def test_code_is_linked_where_sections_would_lie_further_apart_than_it_reaches():
    # A linker that gives each section of an object a place of its own ends the process here.
    ended = subprocess.run([sys.executable, "-c", CROWDED], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
