"""What parts draw at the bus: powers, currents, branches and capacitors, written once for phasors and waveforms."""

from typing import TYPE_CHECKING, Any

import sympy
from sympy import I, conjugate, im, re

from tractexp.kernel.graph import Symbol
from tractexp.model import sites
from tractexp.model.symbols import vector_symbol

if TYPE_CHECKING:
    from tractexp.model.sites import Site
    from tractexp.model.states import State

NOTHING = sympy.Integer(0)
LOWEST = sympy.Rational(1, 20)  # of the voltage before the event: below it what draws a power is an admittance
DAMPING = sympy.Rational(1, 20)  # resistance over reactance of a reactive load of which nothing else is said


class Circuit:
    """The words by which `Equations` let parts draw at the bus."""

    waves: bool
    v: Any
    v_rate: Any
    U: Symbol
    U0: Symbol
    omega_s: Symbol
    omega_n: Symbol
    states: "dict[Symbol, State]"
    definitions: dict[Symbol, sympy.Expr]
    _drawn: "dict[Site, sympy.Expr]"
    _fluxes: dict[sympy.Expr, Symbol]
    _lost: tuple[sympy.Expr, sympy.Expr]

    if TYPE_CHECKING:  # of these words `Equations` has the sentences

        def __contains__(self, what: Site | str) -> bool: ...
        def __getitem__(self, what: Site | str) -> Symbol: ...
        def _define(self, symbol: Symbol, expression: sympy.Expr, latex: str) -> Symbol: ...
        def lag_vector(self, name: str, latex: str) -> Symbol: ...
        def moves(
            self, state: Symbol, derivative: sympy.Expr, initial: sympy.Expr, balance: sympy.Expr | None = None
        ) -> None: ...

    def consume(self, P: sympy.Expr, Q: sympy.Expr, damping: sympy.Expr = DAMPING) -> None:
        """Add power drawn at the bus (positive when consumed); before the event the static load gives way.

        Of waves it is the current of a conductance beside a branch of resistance over reactance `damping`, which draw
        these powers at the sizes of the voltage that `U` shows: admittances that vary slowly. A power that changes
        within a cycle does so as fast as `U` follows. Below a twentieth of the voltage before the event admittances
        grow no further.
        """
        P, Q = sympy.sympify(P), sympy.sympify(Q)
        if not self.waves:
            for site, power in ((sites.P, P), (sites.Q, Q)):
                self._drawn[site] += power
            return
        speed = 1 + self.omega_s / self.omega_n
        G, B = P - Q * damping / speed, Q * (speed**2 + damping**2) / speed
        current = G * self.v + (B * self._flux_of(damping) if Q != 0 else 0)
        self.draw(current / sympy.Max(self.U, LOWEST * self.U0) ** 2)

    def draw(self, current: sympy.Expr, zero: sympy.Expr = NOTHING) -> None:
        """Add a current drawn at the bus [pu] and, of waves, one of zero sequence."""
        if self.waves:
            self._drawn[sites.current] += self._named("drawn", current)
            self._drawn[sites.zero_current] += zero
            return
        drawn = self.v * conjugate(current)
        self.consume(re(drawn), im(drawn))

    def _named(self, name: str, expression: sympy.Expr) -> sympy.Expr:
        """A space vector by a name of its own, so that what is made of it does not repeat it."""
        expression = sympy.sympify(expression)
        if expression.is_Atom:
            return expression
        k = sum(s.name.startswith(f"{name}_") for s in self.definitions) + 1
        return self._define(vector_symbol(f"{name}_{k}"), expression, f"i_{{{name.split('_')[0]},{k}}}")

    def lose(self, P: sympy.Expr, Q: sympy.Expr) -> None:
        """Power lost before the event between the recorded bus and the voltage that all parts see, of waves."""
        self._lost = self._lost[0] + P, self._lost[1] + Q

    def branch(
        self, name: str, latex: str, voltage: sympy.Expr, impedance: sympy.Expr, behind: sympy.Expr = NOTHING
    ) -> sympy.Expr:
        """The current [pu] through a resistance and a reactance in series, R + jX, from `voltage` to that `behind`.

        Phasors: (V - E)/(R + jX). Waves: (psi + jE)/X, where the flux linkage psi, a state of that name, follows
        dpsi/dt = omega_n (V - R i) - j (omega_n + omega_s) psi, which at rest and at nominal frequency is the same.
        """
        if not self.waves:
            return (voltage - behind) / impedance
        R, X = re(impedance), im(impedance)
        psi, speed = self.lag_vector(name, latex), 1 + self.omega_s / self.omega_n
        current = (psi + I * behind) / X
        before = (voltage - speed * behind) / (R + I * X * speed)
        self.moves(psi, self.omega_n * (voltage - R * current - I * speed * psi), X * before - I * behind)
        self.states[psi].derived = True
        return current

    def capacitor(self, susceptance: sympy.Expr) -> sympy.Expr:
        """The current [pu] of a capacitor at the bus, b (dv/dt/omega_n + j (1 + omega_s/omega_n) v)."""
        rate = NOTHING
        if self.waves:
            rate = self[sites.bus_voltage_rate] if sites.bus_voltage_rate in self else self._place_rate()
        return susceptance * (rate / self.omega_n + I * (1 + self.omega_s / self.omega_n) * self.v)

    def _place_rate(self) -> Symbol:
        """The site of the voltage's slope: where a part reads it, which most do not."""
        site = sites.bus_voltage_rate
        return self._define(vector_symbol(site.name), self.v_rate, site.latex)

    def _flux_of(self, damping: sympy.Expr) -> Symbol:
        """The flux linkage of a branch at the bus, of one reactance and so much resistance."""
        damping = sympy.sympify(damping)
        if damping not in self._fluxes:
            k = "" if not self._fluxes else f"_{len(self._fluxes) + 1}"
            psi = self._fluxes[damping] = self.lag_vector(f"branch_flux{k}", rf"\psi_s{k}")
            leak = damping + I * (1 + self.omega_s / self.omega_n)
            self.moves(psi, self.omega_n * (self.v - leak * psi), self.v / leak)
            self.states[psi].derived = True
        return self._fluxes[damping]
