"""A load model's equations, declared once as symbols.

The parts of a load write into one `Equations`: parameters, sites and other named quantities, states
with their derivatives and steady state, and the power they draw. Kernel, steady state, parameter
table and LaTeX are derived from it. What stands at a site can be edited after it was placed: that
is what a missing effect does.
"""

from collections.abc import Callable, Iterable
from typing import Any, Literal, NoReturn

import sympy
from sympy import I, conjugate, im, re

from tractexp.errors import Unfit, Unknown, UserError, suggest_nearest
from tractexp.kernel.graph import Symbol, collect_symbols
from tractexp.kernel.layout import EVENT, INPUTS, WAVE_INPUTS
from tractexp.model import sites
from tractexp.model.apart import Apart
from tractexp.model.drive import OUTPUTS, PHASORS, WAVES
from tractexp.model.graph import replace_symbols
from tractexp.model.names import check_name
from tractexp.model.parts import OWN
from tractexp.model.real_form import RealForm, expand_definitions
from tractexp.model.sites import Site
from tractexp.model.states import UNSAID, Memory, Requirement, State
from tractexp.model.symbols import is_real as _is_real
from tractexp.model.symbols import make_real_symbol as _real
from tractexp.model.symbols import make_vector_symbol as _complex
from tractexp.model.symbols import phasor_parts, start_symbol
from tractexp.parameter import Parameter

LONG_AGO = -(10**6)  # s: the time at which a load rests before the event
NOTHING = sympy.Integer(0)
# of the voltage before the event: below it what draws a power is an admittance
LOWEST = sympy.Rational(1, 20)
# resistance over reactance of a reactive load of which nothing else is said
DAMPING = sympy.Rational(1, 20)


class Equations:
    """The declaration of one composite load, Eq. (7) of Wu et al. 2022.

    Symbols given, all per unit of the record's base except angular speeds [rad/s], which are
    relative to the nominal synchronous speed `omega_n`:

    - inputs, recorded: `U` voltage, `omega_s` synchronous speed (relative to nominal: 0 at nominal
      frequency and where the frequency is not recorded), `U2` negative-sequence voltage; and
      `U_rate`, the slope of U [pu/s], `t`, the time since the first sample [s];
    - before the event: `U0`, `omega_s0`, `U20`, `P0`, `Q0`;
    - `omega_n`, the nominal synchronous speed; `step`, the time between samples [s];
    - `P_s0`, `Q_s0`, what all other parts leave to the static load before the event;
    - `V`, the voltage at the motor's terminals; `omega`, the motor's speed [rad/s, relative to
      nominal];
    - `P`, `Q`, what all parts draw together.

    With the `domain` waves (`eq.waves`) voltages and currents are space vectors in a frame that
    turns at the frequency before the event, and what phasors neglect is kept: a branch's flux and a
    capacitor's charge move. `v` is the voltage there (in phasors it is `U`), `v_rate` its slope
    [pu/s], `v_zero` its zero sequence, `turn` turns into the frame of phase a; `U` is then the size
    of the positive sequence as the past half cycle shows it, `omega_s` the frame's constant speed.
    What is written with `branch`, `capacitor`, `draw` and `consume` holds in both domains.

    `eq[what]` is the symbol of a site, or of a state, parameter or quantity by its name, `what in
    eq` whether there is one. Asking for what a model lacks raises `Unfit`, which refuses the effect
    that asks.

    A flux is one complex symbol; its real and imaginary part become two real states of the kernel.
    """

    def __init__(self, domain: str = PHASORS) -> None:
        """Equations without motor, load or effect; the inputs are those of the domain."""
        self.waves = domain == WAVES
        inputs = ("U", "omega_s", "U_rate", "U2", "t")
        self.U, self.omega_s, self.U_rate, self.U2, self.t = map(_real, inputs)
        v_d, v_q, self.v_zero, v_d_rate, v_q_rate, self.v_zero_rate, turn_re, turn_im = map(
            _real, WAVE_INPUTS
        )
        self.v, self.v_rate, self.turn = self.U, self.U_rate, sympy.Integer(1)
        if self.waves:
            self.v, self.v_rate, self.turn = (
                v_d + I * v_q,
                v_d_rate + I * v_q_rate,
                turn_re + I * turn_im,
            )
        self.recorded_voltage = self.v
        self.U0, self.omega_s0, self.U20, self.omega_n, self.step = map(_real, EVENT)
        self.P0, self.Q0 = _real("P0"), _real("Q0")
        self.P_s0, self.Q_s0 = _real("P_s0"), _real("Q_s0")
        self.parameters: dict[str, Parameter] = {}
        self.definitions: dict[Symbol, sympy.Expr] = {}
        self.steps: dict[Symbol, sympy.Expr] = {}
        self.values_before: dict[Symbol, sympy.Expr] = {}
        self.shown: dict[Symbol, sympy.Expr] = {}
        self.states: dict[Symbol, State] = {}
        self.memories: dict[Symbol, Memory] = {}
        self.requirements: list[Requirement] = []
        # names of the sites that each effect edits; of the load's effects only
        self.edits: dict[str, list[str]] = {}
        self.latex_names: dict[Symbol, str] = {
            self.omega_s: r"\omega_s",
            self.U0: "U_0",
            self.omega_s0: r"\omega_{s0}",
            self.P0: "P_0",
            self.Q0: "Q_0",
            self.omega_n: r"\omega_n",
            self.U2: "U_2",
            self.U20: "U_{20}",
            self.P_s0: "P_{s0}",
            self.Q_s0: "Q_{s0}",
            self.U_rate: r"\dot U",
            self.step: r"\Delta t",
            v_d: "v_d",
            v_q: "v_q",
            self.v_zero: "v_0",
            v_d_rate: r"\dot v_d",
            v_q_rate: r"\dot v_q",
            self.v_zero_rate: r"\dot v_0",
            turn_re: r"\cos\theta",
            turn_im: r"\sin\theta",
        }
        drawn = (sites.current, sites.zero_current) if self.waves else (sites.P, sites.Q)
        self._drawn: dict[Site, sympy.Expr] = dict.fromkeys(drawn, sympy.Integer(0))
        # of branches at the bus, by resistance over reactance
        self._fluxes: dict[sympy.Expr, Symbol] = {}
        self._real_form = RealForm(self.definitions, self.states, by_name=self.waves)
        # power [pu] between the recorded bus and that which all parts see
        self._lost = NOTHING, NOTHING
        self._owners: dict[str, str] = {}  # who declared the parameter, state or quantity of a name
        self._writer = "bus"
        if self.waves:
            object.__setattr__(self, "v", self.place(sites.bus_voltage, self.recorded_voltage))
        self._writer = OWN

    def __getattr__(self, name: str) -> NoReturn:
        """Raise `Unknown` for a word that is not offered, with the nearest one."""
        if name.startswith("__"):
            raise AttributeError(name)
        words = [*(w for w in dir(self) if not w.startswith("_")), *sites.SITES]
        nearest = suggest_nearest(name, words) or ";"
        raise Unknown(
            f"the equations offer no 'eq.{name}'{nearest} docs/plugins.md lists all words"
        )

    def __setattr__(self, name: str, value: Any) -> None:
        """Raise `Unknown`: what stands at a site is changed by `edit` alone."""
        if "_writer" in vars(self) and not name.startswith("_"):
            raise Unknown(
                f"eq.{name} cannot be assigned; eq.edit(site, change) changes what stands at a site"
            )
        object.__setattr__(self, name, value)

    # What is there

    def __contains__(self, what: Site | str) -> bool:
        """Whether there is a site or quantity of that name."""
        name = what.name if isinstance(what, Site) else what
        return any(s.name == name for s in (*self._drawn, *self._symbols()))

    def __getitem__(self, what: Site | str) -> Symbol:
        """The symbol of a site, or of the state, parameter or quantity of that name; `Unfit` where
        there is none.
        """
        name = what.name if isinstance(what, Site) else what
        for symbol in self._symbols():
            if symbol.name == name:
                return symbol
        about = (
            f" ({what.about})"
            if isinstance(what, Site)
            else suggest_nearest(name, (s.name for s in self._symbols()))
        )
        raise Unfit(f"its equations have no {name}{about}")

    def _symbols(self) -> list[Symbol]:
        """Everything that has a name: quantities, states, memories and parameters."""
        return [*self.definitions, *self.states, *self.memories, *map(_real, self.parameters)]

    def expression(self, site: Site | str) -> sympy.Expr:
        """The expression at a site now, before any later edit."""
        site = sites.find_site(site)
        return self._drawn[site] if site in self._drawn else self.definitions[self[site]]

    @property
    def V(self) -> Symbol:
        """The voltage at the motor's terminals [pu], a phasor: the recorded voltage unless an
        effect edits it.
        """
        if self._writer == OWN and sites.motor_voltage not in self:
            self.place(sites.motor_voltage, self.v)
        return self[sites.motor_voltage]

    @property
    def omega(self) -> Symbol:
        """The motor's speed [rad/s, relative to nominal]. Raises `Unfit` where it has none or it
        cannot move.
        """
        for state in self.states.values():
            if state.role == "speed" and state.writer == OWN and state.derivative != 0:
                return state.symbol
        raise Unfit("its equations have no speed that moves")

    @property
    def P(self) -> sympy.Expr:
        """The active power of all parts together [pu]; of waves, of the space vectors at an
        instant.
        """
        return (
            re(self.v * conjugate(self._drawn[sites.current]))
            if self.waves
            else self._drawn[sites.P]
        )

    @property
    def Q(self) -> sympy.Expr:
        """The reactive power of all parts together [pu]; of waves, of the space vectors at an
        instant.
        """
        return (
            im(self.v * conjugate(self._drawn[sites.current]))
            if self.waves
            else self._drawn[sites.Q]
        )

    def outputs(self) -> dict[str, sympy.Expr]:
        """The expressions that a simulation is compared by, by name: the power, or the currents in
        the stationary frame.
        """
        if not self.waves:
            return dict(zip(OUTPUTS[PHASORS], (self.P, self.Q), strict=True))
        total, zero = (self._drawn[s] for s in (sites.current, sites.zero_current))
        return dict(zip(OUTPUTS[WAVES], (*self.parts(self.turn * total), zero), strict=True))

    def list_expressions(self) -> list[sympy.Expr]:
        """Every expression that the parts have written so far."""
        states = (e for s in self.states.values() for e in (s.derivative, s.initial, s.balance))
        memories = (e for m in self.memories.values() for e in (m.renewal, m.initial))
        slacks = (requirement.slack for requirement in self.requirements)
        named = (*self.definitions.values(), *self.steps.values(), *self.values_before.values())
        written = (*named, *self._drawn.values(), *self._lost, *states, *memories, *slacks)
        return [expression for expression in written if expression is not None]

    # What parts write

    def write(self, name: str) -> None:
        """Let the part of this name own all that is written from here on."""
        self._writer = name

    def declare(self, parameters: Iterable[Parameter]) -> dict[str, Symbol]:
        """The symbols of a part's parameters by name. Raises `Unfit` where the model has one of
        that name.
        """
        symbols = {}
        for parameter in parameters:
            if parameter.name in self.parameters:
                raise Unfit(f"the model has a parameter '{parameter.name}' already")
            self.parameters[parameter.name] = parameter
            symbol = symbols[parameter.name] = self._new(_real(parameter.name))
            self.latex_names[symbol] = parameter.symbol
        return symbols

    def define(self, name: str, expression: sympy.Expr, latex: str) -> Symbol:
        """Name a quantity (real or complex), so that later expressions and the printed equations
        use it.
        """
        expression = sympy.sympify(expression)
        return self._define(
            _real(name) if _is_real(expression) else _complex(name), expression, latex
        )

    def place(self, site: Site, expression: sympy.Expr, latex: str | None = None) -> Symbol:
        """Put an expression at a site, where effects may edit it. Raises `UserError` for a site
        that is taken.
        """
        expression = sympy.sympify(expression)
        if site.owner != self._writer or site in self:
            taken = "is taken already" if site in self else f"belongs to the {site.owner}"
            raise UserError(
                f"the site {site.name} {taken}, so the {self._writer} cannot place it; edit it"
                " instead"
            )
        self._check_kind(site, expression)
        # what is real keeps its name
        symbol_of = _real if site.kind == "real" and _is_real(expression) else _complex
        return self._define(symbol_of(site.name), expression, latex or site.latex)

    def _define(self, symbol: Symbol, expression: sympy.Expr, latex: str) -> Symbol:
        """Define a symbol by an expression. Raises `UserError` where the name is taken."""
        if symbol.name in self:
            owner = self._owner(symbol.name)
            raise UserError(
                f"'{symbol.name}' is in this model already{owner}; {self._writer} must name it"
                " otherwise"
            )
        self._owners[symbol.name] = self._writer
        self.latex_names[symbol] = latex
        self.definitions[symbol] = expression
        return symbol

    def _check_kind(self, site: Site, expression: sympy.Expr) -> None:
        """Raise `UserError` where a real site would get what is not made of real symbols and real
        parts.
        """
        if site.kind != "real" or self._plainly_real(expression):
            return
        whole = self.expand(expression, lambda s: s.name not in sites.SITES)
        real = {
            s
            for s in collect_symbols(whole)
            if s.name in sites.SITES and sites.SITES[s.name].kind == "real"
        }
        left: Any = whole.xreplace(
            dict.fromkeys({*whole.atoms(re, im, sympy.Abs), *real}, _real("part"))
        )
        if not _is_real(left):
            raise UserError(
                f"the site {site.name} is real, and what the {self._writer} puts there is not:"
                f" {expression}; take its real part by sympy.re"
            )

    def _plainly_real(self, expression: sympy.Expr) -> bool:
        """Whether all of it is real but what real parts and sizes are taken of: seen without
        writing it out.
        """
        waiting: list[Any] = [expression]
        visited = set()
        while waiting:
            part = waiting.pop()
            if part in visited or isinstance(part, re | im | sympy.Abs):
                continue
            visited.add(part)
            site = sites.SITES.get(part.name) if isinstance(part, Symbol) else None
            if site is None and part in self.definitions:
                waiting.append(self.definitions[part])
            elif part is I or (
                isinstance(part, Symbol) and not part.is_real and not (site and site.kind == "real")
            ):
                return False
            waiting += part.args
        return True

    def compute(
        self, name: str, expression: sympy.Expr, before: sympy.Expr | None = None
    ) -> Symbol:
        """A real quantity that is computed once and then referred to, such as a step of an unrolled
        iteration.

        `before` is its value before the event, needed where the steady state or the static load's
        share depends on it: there the iteration has converged.
        """
        symbol = _real(name)
        self.steps[symbol] = sympy.sympify(expression)
        if before is not None:
            self.values_before[symbol] = self.real(self.evaluate_before(before))
        self.latex_names[symbol] = name
        return symbol

    def edit(
        self,
        site: Site | str,
        change: Callable[[sympy.Expr], sympy.Expr],
        shown: sympy.Expr | None = None,
    ) -> None:
        """Replace what stands at a site by `change` of it: what a missing effect does.

        The site keeps its name, so effects stack in any order. A real site must stay real. `shown`
        is what LaTeX prints where the change is the solution of an equation. Raises `Unfit` where
        the model lacks the site.
        """
        site = sites.find_site(site)
        before = self.expression(site)
        if site is sites.current:
            before = self._name_vector("current", before)
        changed = change(before)
        if changed is None:
            raise Unfit(
                f"its edit of {site.name} returns nothing; the function given to eq.edit must"
                " return what stands there from then on"
            )
        expression = sympy.sympify(changed)
        self._check_kind(site, expression)
        self._real_form.forget()
        self.edits.setdefault(self._writer, []).append(site.name)
        if site in self._drawn:
            self._drawn[site] = expression
            return
        if shown is not None:
            self.shown[self[site]] = shown
        self.definitions[self[site]] = expression

    def flux(self, name: str, latex: str) -> Symbol:
        """A complex state [pu]: a rotor or stator flux, or the voltage behind a reactance that
        stands for it.

        Call the voltage behind the transient reactance `E`: magnetic saturation asks for it by that
        name.
        """
        return self._state(_complex(name), latex, "flux")

    def speed(self, latex: str = r"\omega", name: str = "omega") -> Symbol:
        """The speed of the motor [electrical rad/s, relative to nominal synchronous]."""
        return self._state(_real(name), latex, "speed")

    def lag(self, name: str, latex: str) -> Symbol:
        """Any other real state, such as those that effects add."""
        return self._state(_real(name), latex, "lag")

    def lag_vector(self, name: str, latex: str) -> Symbol:
        """Any other complex state, such as the flux of a branch or the voltage of a
        capacitor [pu].
        """
        return self._state(_complex(name), latex, "lag")

    def view_with_suffix(self, suffix: str) -> Apart:
        """These equations as a further machine writes into them: whatever it names ends in this
        suffix.
        """
        return Apart(self, suffix)

    def twin(self, state: Symbol, suffix: str) -> Symbol:
        """A state of the same role, as a second machine of the same equations has one."""
        first = self.states[state]
        symbol = _real(state.name + suffix) if state.is_real else _complex(state.name + suffix)
        return self._state(symbol, f"{first.latex}{suffix}", first.role)

    def _state(self, symbol: Symbol, latex: str, role: Literal["flux", "speed", "lag"]) -> Symbol:
        """A new state, of the part that writes at present."""
        self.states[self._new(symbol)] = State(symbol, latex, role, self._writer)
        self.latex_names[symbol] = latex
        return symbol

    def _new(self, symbol: Symbol) -> Symbol:
        """The symbol, known as the writer's. Raises `Unfit` where its name is taken."""
        check_name(symbol.name)
        if any(s.name == symbol.name for s in (*self.definitions, *self.states, *self.memories)):
            owner = self._owner(symbol.name)
            raise Unfit(
                f"the model has a state or quantity '{symbol.name}' already{owner}; prefix the"
                " names of states"
            )
        self._owners[symbol.name] = self._writer
        return symbol

    def _owner(self, name: str) -> str:
        """The end of a sentence about a name that is taken: by whom."""
        if name not in self._owners:
            return ""
        owner = self._owners[name]
        return (
            ", declared by "
            f"{({OWN: 'the motor', 'static': 'the static load'}).get(owner, f'the effect {owner}')}"
        )

    def moves(
        self,
        state: Symbol,
        derivative: sympy.Expr,
        initial: sympy.Expr,
        balance: sympy.Expr | None = None,
    ) -> None:
        """Give a state its time derivative and its steady state before the event.

        `balance` vanishes there where the derivative does not tell it: for a state that stays where
        it was.
        """
        if state not in self.states:
            raise UserError(
                f"eq.moves() was given '{state}', which is no state; make one by eq.flux, eq.speed"
                " or eq.lag"
            )
        row = self.states[state]
        row.derivative, row.initial = sympy.sympify(derivative), sympy.sympify(initial)
        row.balance = None if balance is None else sympy.sympify(balance)

    # What parts draw at the bus, written once for phasors and waveforms

    def consume(self, P: sympy.Expr, Q: sympy.Expr, damping: sympy.Expr = DAMPING) -> None:
        """Add power drawn at the bus (positive when consumed); before the event the static load
        gives way.

        Of waves it is the current of a conductance beside a branch of resistance over reactance
        `damping`, which draw these powers at the sizes of the voltage that `U` shows: admittances
        that vary slowly. A power that changes within a cycle does so as fast as `U` follows. Below
        a twentieth of the voltage before the event admittances grow no further.
        """
        P = sympy.sympify(P)
        Q = sympy.sympify(Q)
        if not self.waves:
            for site, power in ((sites.P, P), (sites.Q, Q)):
                self._drawn[site] += power
            return
        speed = 1 + self.omega_s / self.omega_n
        G = P - Q * damping / speed
        B = Q * (speed**2 + damping**2) / speed
        current = G * self.v + (B * self._flux_of(damping) if Q != 0 else 0)
        self.draw(current / sympy.Max(self.U, LOWEST * self.U0) ** 2)

    def draw(self, current: sympy.Expr, zero: sympy.Expr = NOTHING) -> None:
        """Add a current drawn at the bus [pu] and, of waves, one of zero sequence."""
        if self.waves:
            self._drawn[sites.current] += self._name_vector("drawn", current)
            self._drawn[sites.zero_current] += zero
            return
        drawn = self.v * conjugate(current)
        self.consume(re(drawn), im(drawn))

    def _name_vector(self, name: str, expression: sympy.Expr) -> sympy.Expr:
        """A space vector by a name of its own, so that what is made of it does not repeat it."""
        expression = sympy.sympify(expression)
        if expression.is_Atom:
            return expression
        k = sum(s.name.startswith(f"{name}_") for s in self.definitions) + 1
        return self._define(_complex(f"{name}_{k}"), expression, f"i_{{{name.split('_')[0]},{k}}}")

    def lose(self, P: sympy.Expr, Q: sympy.Expr) -> None:
        """Power lost before the event between the recorded bus and the voltage that all parts see,
        of waves.
        """
        self._lost = self._lost[0] + P, self._lost[1] + Q

    def branch(
        self,
        name: str,
        latex: str,
        voltage: sympy.Expr,
        impedance: sympy.Expr,
        behind: sympy.Expr = NOTHING,
        *,
        flux_moves: bool = False,
    ) -> sympy.Expr:
        """The current [pu] through a resistance and a reactance in series, R + jX, from `voltage`
        to that `behind`.

        Phasors: (V - E)/(R + jX). Waves, and phasors where `flux_moves`: (psi + jE)/X, where the
        flux linkage psi, a state of that name, follows dpsi/dt = omega_n (V - R i) - j (omega_n +
        omega_s) psi, which at rest and at nominal frequency is the same.
        """
        if not (self.waves or flux_moves):
            return (voltage - behind) / impedance
        R = re(impedance)
        X = im(impedance)
        psi = self.lag_vector(name, latex)
        speed = 1 + self.omega_s / self.omega_n
        current = (psi + I * behind) / X
        before = (voltage - speed * behind) / (R + I * X * speed)
        self.moves(
            psi, self.omega_n * (voltage - R * current - I * speed * psi), X * before - I * behind
        )
        self.states[psi].derived = True
        return current

    def capacitor(self, susceptance: sympy.Expr) -> sympy.Expr:
        """The current [pu] of a capacitor at the bus, b (dv/dt/omega_n + j (1 + omega_s/omega_n)
        v).
        """
        rate = NOTHING
        site = sites.bus_voltage_rate
        if self.waves:  # its slope is a site where a part reads it, which most do not
            rate = (
                self[site]
                if site in self
                else self._define(_complex(site.name), self.v_rate, site.latex)
            )
        return susceptance * (rate / self.omega_n + I * (1 + self.omega_s / self.omega_n) * self.v)

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

    # What a sample renews, and what a steady state needs

    def memory(self, name: str, latex: str) -> Symbol:
        """A real state that changes once a sample, such as a relay's."""
        symbol = self._new(_real(name))
        self.memories[symbol] = Memory(symbol, latex)
        self.latex_names[symbol] = latex
        return symbol

    def renews(self, memory: Symbol, renewal: sympy.Expr, initial: sympy.Expr) -> None:
        """Give a memory its value at a sample, from itself, inputs and states there, and its value
        before.
        """
        if memory not in self.memories:
            raise UserError(
                f"eq.renews() was given '{memory}', which is no memory; make one by eq.memory"
            )
        self.memories[memory].renewal = sympy.sympify(renewal)
        self.memories[memory].initial = sympy.sympify(initial)

    def require(self, slack: sympy.Expr, sentence: str, shown: sympy.Expr | None = None) -> None:
        """A steady state exists only where `slack` >= 0. `{value}` in the sentence prints `shown`,
        else the slack.
        """
        shown = slack if shown is None else shown
        self.requirements.append(Requirement(sympy.sympify(slack), sentence, sympy.sympify(shown)))

    def close(self) -> None:
        """Give the static load what the other parts leave before the event. Called once all parts
        have declared.
        """
        self._check_said()
        self._derive_starts()
        others = self._powers_without_static()
        lost = [self.real(self.evaluate_before(power)) for power in self._lost]
        size = sum(part**2 for part in self.parts(self.evaluate_before(self.v)))
        # what admittances that stand for a power at U_0 draw of it before the event, where the bus
        # has less
        share = sympy.Integer(1) if not self.waves or size == self.U0**2 else size / self.U0**2
        self.definitions[self.P_s0] = (self.P0 - others[0] - lost[0]) / share
        self.definitions[self.Q_s0] = (self.Q0 - others[1] - lost[1]) / share
        self._real_form.forget()
        for symbol, declared in (self.states | self.memories).items():
            self._check_still(f"the value before the event of '{symbol}'", declared.initial)
        for requirement in self.requirements:
            self._check_still(
                f"what must hold for a steady state ('{requirement.sentence}')", requirement.slack
            )

    def _check_said(self) -> None:
        """Raise `UserError` for a state that does not move, or a memory that is not renewed."""
        for symbol, state in self.states.items():
            if state.derivative is UNSAID:
                raise UserError(
                    f"nothing says how the state '{symbol}' moves; call eq.moves once for each"
                    " state"
                )
        for symbol, memory in self.memories.items():
            if memory.renewal is UNSAID:
                raise UserError(
                    f"nothing renews the memory '{symbol}'; call eq.renews once for each memory"
                )

    def _powers_without_static(self) -> list[sympy.Expr]:
        """P and Q before the event of all but the static load."""
        without_static = {self.P_s0: sympy.Integer(0), self.Q_s0: sympy.Integer(0)}
        if not self.waves:
            powers = (replace_symbols(self.expand(p), without_static) for p in (self.P, self.Q))
            return [self.real(self.evaluate_before(power)) for power in powers]
        # space vectors first by their parts, which are short: products across names are long
        whole = self.parts(self.v * conjugate(self._drawn[sites.current]))
        return [
            replace_symbols(power, without_static | self._map_to_values_before()) for power in whole
        ]

    def _derive_starts(self) -> None:
        """Take the values before the event of states that are written in others' by these."""
        values: dict[Symbol, sympy.Expr] = {
            start_symbol(symbol): memory.initial for symbol, memory in self.memories.items()
        }
        for symbol, state in self.states.items():
            if not state.derived:
                values[start_symbol(symbol)] = state.initial
                if not symbol.is_real:
                    values |= zip(
                        phasor_parts(start_symbol(symbol)),
                        (re(state.initial), im(state.initial)),
                        strict=True,
                    )
        for state in self.states.values():
            if state.derived:
                state.initial = replace_symbols(self.evaluate_before(state.initial), values)

    def _check_still(self, what: str, expression: sympy.Expr) -> None:
        """Raise `UserError` where a value before the event is written in what moves after it."""
        inputs = {self.U: "eq.U0", self.omega_s: "eq.omega_s0", self.U2: "eq.U20"}
        moving = {*map(_real, INPUTS), *self.states, *self.memories}
        if stray := sorted(collect_symbols(self.expand(expression)) & moving, key=str):
            use = "".join(f"{inputs[s]} or " for s in stray if s in inputs)
            raise UserError(
                f"{what} contains {stray[0]}, which moves; use {use}eq.evaluate_before(...)"
            )

    def evaluate_before(self, expression: sympy.Expr) -> sympy.Expr:
        """An expression's value before the event, of constants: `eq.evaluate_before(eq.omega)` is
        the speed there.
        """
        return replace_symbols(self.expand(expression), self._map_to_values_before())

    before, apart = evaluate_before, view_with_suffix  # their names in version 0.2

    def _map_to_values_before(self) -> dict[Symbol, sympy.Expr]:
        """{symbol: its value before the event} of all that moves; of a state, and of its real and
        imaginary part, the symbol that it starts from.
        """
        at_start = {symbol: start_symbol(symbol) for symbol in (*self.states, *self.memories)}
        for symbol, start in list(at_start.items()):
            if not symbol.is_real:
                at_start |= zip(phasor_parts(symbol), phasor_parts(start), strict=True)
        return self.at_rest() | at_start

    def at_rest(self) -> dict[Symbol, sympy.Expr]:
        """The values before the event of inputs and computed quantities."""
        still = dict.fromkeys(map(_real, INPUTS), sympy.Integer(0)) | {
            self.t: sympy.Integer(LONG_AGO)
        }
        still |= {_real("v_d"): self.U0, _real("turn_re"): sympy.Integer(1)}
        return (
            still
            | {self.U: self.U0, self.omega_s: self.omega_s0, self.U2: self.U20}
            | self.values_before
        )

    def expand(
        self, expression: sympy.Expr, named: Callable[[Symbol], bool] = lambda _: True
    ) -> sympy.Expr:
        """The expression with the quantities that are `named` (by default all) replaced by what
        they stand for.
        """
        return expand_definitions(sympy.sympify(expression), self.definitions, named)

    def real_states(self) -> list[tuple[Symbol, sympy.Expr, sympy.Expr]]:
        """(symbol, derivative, initial) of each real state, phasors split in two,
        names expanded.
        """
        rows = []
        for state in self.states.values():
            own = (state.symbol,) if state.symbol.is_real else phasor_parts(state.symbol)
            rows.extend(
                zip(own, self.parts(state.derivative), self.parts(state.initial), strict=False)
            )
        return rows

    def real_starts(self) -> list[Symbol]:
        """The symbols that states and memories start from, in the order of the kernel, phasors
        split in two.
        """
        starts = map(start_symbol, (*self.states, *self.memories))
        return [part for s in starts for part in ((s,) if s.is_real else phasor_parts(s))]

    def real_balances(self) -> list[sympy.Expr]:
        """The expressions that vanish in the steady state before the event, one for each real
        state.
        """
        rows: list[sympy.Expr] = []
        for state in self.states.values():
            balance = self.parts(state.derivative if state.balance is None else state.balance)
            rows.extend(balance[:1] if state.symbol.is_real else balance)
        return rows

    def parts(self, expression: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
        """Real and imaginary part in real symbols, names expanded."""
        return self._real_form.parts(expression)

    def real(self, expression: sympy.Expr) -> sympy.Expr:
        """The real part of an expression that is meant to be real."""
        return self._real_form.real(expression)

    def latex(self) -> list[str]:
        """The equations one a line: states, memories, named quantities, power, steady state."""
        from tractexp.model.printed import print_lines

        return print_lines(self)
