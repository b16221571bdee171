"""Print lowered equations as the source of a Numba kernel that simulates many candidates at once.

Sixteen candidates (lanes) are advanced together: the innermost loop runs over them, branch-free, over one work
array with literal offsets, so that LLVM vectorises it and state, constants and sums stay in cache. Nothing per
sample is stored unless asked for. Equal lanes give equal bits wherever they stand in a batch.
"""

from collections.abc import Iterable

import sympy
from sympy.printing.pycode import PythonCodePrinter

from tractexp.model.lowering import Lowered, Phase

LANES = 16

HEADER = '''"""Generated from the equations of {title}. Do not edit: the file's name is the hash of its content."""

import math

import numpy as np
from numba import njit

FAST = {{"contract", "reassoc", "arcp", "nsz"}}  # nan and inf keep their meaning: they mark diverged candidates
compiled = njit(cache=True, fastmath=FAST, error_model="numpy", nogil=True)


@compiled
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
'''

RUN = '''

@compiled
def run(candidates, event, first, inputs, measured, weights, substeps, sums, miss, outputs):
    """Simulate candidates over events and sum their weighted squared errors.

    candidates (events, rows, n): {rows}; event (events, {n_event}): {event}, step [s];
    first (events + 1,): where each event starts in the samples; inputs ({n_input}, N): {inputs};
    measured, weights (2, N): P, Q; substeps (events,); sums (events, 2, n) and miss (events, n) are written;
    outputs (2, n, N) or empty.
    """
    n = candidates.shape[2]
    store = outputs.shape[0] > 0
    W = np.empty({rows_W} * {L})
    signals = np.empty(({n_signal}, inputs.shape[1]))
    for e in range(candidates.shape[0]):
        step = event[e, {i_step}]
        h = step / substeps[e]
{unpack_event}
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

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Float(self, expr):
        return repr(float(expr))


_printer = _Printer({"fully_qualified_modules": True, "precision": 17})


def source(lowered: Lowered, title: str) -> str:
    """The kernel module's source text. Deterministic: the same equations give the same text."""
    constants = [s for s, _ in lowered.constants]
    at = _Rows(lowered, constants)
    derivative_signals = [s for s, _ in lowered.derivative.signals]
    output_signals = [s for s, _ in lowered.output.signals]
    scalars = [*lowered.inputs, *lowered.event]
    rows = [*lowered.parameters, sympy.Symbol("P0"), sympy.Symbol("Q0")]

    text = HEADER.format(title=title)
    text += _start(lowered, rows)
    own = [*rows, *lowered.event, *lowered.starts]
    text += _function("_constants", own, (), [e for _, e in lowered.constants])
    text += _function("_drive", scalars, (), [e for _, e in lowered.derivative.signals])
    text += _function("_signals", scalars, (), [e for _, e in lowered.output.signals])
    moving = [*lowered.states, *lowered.inputs]
    lane = at.needed
    text += _phase("_derivative", [*moving, *derivative_signals, *lane["derivative"]], lowered.derivative)
    text += _phase("_output", [*moving, *output_signals, *lane["output"]], lowered.output)
    text += RUN.format(
        L=LANES,
        rows=_names(rows),
        event=_names(lowered.event),
        inputs=_names(lowered.inputs),
        n_event=len(lowered.event) + 1,
        i_step=len(lowered.event),
        n_input=len(lowered.inputs),
        n_signal=max(len(output_signals), 1),
        rows_W=at.count,
        row_P=at["P"], row_Q=at["Q"], row_sum_P=at["sum_P"], row_sum_Q=at["sum_Q"], row_miss=at["miss"],
        unpack_event=_indent(8, (f"{s} = event[e, {i}]" for i, s in enumerate(lowered.event))),
        fill_signals=_indent(8, _fill_signals(lowered, output_signals)),
        start=_indent(16, _load_candidate(lowered, rows, at)),
        sample=_indent(20, _sample(lowered, at)),
        advance=_indent(24, _advance(lowered, at)),
    )  # fmt: skip
    return text


class _Rows:
    """Offsets of the rows of the work array: what the lanes carry."""

    def __init__(self, lowered: Lowered, constants: list[sympy.Symbol]):
        used = {
            name: set().union(*(e.free_symbols for e in (*p.expressions, *(e for _, e in p.temporaries))))
            for name, p in (("derivative", lowered.derivative), ("output", lowered.output))
        }
        lane = [*lowered.parameters, sympy.Symbol("P0", real=True), sympy.Symbol("Q0", real=True)]
        lane += [*lowered.starts, *constants]
        self.needed = {name: [s for s in lane if s in symbols] for name, symbols in used.items()}
        self.carried = [s for s in lane if any(s in needed for needed in self.needed.values())]
        names = [*map(str, lowered.states), *map(str, self.carried), "P", "Q", "sum_P", "sum_Q", "miss"]
        self.offset = {name: LANES * i for i, name in enumerate(names)}
        self.count = len(names)

    def __getitem__(self, name: object) -> int:
        return self.offset[str(name)]

    def load(self, symbols: Iterable[object]) -> list[str]:
        return [f"{s} = W[{self[s]} + l]" for s in symbols]


def _fill_signals(lowered: Lowered, signals: list[sympy.Symbol]) -> list[str]:
    if not signals:
        return []
    sampled = [f"inputs[{j}, i]" for j in range(len(lowered.inputs))]
    targets = ", ".join(f"signals[{j}, i]" for j in range(len(signals)))
    call = f"_signals({', '.join([*sampled, *map(str, lowered.event)])})"
    return ["for i in range(first[e], first[e + 1]):", f"    {targets}{',' * (len(signals) == 1)} = {call}"]


def _load_candidate(lowered: Lowered, rows: list[sympy.Symbol], at: _Rows) -> list[str]:
    constants = [s for s, _ in lowered.constants]
    lines = [f"{s} = candidates[e, {i}, k]" for i, s in enumerate(rows)]
    lines.append(f"{_names([*lowered.starts, 'm'])} = _start({_names([*rows, *lowered.event])})")
    if constants:
        arguments = _names([*rows, *lowered.event, *lowered.starts])
        lines.append(f"{_names(constants)}{',' * (len(constants) == 1)} = _constants({arguments})")
    lines += [f"W[{at[s]} + l] = {begin}" for s, begin in zip(lowered.states, lowered.starts, strict=True)]
    return lines + [f"W[{at[s]} + l] = {s}" for s in at.carried]


def _sample(lowered: Lowered, at: _Rows) -> list[str]:
    signals = [s for s, _ in lowered.output.signals]
    lines = [f"{s} = inputs[{j}, i]" for j, s in enumerate(lowered.inputs)]
    lines += [f"{s} = signals[{j}, i]" for j, s in enumerate(signals)]
    lines += ["p, q, w_p, w_q = measured[0, i], measured[1, i], weights[0, i], weights[1, i]"]
    arguments = _names([*lowered.states, *lowered.inputs, *signals, *at.needed["output"]])
    body = at.load([*lowered.states, *at.needed["output"]])
    body += [f"P, Q = _output({arguments})"]
    body += [f"W[{at['P']} + l] = P", f"W[{at['Q']} + l] = Q"]
    body += [f"W[{at['sum_P']} + l] += w_p * (p - P) * (p - P)", f"W[{at['sum_Q']} + l] += w_q * (q - Q) * (q - Q)"]
    return [*lines, f"for l in range({LANES}):", *_nested(body)]


def _advance(lowered: Lowered, at: _Rows) -> list[str]:
    """Classical Runge-Kutta, order 4 (Eq. (4) with its stage steps corrected), inputs linear between samples."""
    lines = ["for j in range(substeps[e]):"]
    inner = []
    for point, fraction in (("a", "j"), ("b", "(j + 0.5)"), ("c", "(j + 1)")):
        for k, s in enumerate(lowered.inputs):
            rise = f"(inputs[{k}, i + 1] - inputs[{k}, i])"
            inner.append(f"{s}{point} = inputs[{k}, i] + {rise} * ({fraction} / substeps[e])")
        if signals := [s for s, _ in lowered.derivative.signals]:
            targets = _names(f"{s}{point}" for s in signals)
            inputs = [f"{s}{point}" for s in lowered.inputs]
            inner.append(f"{targets}{',' * (len(signals) == 1)} = _drive({_names([*inputs, *lowered.event])})")
    body = at.load([*lowered.states, *at.needed["derivative"]])
    stages = [
        ("k1", "a", None),
        ("k2", "b", ("0.5 * h", "k1")),
        ("k3", "b", ("0.5 * h", "k2")),
        ("k4", "c", ("h", "k3")),
    ]
    for slope, point, ahead in stages:
        body.append(_stage(lowered, at, slope, point, ahead))
    for s in lowered.states:
        body.append(f"W[{at[s]} + l] = {s} + h / 6.0 * (k1_{s} + 2.0 * (k2_{s} + k3_{s}) + k4_{s})")
    inner += [f"for l in range({LANES}):", *_nested(body)]
    return lines + _nested(inner)


def _stage(lowered: Lowered, at: _Rows, slope: str, point: str, ahead: tuple[str, str] | None) -> str:
    states = [f"{s} + {ahead[0]} * {ahead[1]}_{s}" if ahead else str(s) for s in lowered.states]
    sampled = [f"{s}{point}" for s in (*lowered.inputs, *(s for s, _ in lowered.derivative.signals))]
    results = [f"{slope}_{s}" for s in lowered.states]
    arguments = _names([*states, *sampled, *at.needed["derivative"]])
    return f"{_names(results)}{',' * (len(results) == 1)} = _derivative({arguments})"


def _start(lowered: Lowered, rows: list[sympy.Symbol]) -> str:
    """States before the event and by how much the requirements are missed (0: a steady state exists)."""
    states, slacks = lowered.start.expressions[: len(lowered.states)], lowered.start.expressions[len(lowered.states) :]
    short = [f"max(0.0, -({_printer.doprint(s)}))" for s in slacks]
    lines = [f"{s} = {_printer.doprint(e)}" for s, e in lowered.start.temporaries]
    lines.append(f"miss = min({' + '.join(short) or '0.0'}, 1e6)")
    lines.append(f"return {', '.join([*map(_printer.doprint, states), 'miss if miss >= 0.0 else 1e6'])}")
    return _text("_start", [*rows, *lowered.event], lines)


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
    return f"\n\n@compiled\ndef {name}({_names(arguments)}):\n{_indent(4, lines)}\n"


def _names(symbols: Iterable[object]) -> str:
    return ", ".join(map(str, symbols))


def _nested(lines: Iterable[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _indent(spaces: int, lines: Iterable[str]) -> str:
    return "\n".join(" " * spaces + line for line in lines)
