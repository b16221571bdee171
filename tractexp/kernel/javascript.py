"""A kernel in JavaScript, from the same lowered equations: one candidate over one event, for the
sliders of a page. It gives what the compiled kernel gives, but for rounding.
"""

import json
from collections.abc import Iterable, Mapping

import sympy

from tractexp.errors import UserError
from tractexp.kernel.emit import HALF_WAY
from tractexp.kernel.expressions import OURS, Expressions
from tractexp.kernel.graph import Symbol
from tractexp.kernel.layout import EVENT, PHASOR_INPUTS, SMOOTH
from tractexp.kernel.lowered import Lowered, Phase
from tractexp.kernel.steady import (
    BALANCED,
    LARGEST_SETTLED_MOVE,
    NEWTON_ITERATIONS,
    SETTLED,
    STATE_DIFFERENCE,
)
from tractexp.storage import files

COMPARISONS = {"olt": "<", "ole": "<=", "ogt": ">", "oge": ">=", "oeq": "===", "une": "!=="}
LOGIC = {"and": "&&", "or": "||", "xor": "!=="}
CALLS = {"fabs": "Math.abs", "floor": "Math.floor", "ceil": "Math.ceil"}


class Script:
    """The arithmetic of kernels as lines of JavaScript: a value is the name of a constant, each
    operation written once.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._names: dict[str, str] = {}

    def value(self, operation: str) -> str:
        """The name of the value of an operation."""
        if operation not in self._names:
            name = self._names[operation] = f"v{len(self._names)}"
            self.lines.append(f"const {name}={operation};")
        return self._names[operation]

    def constant(self, x: float) -> str:
        text = json.dumps(x) if x == x else "NaN"
        return f"({text})" if x < 0 else text

    def truth(self, holds: bool) -> str:
        return json.dumps(holds)

    def add(self, a: str, b: str) -> str:
        return self.value(f"{a}+{b}")

    def subtract(self, a: str, b: str) -> str:
        return self.value(f"{a}-{b}")

    def multiply(self, a: str, b: str) -> str:
        return self.value(f"{a}*{b}")

    def multiply_add(self, a: str, b: str, c: str) -> str:
        return self.value(f"{a}*{b}+{c}")

    def divide(self, a: str, b: str) -> str:
        return self.value(f"{a}/{b}")

    def negative(self, a: str) -> str:
        return self.value(f"-{a}")

    def root(self, a: str) -> str:
        return self.value(f"Math.sqrt({a})")

    def larger(self, a: str, b: str) -> str:
        return self.value(f"{a}>{b}?{a}:{b}")

    def smaller(self, a: str, b: str) -> str:
        return self.value(f"{a}<{b}?{a}:{b}")

    def compare(self, how: str, a: str, b: str) -> str:
        return self.value(f"{a}{COMPARISONS[how]}{b}")

    def logic(self, operation: str, a: str, b: str) -> str:
        return self.value(f"{a}{LOGIC[operation]}{b}")

    def select(self, condition: str, there: str, elsewhere: str) -> str:
        return self.value(f"{condition}?{there}:{elsewhere}")

    def call(self, name: str, a: str) -> str:
        return self.value(f"{CALLS[name]}({a})")


class _ScriptExpressions(Expressions):
    """Expressions whose elementary functions are those of the language."""

    def _function(self, e: sympy.Basic) -> str:
        if type(e) not in OURS:
            return super()._function(e)
        arguments = ",".join(map(self, e.args))
        return self.numbers.value(f"Math.{type(e).__name__}({arguments})")

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> str:
        if base == sympy.E:
            return self.numbers.value(f"Math.exp({self(exponent)})")
        if isinstance(exponent, sympy.Number) and (2 * exponent).is_integer:
            return super()._power(base, exponent)
        return self.numbers.value(f"Math.pow({self(base)},{self(exponent)})")


def write_program(lowered: Lowered, integration: str) -> str:
    """A function `simulate(given, event, inputs, substeps)` of the parameters with P0 and Q0, the
    numbers of the event and the rows of the inputs; it returns the rows of the outputs, null where
    there is no steady state.

    Raises `UserError` for equations that read waveforms.
    """
    read = {symbol.name for symbol in lowered.inputs}
    if not read <= {*PHASOR_INPUTS}:
        raise UserError("a page has sliders for models in phasors, and this one is in waveforms")
    rest = lowered.rest if lowered.states else None
    event = tuple(Symbol(name, real=True) for name in EVENT)
    given = (*lowered.parameters, *(Symbol(name, real=True) for name in ("P0", "Q0")))
    before = (*given, *event)
    lane = (*before, *lowered.starts, *lowered.constants)
    moving = (*lane, *lowered.memories, *lowered.inputs, *lowered.states)
    parts = [
        _write_function("start", before, lowered.start),
        _write_function("constant", (*before, *lowered.starts), lowered.constant),
        _write_function("slope", moving, lowered.derivative),
        _write_function("renewal", moving, lowered.renewal),
        _write_function("output", moving, lowered.output),
    ]
    if rest is not None:
        parts.append(_write_function("rest", (*before, *lowered.starts), rest))
    sizes = {
        "SOLVES": rest is not None,
        "MOST_ITERATIONS": NEWTON_ITERATIONS,
        "DIFFERENCE": STATE_DIFFERENCE,
        "LEAST_MOVE": LARGEST_SETTLED_MOVE,
        "SETTLED": SETTLED,
        "BALANCED": BALANCED,
        "STATES": len(lowered.states),
        "STARTS": len(lowered.starts),
        "MEMORIES": len(lowered.memories),
        "HALF_WAY": HALF_WAY[integration],
        "INPUTS": [symbol.name for symbol in lowered.inputs],
        "SMOOTH": SMOOTH,
        "STEP": EVENT.index("step"),
    }
    head = [f"const {name}={json.dumps(value)};" for name, value in sizes.items()]
    return "\n".join([*head, *parts, files.read_packaged_text("kernel/simulate.js")])


def _write_function(name: str, arguments: Iterable[Symbol], phase: Phase) -> str:
    """A function of an array `a` of the arguments' values that returns those of a phase."""
    script = Script()
    scope: Mapping[Symbol, str] = {symbol: f"a[{k}]" for k, symbol in enumerate(arguments)}
    expressions = _ScriptExpressions(script, scope)
    for symbol, signal in phase.signals:
        expressions.scope[symbol] = expressions(signal)
    values = expressions.evaluate_phase(phase)
    return f"const {name}=a=>{{{''.join(script.lines)}return[{','.join(values)}];}};"
