"""Modelica model, self-contained."""

import re

from tractexp.extend import UserError, plugin
from tractexp.extend.formats import Format, Restored, quoting


@plugin
class Modelica(Format):
    """A Modelica model with inputs U [pu] and omega_s [rad/s] and outputs P, Q [pu], written from
    the equations.

    Every continuous state, parameter and equation of the identified model, effects included,
    appears under its own name; a phasor as its real and imaginary part. States start at the steady
    state before the event and the model needs no library. Connect the inputs to the magnitude and
    speed of a terminal's voltage phasor.

    Not to be confused with a component of a power system library: it has no electrical connector.

    Source: Modelica Language Specification 3.6, chapters 4 (models), 8 (equations) and 3
    (operators).
    Departures: none. Models with discrete memories, and effects of the measurement, are refused.
    """

    suffix = ".mo"

    def text(self, load):
        eq, before = load.model.equations, load.steady_state
        if eq.memories or load.model.measurements:
            which = next(m.name for m in (*eq.memories, *load.model.measurements))
            raise UserError(
                f"format 'modelica' cannot represent '{which}', which acts on samples; export the"
                " model without the effect it belongs to"
            )
        rows = _equations(eq)
        base = f"per unit of {load.power:.6g} MVA and {load.voltage:.6g} kV"
        lines = [f"model TractionLoad {quoting.modelica(f'{load.model.title}, {base}')}"]
        for p in load.model.parameters:
            about = f"{p.about.replace(RECORD, 'this base')} [{p.unit}]"
            lines.append(
                f"  parameter Real {p.name} = {load.values[p.name]!r} {quoting.modelica(about)};"
            )
        own = {p.name for p in load.model.parameters}
        for name in [*BEFORE, *sorted({*before} - {*BEFORE, *own})]:
            if any(_reads(right, name) for _, right in rows) or name in ("U0", "omega_s0"):
                about = quoting.modelica(BEFORE.get(name, "before the event"))
                lines.append(f"  parameter Real {name} = {before[name]!r} {about};")
        lines += [f"  input Real U(start = U0) {quoting.modelica('voltage [pu]')};"]
        lines += [
            "  input Real omega_s(start = omega_s0)"
            f" {quoting.modelica('synchronous speed less nominal [rad/s]')};"
        ]
        if any(_reads(right, "U2") for _, right in rows):
            lines.append(f"  input Real U2 {quoting.modelica('negative-sequence voltage [pu]')};")
        lines += [f"  output Real {power} {quoting.modelica('consumed [pu]')};" for power in "PQ"]
        for (symbol, *_), start in zip(eq.real_states(), eq.real_starts(), strict=True):
            lines.append(f"  Real {symbol}(start = {before[start.name]!r}, fixed = true);")
        lines += [f"  Real {symbol};" for symbol in eq.steps]
        lines += [
            "equation",
            *(f"  {left} = {right};" for left, right in rows),
            "end TractionLoad;",
        ]
        return "\n".join(lines) + "\n"

    def read_back(self, text, load):
        numbers = {
            name: float(value)
            for name, value in re.findall(r"parameter Real (\w+) = ([-+.\de]+) ", text)
        }
        model = {
            key: load.result.model[key]
            for key in ("motor", "static", "effects", "integration")
            if key in load.result.model
        }
        parameters = {p.name: numbers[p.name] for p in load.model.parameters}
        static = load.steady_state.get("P_static", 0.0), load.steady_state.get("Q_static", 0.0)
        return Restored(model, parameters, static)


RECORD = "the record's base"  # as parameters tell what they are on

BEFORE = {
    "U0": "voltage before the event [pu]",
    "omega_s0": "synchronous speed before the event, less nominal [rad/s]",
    "omega_n": "nominal synchronous speed [rad/s]",
    "P_s0": "active power of the static load before the event [pu]",
    "Q_s0": "reactive power of the static load before the event [pu]",
    "P0": "active power before the event [pu]",
    "Q0": "reactive power before the event [pu]",
    "U20": "negative-sequence voltage before the event [pu]",
    "omega_before": "motor's speed before the event, less synchronous [rad/s]",
}


def _equations(eq):
    """(left, right) of each equation, as Modelica text; what the static load draws before the event
    is one name.
    """
    from tractexp.extend.symbols import Symbol

    static = {eq.P_s0: Symbol("P_left", real=True), eq.Q_s0: Symbol("Q_left", real=True)}
    named = {
        symbol: Symbol(name, real=True)
        for symbol, name in zip(static.values(), ("P_s0", "Q_s0"), strict=True)
    }
    at = {eq.U_rate: Symbol("der(U)", real=True), eq.t: Symbol("time", real=True)}

    def show(e):
        kept = eq.real(eq.expand(e, lambda s: s not in static).xreplace(static))
        return _modelica(kept.xreplace(named | at))

    rows = [(f"der({symbol})", _modelica(d.xreplace(at))) for symbol, d, _ in eq.real_states()]
    rows += [(symbol.name, show(e)) for symbol, e in eq.steps.items()]
    return [*rows, ("P", show(eq.P)), ("Q", show(eq.Q))]


def _modelica(expression):
    """An expression in Modelica's operators and functions."""
    from sympy import Float, Rational, pi
    from sympy.printing.str import StrPrinter

    class Printer(StrPrinter):
        def _print_Pow(self, expr, rational=False):
            if expr.exp == Rational(1, 2):
                return f"sqrt({self._print(expr.base)})"
            base, power = (self.parenthesize(x, 80) for x in (expr.base, expr.exp))
            return (
                f"{base}^{power}"
                if not expr.exp.is_negative
                else f"{base}^({self._print(expr.exp)})"
            )

        def _print_Float(self, expr):
            return repr(float(expr))

    names = {"Max(": "max(", "Min(": "min(", "Abs(": "abs("}
    text = Printer({"full_prec": False}).doprint(
        expression.evalf()
        if isinstance(expression, Float)
        else expression.xreplace({pi: Float(pi)})
    )
    for python, modelica in names.items():
        text = text.replace(python, modelica)
    return text


def _reads(text, name):
    return re.search(rf"\b{name}\b", text) is not None
