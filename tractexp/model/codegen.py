"""Print lowered equations as the source of a Numba kernel that simulates many candidates at once.

Up to 56 candidates (lanes) are advanced together: the innermost loop runs over them, branch-free, over one work
array with literal offsets, so that LLVM vectorises it and state, constants and sums stay in cache. Nothing per
sample is stored unless asked for. Equal lanes give equal bits wherever they stand in a batch.
"""

from collections.abc import Iterable

import sympy
from sympy.printing.pycode import PythonCodePrinter

from tractexp.model.drive import INPUTS, SMOOTH
from tractexp.model.lowering import Lowered, Phase, symbols
from tractexp.model.template import FAST, GROUP, HEADER, LANES, RUN, SETTLE, VECTORS

LONG_TUPLE = 29  # beyond it Numba knows no tuple with a choice in it
PHASES = ("derivative", "renewal", "output")  # what is evaluated lane by lane
HALF_WAY = {"classical": "0.5 * h", "printed": "h / 6.0"}  # how far along a slope the two stages in the middle are


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


def _printed(expression: sympy.Expr) -> str:
    """An expression as Python source."""
    return str(_printer.doprint(expression))


def source(lowered: Lowered, title: str, integration: str = "classical") -> str:
    """The kernel module's source text. Deterministic: the same equations give the same text."""
    at = _Rows(lowered)
    sample_signals = _sample_signals(lowered)
    scalars = [*lowered.inputs, *lowered.event]
    rows = [*lowered.parameters, sympy.Symbol("P0"), sympy.Symbol("Q0")]

    text = HEADER.format(title=title, vectors=VECTORS, fast=FAST)
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
        G=GROUP,
        rows=_names(rows),
        event=_names(lowered.event),
        inputs=_names(lowered.inputs),
        n_event=len(lowered.event),
        n_signal=max(len(sample_signals), 1),
        rows_W=at.count,
        C=len(lowered.outputs), outputs=", ".join(lowered.outputs), row_miss=at["miss"],
        no_sums=_indent(16, (f"W[{at[f'sum_{o}']} + l] = 0.0" for o in lowered.outputs)),
        store=_indent(28, (f"outputs[{c}, begin + l, i] = W[{at[o]} + l]" for c, o in enumerate(lowered.outputs))),
        sums=_indent(16, (f"sums[e, {c}, begin + l] = W[{at[f'sum_{o}']} + l]" for c, o in enumerate(lowered.outputs))),
        unpack_event=_indent(8, (f"{s} = event[e, {i}]" for i, s in enumerate(lowered.event))),
        fill_signals=_indent(8, _fill_signals(lowered)),
        start=_indent(16, _load_candidate(lowered, rows, at)),
        sample=_indent(20, _sample(lowered, at)),
        advance=_indent(24, _advance(lowered, at, HALF_WAY[integration])),
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
        own = [*lowered.outputs, *(f"sum_{o}" for o in lowered.outputs), "miss"]
        names = [*lowered.states, *lowered.memories, *self.carried, *own]
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
    measured, weights = _compared(lowered)
    given = [f"{what}[{c}, i]" for what in ("measured", "weights") for c in range(len(measured))]
    lines += [f"{_names([*measured, *weights])} = {_names(given)}"]
    needed = dict.fromkeys([*at.needed["renewal"], *at.needed["output"]])
    body = at.load([*carried, *needed])
    if lowered.memories:
        body.append(f"{_targets(lowered.memories)} = _renewal({_names(_arguments(lowered, at, 'renewal'))})")
        body += [f"W[{at[s]} + l] = {s}" for s in lowered.memories]
    body += [f"{_names(lowered.outputs)} = _output({_names(_arguments(lowered, at, 'output'))})"]
    body += [f"W[{at[o]} + l] = {o}" for o in lowered.outputs]
    off = [f"({m} - {o})" for m, o in zip(measured, lowered.outputs, strict=True)]
    body += [
        f"W[{at[f'sum_{o}']} + l] += {w} * {d} * {d}" for o, w, d in zip(lowered.outputs, weights, off, strict=True)
    ]
    return [*lines, "for l in range(lanes):", *_nested(body)]


def _compared(lowered: Lowered) -> tuple[list[str], list[str]]:
    """What the kernel calls the measured values of its outputs, and their weights."""
    names = [o.lower() if o.isupper() else f"{o}_m" for o in lowered.outputs]
    return names, [f"w_{name}" for name in names]


def _advance(lowered: Lowered, at: _Rows, half_way: str) -> list[str]:
    """A step of four stages, Eq. (4), the voltage smooth between samples."""
    # slope, where the voltage is taken, and how far along which slope the states are
    middle = ("k2", "b", (half_way, "k1")), ("k3", "b", (half_way, "k2"))
    stages = ("k1", "a", None), *middle, ("k4", "c", ("h", "k3"))
    if not lowered.states:
        return ["pass"]
    inner = []
    for point, fraction in (("a", "j"), ("b", "(j + 0.5)"), ("c", "(j + 1)")):
        inner += [_between(s, point, fraction) for s in lowered.inputs]
        if signals := [s for s, _ in lowered.derivative.signals]:
            inputs = [f"{s}{point}" for s in lowered.inputs]
            inner.append(f"{_targets(f'{s}{point}' for s in signals)} = _drive({_names([*inputs, *lowered.event])})")
    body = at.load([*lowered.states, *lowered.memories, *at.needed["derivative"]])
    body += [_stage(lowered, at, *stage) for stage in stages]
    for s in lowered.states:
        body.append(f"W[{at[s]} + l] = {s} + h / 6.0 * (k1_{s} + 2.0 * (k2_{s} + k3_{s}) + k4_{s})")
    inner += ["for l in range(lanes):", *_nested(body)]
    return ["for j in range(substeps[e]):", *_nested(inner)]


def _between(symbol: sympy.Symbol, point: str, fraction: str) -> str:
    """An input between samples i and i + 1: the voltage on the cubic its slopes define, all else on a straight line."""
    k, place = _row(symbol), f"{fraction} / substeps[e]"
    rates = {rate: name for name, rate in SMOOTH.items()}
    if symbol.name in SMOOTH or symbol.name in rates:
        name = rates.get(symbol.name, symbol.name)
        value, rate = INPUTS.index(name), INPUTS.index(SMOOTH[name])
        ends = f"inputs[{value}, i], inputs[{value}, i + 1], step * inputs[{rate}, i], step * inputs[{rate}, i + 1]"
        scale = "" if symbol.name == name else " / step"
        return f"{symbol}{point} = _{'slope' if scale else 'cubic'}({ends}, {place}){scale}"
    return f"{symbol}{point} = inputs[{k}, i] + (inputs[{k}, i + 1] - inputs[{k}, i]) * ({place})"


def _stage(lowered: Lowered, at: _Rows, slope: str, point: str, ahead: tuple[str, str] | None) -> str:
    n = len(lowered.states)
    states = [f"{s} + {ahead[0]} * {ahead[1]}_{s}" if ahead else str(s) for s in lowered.states]
    arguments = states + _arguments(lowered, at, "derivative", point)[n:]
    return f"{_targets(f'{slope}_{s}' for s in lowered.states)} = _derivative({_names(arguments)})"


def _start(lowered: Lowered, rows: list[sympy.Symbol]) -> str:
    """States before the event and by how much the requirements are missed (0: a steady state exists)."""
    states, slacks = lowered.start.expressions[: len(lowered.starts)], lowered.start.expressions[len(lowered.starts) :]
    short = [f"max(0.0, -({_printed(s)}))" for s in slacks]
    lines = [f"{s} = {_printed(e)}" for s, e in lowered.start.temporaries]
    lines.append(f"miss = min({' + '.join(short) or '0.0'}, 1e6)")
    missed = "miss if miss >= 0.0 else 1e6"
    if len(states) >= LONG_TUPLE:
        lines, missed = [*lines, f"miss = {missed}"], "miss"
    lines.append(f"return {', '.join([*map(_printed, states), missed])}")
    return _text("_start", [*rows, *lowered.event], lines)


def _settle(lowered: Lowered, rows: list[sympy.Symbol]) -> str:
    n = len(lowered.states)
    states, remembered = lowered.starts[:n], lowered.starts[n:]
    known = _names([*rows, *lowered.event])
    x = _names([*(f"x[{k}]" for k in range(n)), *remembered])
    moving = {"f": _targets(f"f[{k}]" for k in range(n)), "g": _targets(f"g[{k}]" for k in range(n))}
    arguments = _names([*rows, *lowered.event, *lowered.starts])
    if not n:
        return f"\n\n@inlined\ndef _settle({arguments}):\n    return (0.0,)\n"
    text = SETTLE.format(arguments=arguments, states=_names(states), n=n, known=known, x=x, **moving)
    if n >= LONG_TUPLE:
        text = text.replace(f"return {x}, ", "off = ").rstrip() + f"\n    return {x}, off\n"
    return text.replace(f"return {x},", f"return {_names(f'x[{k}]' for k in range(n))},")


def _phase(name: str, arguments: list, phase: Phase) -> str:
    return _function(name, arguments, phase.temporaries, phase.expressions)


def _function(name: str, arguments: list, temporaries: Iterable, expressions: Iterable[sympy.Expr]) -> str:
    results = [_printed(e) for e in expressions]
    if not results:
        return ""
    lines = [f"{s} = {_printed(e)}" for s, e in temporaries]
    lines.append(f"return {', '.join(results)}{',' * (len(results) == 1)}")
    return _text(name, arguments, lines)


def _text(name: str, arguments: list, lines: list[str]) -> str:
    return f"\n\n@inlined\ndef {name}({_names(arguments)}):\n{_indent(4, lines)}\n"


def _names(symbols: Iterable[object]) -> str:
    return ", ".join(map(str, symbols))


def _nested(lines: Iterable[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _indent(spaces: int, lines: Iterable[str]) -> str:
    return "\n".join(" " * spaces + line for line in lines)
