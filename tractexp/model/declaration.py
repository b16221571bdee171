"""What the parts of a load return, written into one declaration: the framework's half of every
part.
"""

import inspect
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import sympy
from sympy import conjugate, im, re

from tractexp.errors import RefusedEffect, Unfit, UserError
from tractexp.model import sites
from tractexp.model.drive import PHASORS
from tractexp.model.equations import Equations
from tractexp.model.mistakes import check_size_used, explain_symbols
from tractexp.model.parts import Effect, Measurement, Motor, Part, Static
from tractexp.model.signature import select_arguments
from tractexp.text.wording import join_words

LAW_ROUNDING = 1e-9  # how far from 1 a law may be before the event


def declare_equations(
    motor: Motor, static: Static, effects: Sequence[Effect], title: str, domain: str = PHASORS
) -> Equations:
    """The equations of a load. Raises `RefusedEffect` for an effect that does not fit, and
    `UserError` for parts that do not.
    """
    eq = Equations(domain)
    for what, part in (("motor", motor), ("static load", static)):
        if why := _explain_foreign(eq, part):
            raise UserError(f"the {what} '{part.label}' does not go with domain={domain}: {why}")
    try:
        _declare_motor(eq, motor)
        _declare_static(eq, static)
    except Unfit as why:
        raise UserError(
            f"the motor '{motor.name}' and the static load '{static.name}' do not compose: {why}"
        ) from why
    for effect in effects:
        with _refuse(effect):
            _declare_effect(eq, effect)
    if not any(eq.outputs().values()):
        raise UserError(
            f"the {title} draw no power; choose a model/motor or a model/static other than 'none'"
        )
    eq.close()
    for effect in effects:
        with _refuse(effect):
            check_size_used(eq, effect)
    return eq


@contextmanager
def _refuse(effect: Effect) -> Iterator[None]:
    """Raise `RefusedEffect` where an effect does not fit."""
    try:
        yield
    except Unfit as why:
        raise RefusedEffect(effect.name, str(why)) from why


def _explain_foreign(eq: Equations, part: Part) -> str:
    """Why a part makes no sense in the equations' domain; "" where it does."""
    return part.phasors_only if eq.waves else part.waves_only


def declare_motor_alone(motor: Motor) -> Equations:
    """The equations of a motor without load and effects."""
    eq = Equations()
    _declare_motor(eq, motor)
    return eq


def _declare_motor(eq: Equations, motor: Motor) -> None:
    """The motor draws V conj(I)."""
    eq.write("motor")
    there = len(eq.definitions)
    with explain_symbols(motor):
        current = motor.declare(eq, **eq.declare(motor.parameters))
    if current is None:
        if eq.states or len(eq.definitions) > there:
            raise UserError(
                f"declare() of the motor '{motor.name}' returns nothing; it must return the stator"
                " current"
            )
        return
    V = eq.V
    if sites.stator_current not in eq:
        current = eq.place(sites.stator_current, current)
    if eq.waves:
        eq.draw(eq.place(sites.motor_current, current))
        return
    drawn = V * conjugate(current)
    eq.consume(eq.place(sites.P_motor, re(drawn)), eq.place(sites.Q_motor, im(drawn)))


def _declare_static(eq: Equations, static: Static) -> None:
    """The static load draws its law times what the other parts leave."""
    eq.write("static")
    own = eq.declare(static.parameters)
    u = sympy.Symbol(sites.static_voltage.name, real=True)
    f = sympy.Symbol("static_frequency", real=True)
    symbols = own | ({"f": f} if "f" in inspect.signature(static.law).parameters else {})
    left = {"P_s0": eq.P_s0, "Q_s0": eq.Q_s0}
    before = {"P0": eq.P0, "Q0": eq.Q0, "U0": eq.U0, **left}
    with explain_symbols(static):
        law = static.law(u, **symbols)
        for requirement in static.require(**select_arguments(static.require, own | before)):
            eq.require(*requirement)
    if law is None:
        _refuse_forgotten_law(static)
        return
    _check_law(static, law, {u: 1, f: 1, **{own[p.name]: p.default for p in static.parameters}})
    eq.place(sites.static_voltage, eq.U / eq.U0)
    if "f" in symbols:
        eq.define(f.name, (eq.omega_n + eq.omega_s) / (eq.omega_n + eq.omega_s0), "f")
    P, Q = law
    powers = eq.place(sites.P_static, eq.P_s0 * P), eq.place(sites.Q_static, eq.Q_s0 * Q)
    damping = static.compute_damping(**select_arguments(static.compute_damping, own))
    eq.consume(*powers, damping)
    asked = select_arguments(static.compute_compensation, own | left)
    with explain_symbols(static):
        supplied = static.compute_compensation(**asked)
    if eq.waves and supplied != 0:
        _compensate(eq, supplied, damping)


def _compensate(eq: Equations, supplied: Any, damping: Any) -> None:
    """A capacitor at the bus supplies so much to the branch before the event."""
    supplied = eq.define("compensation", supplied, "Q_C")
    eq.consume(sympy.Integer(0), supplied * (eq.U / eq.U0) ** 2, damping)
    speed = 1 + eq.omega_s0 / eq.omega_n
    eq.draw(eq.capacitor(supplied / (speed * eq.U0**2)))


def _refuse_forgotten_law(static: Static) -> None:
    """Raise `UserError` for a static load that has parameters and no law: no record tells them."""
    names = [p.name for p in static.parameters]
    if names:
        raise UserError(
            f"law() of the static load '{static.name}' returns nothing, so that no equation has its"
            f" {join_words(names)}; return two expressions, P/P_s0 and Q/Q_s0"
        )


def _check_law(static: Static, law: Any, before: Mapping[sympy.Symbol, float]) -> None:
    """Raise `UserError` unless the law is a pair that is 1 at the voltage and frequency before the
    event.
    """
    where = f"law() of the static load '{static.name}'"
    if not (isinstance(law, tuple | list) and len(law) == 2) or None in law:
        raise UserError(
            f"{where} returns {law!r}; it must return two expressions, P/P_s0 and Q/Q_s0, or None"
        )
    for what, share in zip(("P/P_s0", "Q/Q_s0"), law, strict=True):
        value = sympy.sympify(share).subs(before)
        if value.free_symbols:
            raise UserError(
                f"{where}: {what} reads {', '.join(sorted(map(str, value.free_symbols)))}, which it"
                " does not have"
            )
        if not abs(float(value) - 1) < LAW_ROUNDING:
            raise UserError(
                f"{where}: {what} is {float(value):.6g} before the event (u = 1), and must be 1"
                " there"
            )


def _declare_effect(eq: Equations, effect: Effect) -> None:
    """Raises `Unfit` with the reason where the effect makes no sense for the equations."""
    if why := _explain_foreign(eq, effect) or effect.refusal(eq):
        raise Unfit(why)
    eq.write(effect.name)
    if not isinstance(effect, Measurement):
        eq.edits[effect.name] = []
    with explain_symbols(effect):
        effect.edit(eq, **eq.declare(effect.parameters))
