"""Print lowered equations as the source of a Numba kernel that simulates many candidates at once.

Sixteen candidates (lanes) are advanced together: the innermost loop runs over them, branch-free, over one work
array with literal offsets, so that LLVM vectorises it and state, constants and sums stay in cache. Nothing per
sample is stored unless asked for. Equal lanes give equal bits wherever they stand in a batch.
"""

from collections.abc import Iterable

import sympy
from sympy.printing.pycode import PythonCodePrinter

from tractexp.model.drive import INPUTS
from tractexp.model.lowering import Lowered, Phase, symbols

LANES = 16
PHASES = ("derivative", "renewal", "output")  # what is evaluated lane by lane
STAGES = (("k1", "a", None), ("k2", "b", ("0.5 * h", "k1")), ("k3", "b", ("0.5 * h", "k2")), ("k4", "c", ("h", "k3")))

HEADER = '''"""Generated from the equations of {title}. Do not edit: the file's name is the hash of its content."""

import math

import numpy as np
from numba import njit

FAST = {{"contract", "reassoc", "arcp", "nsz"}}  # nan and inf keep their meaning: they mark diverged candidates
compiled = njit(cache=True, fastmath=FAST, error_model="numpy", nogil=True)
inlined = njit(cache=True, fastmath=FAST, error_model="numpy", nogil=True, forceinline=True)  # a call stops vectors


@inlined
def _exp(x):
    """Branch-free exp, relative error below 3e-13 for |x| < 700: a libm call would stop the vectoriser."""
    x = min(max(x, -700.0), 700.0)
    n = math.floor(x * 1.4426950408889634 + 0.5)
    r = (x - n * 0.6931471803691238) - n * 1.9082149292705877e-10
    p = r * 2.7557319223985893e-07 + 2.7557319223985893e-06
    p = p * r + 2.48015873015873e-05
    p = p * r + 0.0001984126984126984
    p = p * r + 0.001388888888888889
    p = p * r + 0.008333333333333333
    p = p * r + 0.041666666666666664
    p = p * r + 0.16666666666666666
    p = p * r + 0.5
    p = p * r + 1.0
    p = p * r + 1.0
    return p * np.int64((np.int64(n) + 1023) << 52).view(np.float64)


@inlined
def _log(x):
    """Branch-free logarithm, error below 1e-14 of the larger of 1 and itself; -709 at 0, nan stays nan."""
    bits = np.float64(x).view(np.int64)
    k = (bits - 0x3FE6A09E667F3BCD) >> 52  # so that what is left lies between sqrt(1/2) and sqrt(2)
    m = np.int64(bits - (k << 52)).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    t = s * s
    p = t * 0.05882352941176471 + 0.06666666666666667
    p = p * t + 0.07692307692307693
    p = p * t + 0.09090909090909091
    p = p * t + 0.1111111111111111
    p = p * t + 0.14285714285714285
    p = p * t + 0.2
    p = p * t + 0.3333333333333333
    p = p * t + 1.0
    return k * 0.6931471805599453 + 2.0 * s * p + (x - x)


@inlined
def _cubic(a, b, da, db, x):
    """Value at x in [0, 1] of the cubic with these end values and slopes."""
    rise = b - a
    return a + x * (da + x * (3.0 * rise - 2.0 * da - db + x * (da + db - 2.0 * rise)))


@inlined
def _slope(a, b, da, db, x):
    """Slope of that cubic."""
    rise = b - a
    return da + x * (2.0 * (3.0 * rise - 2.0 * da - db) + 3.0 * x * (da + db - 2.0 * rise))
'''

RUN = '''

@compiled
def run(candidates, event, first, inputs, measured, weights, substeps, sums, miss, outputs):
    """Simulate candidates over events and sum their weighted squared errors.

    candidates (events, rows, n): {rows};
    event (events, {n_event}): {event}; first (events + 1,): where each event starts in the samples;
    inputs (rows as in INPUTS, N), of which are used: {inputs};
    measured, weights (2, N): P, Q; substeps (events,); sums (events, 2, n) and miss (events, n) are written;
    outputs (2, n, N) or empty.
    """
    n = candidates.shape[2]
    store = outputs.shape[0] > 0
    W = np.empty({rows_W} * {L})
    signals = np.empty(({n_signal}, inputs.shape[1]))
    for e in range(candidates.shape[0]):
{unpack_event}
        h = step / substeps[e]
{fill_signals}
        for block in range((n + {L} - 1) // {L}):
            reachable = False
            for l in range({L}):
                k = min(block * {L} + l, n - 1)
{start}
                reachable = reachable or m <= 0.0
                W[{row_sum_P} + l] = 0.0
                W[{row_sum_Q} + l] = 0.0
                W[{row_miss} + l] = m
            if reachable:
                for i in range(first[e], first[e + 1]):
{sample}
                    if store:
                        for l in range(min({L}, n - block * {L})):
                            outputs[0, block * {L} + l, i] = W[{row_P} + l]
                            outputs[1, block * {L} + l, i] = W[{row_Q} + l]
                    if i + 1 < first[e + 1]:
{advance}
            for l in range(min({L}, n - block * {L})):
                sums[e, 0, block * {L} + l] = W[{row_sum_P} + l]
                sums[e, 1, block * {L} + l] = W[{row_sum_Q} + l]
                miss[e, block * {L} + l] = W[{row_miss} + l]
'''


class _Printer(PythonCodePrinter):
    """Python source with multiplications for small powers and the kernel's own exp."""

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.as_base_exp()
        if exponent == sympy.Rational(1, 2):
            return f"math.sqrt({self._print(base)})"
        if exponent.is_Integer and 0 < abs(exponent) <= 4:
            power = "*".join([self.parenthesize(base, 50)] * abs(int(exponent)))
            return f"({power})" if exponent > 0 else f"(1.0/({power}))"
        if expr.exp.is_number or expr.base == sympy.E:
            return super()._print_Pow(expr, rational) if expr.base != sympy.E else f"_exp({self._print(expr.exp)})"
        raise ValueError(f"{expr}: a symbolic exponent reached the printer")

    def _print_exp(self, expr):
        return f"_exp({self._print(expr.args[0])})"

    def _print_log(self, expr):
        return f"_log({self._print(expr.args[0])})"

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Float(self, expr):
        return repr(float(expr))


_printer = _Printer({"fully_qualified_modules": True, "precision": 17})


def source(lowered: Lowered, title: str) -> str:
    """The kernel module's source text. Deterministic: the same equations give the same text."""
    at = _Rows(lowered)
    sample_signals = _sample_signals(lowered)
    scalars = [*lowered.inputs, *lowered.event]
    rows = [*lowered.parameters, sympy.Symbol("P0"), sympy.Symbol("Q0")]

    text = HEADER.format(title=title)
    text += _start(lowered, rows)
    own = [*rows, *lowered.event, *lowered.starts]
    if lowered.rest is not None:
        text += _phase("_rest", own, lowered.rest) + _settle(lowered, rows)
    text += _phase("_constants", own, lowered.constant)
    text += _function("_drive", scalars, (), [e for _, e in lowered.derivative.signals])
    text += _function("_signals", scalars, (), [e for _, e in sample_signals])
    for name in PHASES:
        text += _phase(f"_{name}", _arguments(lowered, at, name), getattr(lowered, name))
    text += RUN.format(
        L=LANES,
        rows=_names(rows),
        event=_names(lowered.event),
        inputs=_names(lowered.inputs),
        n_event=len(lowered.event),
        n_signal=max(len(sample_signals), 1),
        rows_W=at.count,
        row_P=at["P"], row_Q=at["Q"], row_sum_P=at["sum_P"], row_sum_Q=at["sum_Q"], row_miss=at["miss"],
        unpack_event=_indent(8, (f"{s} = event[e, {i}]" for i, s in enumerate(lowered.event))),
        fill_signals=_indent(8, _fill_signals(lowered)),
        start=_indent(16, _load_candidate(lowered, rows, at)),
        sample=_indent(20, _sample(lowered, at)),
        advance=_indent(24, _advance(lowered, at)),
    )  # fmt: skip
    return text


class _Rows:
    """Offsets of the rows of the work array: what the lanes carry."""

    def __init__(self, lowered: Lowered):
        lane = [*lowered.parameters, sympy.Symbol("P0", real=True), sympy.Symbol("Q0", real=True)]
        lane += [*lowered.starts, *lowered.constants]
        used = {name: symbols(getattr(lowered, name)) for name in PHASES}
        self.needed = {name: [s for s in lane if s in used[name]] for name in PHASES}
        self.carried = [s for s in lane if any(s in needed for needed in self.needed.values())]
        names = [*lowered.states, *lowered.memories, *self.carried, "P", "Q", "sum_P", "sum_Q", "miss"]
        self.offset = {str(name): LANES * i for i, name in enumerate(names)}
        self.count = len(names)

    def __getitem__(self, name: object) -> int:
        return self.offset[str(name)]

    def load(self, symbols: Iterable[object]) -> list[str]:
        return [f"{s} = W[{self[s]} + l]" for s in symbols]


def _sample_signals(lowered: Lowered) -> list[tuple[sympy.Symbol, sympy.Expr]]:
    """The signals read once a sample: those of the output and of the memories' renewal."""
    return list(dict([*lowered.output.signals, *lowered.renewal.signals]).items())


def _arguments(lowered: Lowered, at: _Rows, name: str, suffix: str = "") -> list[str]:
    """What the function of a phase is called with; `suffix` marks sampled values at a stage of the step."""
    sampled = [f"{s}{suffix}" for s in (*lowered.inputs, *(s for s, _ in getattr(lowered, name).signals))]
    return [*map(str, (*lowered.states, *lowered.memories)), *sampled, *map(str, at.needed[name])]


def _targets(names: Iterable[object]) -> str:
    """The left side of an assignment from a tuple."""
    listed = [str(name) for name in names]
    return ", ".join(listed) + "," * (len(listed) == 1)


def _row(symbol: sympy.Symbol) -> int:
    return INPUTS.index(symbol.name)


def _fill_signals(lowered: Lowered) -> list[str]:
    count = len(_sample_signals(lowered))
    if not count:
        return []
    sampled = [f"inputs[{_row(s)}, i]" for s in lowered.inputs]
    targets = _targets(f"signals[{j}, i]" for j in range(count))
    call = f"    {targets} = _signals({_names([*sampled, *lowered.event])})"
    return ["for i in range(first[e], first[e + 1]):", call]


def _load_candidate(lowered: Lowered, rows: list[sympy.Symbol], at: _Rows) -> list[str]:
    lines = [f"{s} = candidates[e, {i}, k]" for i, s in enumerate(rows)]
    lines.append(f"{_names([*lowered.starts, 'm'])} = _start({_names([*rows, *lowered.event])})")
    arguments = _names([*rows, *lowered.event, *lowered.starts])
    if lowered.rest is not None:
        lines.append(f"{_targets([*lowered.starts[: len(lowered.states)], 'unsettled'])} = _settle({arguments})")
        lines.append("m = min(m + unsettled, 1e6)")
    if lowered.constants:
        lines.append(f"{_targets(lowered.constants)} = _constants({arguments})")
    carried = zip((*lowered.states, *lowered.memories), lowered.starts, strict=True)
    lines += [f"W[{at[s]} + l] = {begin}" for s, begin in carried]
    return lines + [f"W[{at[s]} + l] = {s}" for s in at.carried]


def _sample(lowered: Lowered, at: _Rows) -> list[str]:
    carried = [*lowered.states, *lowered.memories]
    lines = [f"{s} = inputs[{_row(s)}, i]" for s in lowered.inputs]
    lines += [f"{s} = signals[{j}, i]" for j, (s, _) in enumerate(_sample_signals(lowered))]
    lines += ["p, q, w_p, w_q = measured[0, i], measured[1, i], weights[0, i], weights[1, i]"]
    needed = dict.fromkeys([*at.needed["renewal"], *at.needed["output"]])
    body = at.load([*carried, *needed])
    if lowered.memories:
        body.append(f"{_targets(lowered.memories)} = _renewal({_names(_arguments(lowered, at, 'renewal'))})")
        body += [f"W[{at[s]} + l] = {s}" for s in lowered.memories]
    body += [f"P, Q = _output({_names(_arguments(lowered, at, 'output'))})"]
    body += [f"W[{at['P']} + l] = P", f"W[{at['Q']} + l] = Q"]
    body += [f"W[{at['sum_P']} + l] += w_p * (p - P) * (p - P)", f"W[{at['sum_Q']} + l] += w_q * (q - Q) * (q - Q)"]
    return [*lines, f"for l in range({LANES}):", *_nested(body)]


def _advance(lowered: Lowered, at: _Rows) -> list[str]:
    """Classical Runge-Kutta, order 4 (Eq. (4) with its stage steps corrected), the voltage smooth between samples."""
    if not lowered.states:
        return ["pass"]
    inner = []
    for point, fraction in (("a", "j"), ("b", "(j + 0.5)"), ("c", "(j + 1)")):
        inner += [_between(s, point, fraction) for s in lowered.inputs]
        if signals := [s for s, _ in lowered.derivative.signals]:
            inputs = [f"{s}{point}" for s in lowered.inputs]
            inner.append(f"{_targets(f'{s}{point}' for s in signals)} = _drive({_names([*inputs, *lowered.event])})")
    body = at.load([*lowered.states, *lowered.memories, *at.needed["derivative"]])
    body += [_stage(lowered, at, *stage) for stage in STAGES]
    for s in lowered.states:
        body.append(f"W[{at[s]} + l] = {s} + h / 6.0 * (k1_{s} + 2.0 * (k2_{s} + k3_{s}) + k4_{s})")
    inner += [f"for l in range({LANES}):", *_nested(body)]
    return ["for j in range(substeps[e]):", *_nested(inner)]


def _between(symbol: sympy.Symbol, point: str, fraction: str) -> str:
    """An input between samples i and i + 1: the voltage on the cubic its slopes define, all else on a straight line."""
    k, place = _row(symbol), f"{fraction} / substeps[e]"
    if symbol.name in ("U", "U_rate"):
        rate = INPUTS.index("U_rate")
        ends = f"inputs[0, i], inputs[0, i + 1], step * inputs[{rate}, i], step * inputs[{rate}, i + 1]"
        scale = "" if symbol.name == "U" else " / step"
        return f"{symbol}{point} = _{'cubic' if symbol.name == 'U' else 'slope'}({ends}, {place}){scale}"
    return f"{symbol}{point} = inputs[{k}, i] + (inputs[{k}, i + 1] - inputs[{k}, i]) * ({place})"


def _stage(lowered: Lowered, at: _Rows, slope: str, point: str, ahead: tuple[str, str] | None) -> str:
    n = len(lowered.states)
    states = [f"{s} + {ahead[0]} * {ahead[1]}_{s}" if ahead else str(s) for s in lowered.states]
    arguments = states + _arguments(lowered, at, "derivative", point)[n:]
    return f"{_targets(f'{slope}_{s}' for s in lowered.states)} = _derivative({_names(arguments)})"


def _start(lowered: Lowered, rows: list[sympy.Symbol]) -> str:
    """States before the event and by how much the requirements are missed (0: a steady state exists)."""
    states, slacks = lowered.start.expressions[: len(lowered.starts)], lowered.start.expressions[len(lowered.starts) :]
    short = [f"max(0.0, -({_printer.doprint(s)}))" for s in slacks]
    lines = [f"{s} = {_printer.doprint(e)}" for s, e in lowered.start.temporaries]
    lines.append(f"miss = min({' + '.join(short) or '0.0'}, 1e6)")
    lines.append(f"return {', '.join([*map(_printer.doprint, states), 'miss if miss >= 0.0 else 1e6'])}")
    return _text("_start", [*rows, *lowered.event], lines)


SETTLE = """

@compiled
def _settle({arguments}):
    \"\"\"Solve for the steady state before the event by Newton's method; last, how far it misses.\"\"\"
    x, f, g, J = np.array([{states}]), np.empty({n}), np.empty({n}), np.empty(({n}, {n}))
    for _ in range(40):
        {f} = _rest({known}, {x})
        for k in range({n}):
            keep, d = x[k], 1e-7 * (1.0 + abs(x[k]))
            x[k] = keep + d
            {g} = _rest({known}, {x})
            x[k] = keep
            for r in range({n}):
                J[r, k] = (g[r] - f[r]) / d
        moved = 0.0
        for k in range({n}):  # Gaussian elimination with partial pivoting; f becomes the step
            p = k
            for r in range(k + 1, {n}):
                if abs(J[r, k]) > abs(J[p, k]):
                    p = r
            for c in range({n}):
                J[k, c], J[p, c] = J[p, c], J[k, c]
            f[k], f[p] = f[p], f[k]
            for r in range(k + 1, {n}):
                factor = J[r, k] / J[k, k]
                for c in range(k, {n}):
                    J[r, c] -= factor * J[k, c]
                f[r] -= factor * f[k]
        for k in range({n} - 1, -1, -1):
            for c in range(k + 1, {n}):
                f[k] -= J[k, c] * f[c]
            f[k] /= J[k, k]
            moved = max(moved, abs(f[k]) / (1.0 + abs(x[k])))
        shorter = 1.0 if moved < 0.5 else 0.5 / moved
        for k in range({n}):
            x[k] -= shorter * f[k]
        if not moved > 1e-12:
            break
    {f} = _rest({known}, {x})
    off = 0.0
    for k in range({n}):
        off = max(off, abs(f[k]))
    settled = moved <= 1e-9 and off < 1e-6
    return {x}, 0.0 if settled else (min(1.0 + off, 1e6) if off >= 0.0 else 1e6)
"""


def _settle(lowered: Lowered, rows: list[sympy.Symbol]) -> str:
    n = len(lowered.states)
    states, remembered = lowered.starts[:n], lowered.starts[n:]
    known = _names([*rows, *lowered.event])
    x = _names([*(f"x[{k}]" for k in range(n)), *remembered])
    moving = {"f": _targets(f"f[{k}]" for k in range(n)), "g": _targets(f"g[{k}]" for k in range(n))}
    arguments = _names([*rows, *lowered.event, *lowered.starts])
    if not n:
        return f"\n\n@compiled\ndef _settle({arguments}):\n    return (0.0,)\n"
    text = SETTLE.format(arguments=arguments, states=_names(states), n=n, known=known, x=x, **moving)
    return text.replace(f"return {x},", f"return {_names(f'x[{k}]' for k in range(n))},")


def _phase(name: str, arguments: list, phase: Phase) -> str:
    return _function(name, arguments, phase.temporaries, phase.expressions)


def _function(name: str, arguments: list, temporaries: Iterable, expressions: Iterable[sympy.Expr]) -> str:
    results = [_printer.doprint(e) for e in expressions]
    if not results:
        return ""
    lines = [f"{s} = {_printer.doprint(e)}" for s, e in temporaries]
    lines.append(f"return {', '.join(results)}{',' * (len(results) == 1)}")
    return _text(name, arguments, lines)


def _text(name: str, arguments: list, lines: list[str]) -> str:
    mark = "inlined" if name.removeprefix("_") in PHASES else "compiled"
    return f"\n\n@{mark}\ndef {name}({_names(arguments)}):\n{_indent(4, lines)}\n"


def _names(symbols: Iterable[object]) -> str:
    return ", ".join(map(str, symbols))


def _nested(lines: Iterable[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _indent(spaces: int, lines: Iterable[str]) -> str:
    return "\n".join(" " * spaces + line for line in lines)
