"""Every built-in plugin against the contracts that a third party's plugins are held to, and that
these can fail.
"""

import numpy as np
import pytest

import tractexp.testing
from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.extend import (
    Connection,
    Effect,
    Estimator,
    Measurement,
    Optimizer,
    Parameter,
    Reader,
    Static,
    plugin,
    sites,
)
from tractexp.record.phasor_measurement import Averager
from tractexp.testing import channels, loads, models, readers, searches

pytestmark = pytest.mark.usefixtures("registry_as_it_was")

TIBET = [f"pkg://tractexp.data/tibet_{depth}pct.csv" for depth in (50, 30)]
SAMPLES = {"csv": [{"train": TIBET[:1], "validate": TIBET[1:]}]}

TestBuiltIn = tractexp.testing.contract("tractexp_plugins", SAMPLES)


@pytest.fixture
def stranger():
    """Registers a class with these methods as the plugin `stranger`, until the test ends."""

    def register(base, **attributes):
        size = (
            {"a": Parameter(0.0, (0.0, 1.0), "1", "size", "here", null=0.0)}
            if issubclass(base, Effect)
            else {}
        )
        body = {
            "__doc__": "a = b. Source: here.",
            "__module__": "elsewhere.stranger",
            "__annotations__": {},
        }
        return plugin(type("Stranger", (base,), body | size | attributes))

    yield register
    for remembered in (models.model, models.partners, models.find_base_parts):
        remembered.cache_clear()


def halved(self, power, drive, values):
    return power * (0.5 + values["a"].mean())


def mixed(self, power, drive, values):
    return power + values["a"].mean() * np.cumsum(power, axis=2) / 100


def doubled(self, eq, a):
    eq.edit(sites.P_static, lambda P: P * (1 + a) * (1 + eq.U_rate))


def unmoved(self, eq, a):
    eq.edit(sites.P_static, lambda P: P * (1 + 1e-9 * a * eq.U_rate))


def growing(self, eq, a):
    eq.consume(a * eq.t, 0)


def proposed(self, evaluate, box, rng):
    for _ in range(5):
        evaluate(np.random.default_rng().random((10, box.dimension)))
        yield


def stuck(self, evaluate, box, rng):
    x, _ = evaluate(box.uniform(rng, 20))
    yield
    evaluate(x)
    yield


def late(word, initial):
    """An edit with a lag or a memory that begins at `initial`."""

    def edit(self, eq, a):
        state = getattr(eq, word)("late", "x")
        {"lag": eq.moves, "memory": eq.renews}[word](state, a - state, initial(eq))

    return edit


def half_a_cycle(self, nominal):
    return 0.5 / nominal


def missing(self):
    raise KeyError("file")


@pytest.mark.parametrize(
    ("base", "attributes", "check", "sentence"),
    [
        (
            Measurement,
            {"observe": halved},
            loads.is_the_base_model_at_its_null,
            "pu away from the base model",
        ),
        (Measurement, {"observe": mixed}, loads.sees_each_event_by_itself, "mixes events"),
        (
            Effect,
            {"edit": doubled},
            loads.is_the_base_model_at_its_null,
            "pu away from the base model",
        ),
        (Effect, {"edit": doubled}, loads.has_sizes_that_matter, "does not say in 'relevant'"),
        (
            Effect,
            {"edit": unmoved, "relevant": {"a": 1}, "confused_with": ("load_chang",)},
            loads.has_sizes_that_matter,
            "confused with 'load_chang', no other effect; did you mean 'load_change'",
        ),
        (
            Static,
            {"law": lambda self, u: (u, u), "__doc__": "A load. Source: here."},
            loads.says_what_it_is,
            "has no equation: no line with '=' or '->'",
        ),
        (Effect, {"edit": unmoved}, loads.shows_in_a_dip, "shows nothing"),
        (Effect, {"edit": growing}, loads.rests, "under a steady voltage"),
        (Effect, {"edit": growing}, loads.says_what_it_is, "has no line 'Departures:'"),
        (
            Optimizer,
            {"search": proposed},
            searches.gives_the_same_bits_for_the_same_seed,
            "another history",
        ),
        (Optimizer, {"search": stuck}, searches.finds_the_bottom_of_a_bowl, "after a start of"),
    ],
)
def test_a_contract_that_is_broken_says_how(stranger, base, attributes, check, sentence):
    with pytest.raises(AssertionError, match=sentence):
        check(stranger(base, **attributes))


def test_a_reader_that_falls_over_fails_its_contract(stranger):
    with pytest.raises(KeyError):
        readers.refuses_what_is_missing_in_a_sentence(stranger(Reader, read=missing), {})


@pytest.mark.parametrize(
    ("voltage", "sentence"),
    [
        (np.eye(3), "3 voltages and 1 currents"),
        (np.zeros((1, 1)), "a voltage of no channel"),
        (np.array([[np.nan]]), "a voltage of channels times"),
    ],
)
def test_a_connection_that_makes_no_load_fails_its_contract(stranger, voltage, sentence):
    made = stranger(Connection, voltage=lambda self: voltage, current=lambda self: np.eye(1))
    with pytest.raises(AssertionError, match=sentence):
        channels.makes_three_phases_or_one(made)


def test_an_estimator_that_is_late_fails_its_contract(stranger):
    made = stranger(Estimator, half=half_a_cycle, weight=lambda self, at, nominal: 1 + 10 * at)
    with pytest.raises(AssertionError, match="ms off its stamp"):
        channels.keeps_a_window_of_sum_one_about_its_center(made)


def test_an_estimator_that_is_off_fails_its_contract(stranger):
    def averager(self, rate, nominal):
        return Averager(60, lambda y, rate, f, at: 0.9 * y[..., at])

    made = stranger(
        Estimator, half=half_a_cycle, weight=lambda self, at, nominal: 1 + 0 * at, averager=averager
    )
    with pytest.raises(AssertionError, match=r"off a sinusoid of 48\.7 Hz"):
        channels.is_exact_in_steady_state(made)


def test_an_effect_that_nothing_takes_fails_with_the_reason(stranger):
    def edit(self, eq, a):
        eq["no_such_quantity"]

    with pytest.raises(
        AssertionError, match="no registered motor and static load take the effect 'stranger'"
    ):
        loads.rests(stranger(Effect, edit=edit))


@pytest.mark.parametrize(
    ("law", "sentence"),
    [
        (lambda self, u: (2 * u, u), "P/P_s0 is 2 before the event"),
        (lambda self, u: u, "it must return two expressions"),
    ],
)
def test_a_law_that_is_none_is_refused_when_the_model_is_composed(stranger, law, sentence):
    with pytest.raises(UserError, match=sentence):
        _ = models.with_part(stranger(Static, law=law)).equations


def test_a_law_with_parameters_that_returns_nothing_is_refused(stranger):
    """As one does who forgets the `return`; it would be a load without its static part."""
    slope = Parameter(1.0, (0.0, 3.0), "1", "slope", "here")
    made = stranger(Static, slope=slope, law=lambda self, u, slope: None)
    with pytest.raises(UserError, match="returns nothing, so that no equation has its slope"):
        _ = models.with_part(made).equations


@pytest.mark.parametrize(
    ("edit", "sentence"),
    [
        (
            lambda self, eq, a: eq.edit(sites.load_torque, lambda T: T + a * eq["E"]),
            "load_torque is real, and what",
        ),
        (
            lambda self, eq, a: eq.edit("load_torqe", lambda T: T),
            "no site 'load_torqe'; did you mean 'load_torque'",
        ),
        (lambda self, eq, a: eq.omgea, r"offer no 'eq\.omgea'; did you mean 'omega'"),
        (lambda self, eq, a: setattr(eq, "P", 0), r"eq\.P cannot be assigned; eq\.edit"),
        (
            lambda self, eq, a: eq.place(sites.coupling, a),
            "coupling is taken already|belongs to the motor",
        ),
        (lambda self, eq, a: eq.moves(eq.U, a, 0), "given 'U', which is no state"),
        (lambda self, eq, a: eq.lag("idle", "x"), "nothing says how the state 'idle' moves"),
        (lambda self, eq, a: eq.lag("_x1", "x"), "called '_x1': that is no name of Python's"),
        (
            lambda self, eq, a: eq.lag("omega", "x"),
            "quantity 'omega' already, declared by the motor; prefix the names",
        ),
        (
            lambda self, eq, a: eq.edit(sites.load_torqe, lambda T: T),
            r"no 'sites\.load_torqe'; did you mean 'load_torque'",
        ),
        (
            late("lag", lambda eq: eq.U),
            r"before the event of 'late' contains U, which moves; "
            r"use eq\.U0 or eq\.evaluate_before",
        ),
        (
            late("memory", lambda eq: eq[sites.static_voltage]),
            "before the event of 'late' contains U, which moves",
        ),
        (
            late("lag", lambda eq: eq.omega),
            r"of 'late' contains omega, which moves; use eq\.evaluate_before",
        ),
        (
            lambda self, eq, a: eq.require(eq.U2 - a, "too low"),
            r"\('too low'\) contains U2, which moves; use eq\.U20",
        ),
    ],
)
def test_what_an_edit_does_wrong_is_a_sentence(stranger, edit, sentence):
    motor, static = models.partners()
    with pytest.raises(UserError, match=sentence):
        _ = models.model(motor, static, stranger(Effect, edit=edit)).equations


def test_a_law_is_evaluated_at_a_state_by_substitution(stranger):
    def edit(self, eq, a):
        late = eq.lag("late_voltage", "u_l")
        eq.moves(late, (eq[sites.static_voltage] - late) / 0.1, 1)
        eq.edit(sites.Q_static, lambda Q: (1 - a) * Q + a * Q.subs(eq[sites.static_voltage], late))

    motor, static = models.partners()
    bare, eq = (
        models.model(motor, static).equations,
        models.model(motor, static, stranger(Effect, edit=edit)).equations,
    )
    law, edited = bare.expression(sites.Q_static), eq.expression(sites.Q_static)
    u, late, a = bare[sites.static_voltage], eq["late_voltage"], eq["a"]
    assert edited.subs(a, 1) == law.subs(u, late) != law
    assert edited.subs(a, 0) == law


def test_two_effects_with_one_name_of_a_state_are_refused_and_the_owner_is_named(stranger):
    motor, static = models.partners()
    second = stranger(Effect, edit=lambda self, eq, a: eq.lag("link_power", "x"))
    with pytest.raises(UserError, match="'link_power' already, declared by the effect dc_link_lag"):
        _ = models.model(motor, static, get("effect", "dc_link_lag"), second).equations


def test_a_static_load_with_a_parameter_of_the_motor_is_refused(stranger):
    motor, _ = models.partners()
    taken = motor.parameters[0]
    law = eval(f"lambda self, u, {taken.name}: (1, 1)")
    static = stranger(Static, law=law, **{taken.name: taken})
    with pytest.raises(
        UserError,
        match=f"static load 'stranger' do not compose: .* a parameter '{taken.name}' already",
    ):
        _ = models.model(motor, static).equations


def test_a_package_without_plugins_is_refused():
    with pytest.raises(UserError, match="the package 'json' has no plugin"):
        tractexp.testing.contract("json")
