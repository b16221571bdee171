"""The equations on waveforms: against equations written out by hand, and against what phasors and
physics say.
"""

import functools
import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from waves_of import OMEGA, dip, event, smooth, times, vector

from tractexp.configuration.plugin import discover, get
from tractexp.errors import UserError
from tractexp.extend import Effect, Parameter
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose

MOTORS = (
    "stator_flux",
    "electromechanical",
    "double_cage",
    "double_cage_stator_flux",
    "voltage",
)
STATICS = (
    "branch",
    "compensated_branch",
    "constant_impedance",
    "exponential",
    "zip",
    "constant_power",
    "none",
)
VALUES = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "R_s": 0.03,
    "T_second": 0.01,
    "X_second": 0.18,
    "p_v": 1.4,
    "q_v": 3.0,
    "a_Z": 0.4,
    "a_I": 0.3,
    "b_Z": 0.7,
    "b_I": 0.2,
    "branch_resistance": 0.3,
    "branch_share": 0.5,
    "capacitor": 0.2,
    "zero_conductance": 0.4,
}


class Shunt(Effect):
    """A capacitor in each phase, and a conductance of the zero sequence."""

    name = "shunt"
    capacitor = Parameter(0.0, (0.0, 1.0), "pu", "susceptance", "test", null=0.0)
    zero_conductance = Parameter(0.0, (0.0, 1.0), "pu", "of the zero sequence", "test", null=0.0)
    parameters = (capacitor, zero_conductance)

    def edit(self, eq, capacitor, zero_conductance):
        eq.draw(eq.capacitor(capacitor), zero_conductance * eq.v_zero)


@functools.cache
def model(motor, static="branch", *effects, domain="waves"):
    made = [Shunt() if name == "shunt" else get("effect", name)() for name in effects]
    return compose(get("model/motor", motor)(), get("model/static", static)(), made, domain=domain)


def values(of, **changed):
    return np.array([(VALUES | changed)[name] for name in of.names])


def played(of, made, chosen=None, substeps=16):
    """The currents (3, N) of one candidate."""
    response = of.simulate(
        Drive.from_events([made]), values(of) if chosen is None else chosen, substeps
    )
    assert response.miss[0, 0] == 0
    return response.outputs[:, 0]


def by_hand(made, p):
    """Currents (N,) complex and zero sequence (N,) of a machine, a branch beside a conductance, and
    a capacitor.

    Written in the stationary frame with stator and rotor flux linkages, as textbooks do, and solved
    by DOP853 from the phasors of the circuit before the event. Between samples the voltage is
    SciPy's cubic spline in the turning frame.
    """
    w = OMEGA + made.omega_s0  # rad/s of the frame
    X, T0 = p["X_prime"] / (1 - p["C"]), p["T_prime"] / (1 - p["C"])
    r = p["branch_resistance"]
    t = times(made)
    parts = [CubicSpline(t, y) for y in (made.v.real, made.v.imag)]
    slopes = [y.derivative() for y in parts]
    turn = lambda at: np.exp(1j * w * at)  # noqa: E731
    v = lambda at: (parts[0](at) + 1j * parts[1](at)) * turn(at)  # noqa: E731
    rate = lambda at: (slopes[0](at) + 1j * slopes[1](at)) * turn(at) + 1j * w * v(at)  # noqa: E731

    def machine(psi, rotor, speed, u):
        """The rotor's linkage referred to the stator (behind X'), so that i = (psi - rotor)/X'."""
        i = (psi - rotor) / p["X_prime"]
        torque = (np.conj(rotor) * i).imag
        fluxes = (
            OMEGA * (u - p["R_s"] * i),
            (-rotor + (X - p["X_prime"]) * i) / T0 + 1j * speed * rotor,
        )
        return i, torque, (*fluxes, (torque - p["T_m"]) / p["M"])

    def before(slip):
        """Phasors of the machine at a slip [rad/s] at U0."""
        # rotor linkage over current, at rest in the rotor's frame
        share = (X - p["X_prime"]) / (1 + 1j * slip * T0)
        i = made.U0 / (p["R_s"] + 1j * w / OMEGA * (p["X_prime"] + share))
        return i, share * i

    low, high = 0.0, 1.0 / p["T_prime"]
    for _ in range(200):
        slip = (low + high) / 2
        i0, rotor0 = before(slip)
        low, high = (slip, high) if (np.conj(rotor0) * i0).imag < p["T_m"] else (low, slip)
    i0, rotor0 = before(slip)

    b = p.get("capacitor", 0.0)
    S = made.P0 + 1j * made.Q0 - made.U0 * np.conj(i0 + 1j * b * w / OMEGA * made.U0)
    B = S.imag / made.U0**2 * (r**2 + (w / OMEGA) ** 2) / (w / OMEGA)
    G = S.real / made.U0**2 - B * r / (r**2 + (w / OMEGA) ** 2)

    def rhs(at, y):
        psi, rotor, branch = y[0] + 1j * y[1], y[2] + 1j * y[3], y[5] + 1j * y[6]
        _, _, (dpsi, drotor, dspeed) = machine(psi, rotor, y[4], v(at))
        dbranch = OMEGA * (v(at) - r * branch)
        return [dpsi.real, dpsi.imag, drotor.real, drotor.imag, dspeed, dbranch.real, dbranch.imag]

    start = turn(t[0])
    psi0 = (p["X_prime"] * i0 + rotor0) * start
    branch0, rotor0 = made.U0 / (r + 1j * w / OMEGA) * start, rotor0 * start
    y = np.array(
        [psi0.real, psi0.imag, rotor0.real, rotor0.imag, w - slip, branch0.real, branch0.imag]
    )
    rows = [y]
    for first, last in itertools.pairwise(t):
        y = solve_ivp(rhs, (first, last), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        rows.append(y)
    y = np.array(rows).T
    i = (y[0] + 1j * y[1] - y[2] - 1j * y[3]) / p["X_prime"]
    i = i + G * v(t) + B * (y[5] + 1j * y[6]) + b / OMEGA * rate(t)
    return i, p.get("zero_conductance", 0.0) * made.v_zero


@pytest.mark.parametrize("f0", [50.0, 49.7])
def test_the_kernel_agrees_with_equations_written_by_hand_and_converges_in_order_four(f0):
    of = model("stator_flux", "branch", "shunt")
    u = dip(0.45, jump=0.6, negative=0.2, end=0.05, f0=f0)
    zero = lambda t: 0.1 * smooth(t / 0.004) * np.cos(2 * np.pi * f0 * t)  # noqa: E731
    made = event(u, zero, rate=3200.0, length=0.09, f0=f0, U0=0.98)
    current, i_zero = by_hand(made, dict(zip(of.names, values(of), strict=True)))
    errors = []
    for substeps in (1, 2, 4, 32):
        alpha, beta, null = played(of, made, substeps=substeps)
        errors.append(np.abs(alpha + 1j * beta - current).max())
        assert null == pytest.approx(i_zero, abs=1e-14)
    assert np.abs(i_zero).max() > 0.03
    assert errors[-1] < 1e-10
    assert np.log2(np.array(errors[:2]) / errors[1:3]) == pytest.approx(4, abs=0.3)


def compensated(**changed):
    """A motor beside a compensated branch, its values, and what the circuit by hand is told of it:
    the capacitor's susceptance from its share.
    """
    of = model("stator_flux", "compensated_branch")
    chosen = values(of, **changed)
    made = event(dip(0.45, jump=0.6, negative=0.2, end=0.05), rate=3200.0, length=0.09)
    left = of.at_rest(chosen, Drive.from_events([made]))
    p = dict(zip(of.names, chosen, strict=True))
    inductive = p["branch_share"] * left["P_s0"] / p["branch_resistance"]
    assert inductive > left["Q_s0"]
    return of, made, chosen, p | {"capacitor": (inductive - left["Q_s0"]) / made.U0**2}


def test_a_compensated_branch_is_its_circuit_with_the_capacitor_that_balances_q():
    of, made, chosen, known = compensated()
    current, _ = by_hand(made, known)
    assert known["capacitor"] > 0.5
    assert vector(of.simulate(Drive.from_events([made]), chosen, 32)) == pytest.approx(
        current, abs=1e-9
    )


def test_a_compensated_branch_without_a_capacitor_is_the_branch():
    """Where what a share of P gives the branch is less than Q, its Q is all there is."""
    made = event(dip(0.5, jump=0.7, negative=0.25), length=0.2)
    of, branch = model("stator_flux", "compensated_branch"), model("stator_flux", "branch")
    inductive = {"branch_resistance": 1.2, "T_m": 0.1, "X_prime": 0.9}
    seen = played(of, made, values(of, branch_share=0.02, **inductive))
    assert seen == pytest.approx(played(branch, made, values(branch, **inductive)), abs=1e-12)
    assert np.abs(seen - played(of, made, values(of, branch_share=0.9, **inductive))).max() > 0.1


@pytest.mark.parametrize("Q0", [0.3, -0.3])
def test_the_admittances_of_a_compensated_branch_add_up_in_either_sequence(Q0):
    """At rest each sequence sees conductance, branch and capacitor side by side."""
    r, share, U2 = 0.4, 0.3, 0.1
    of = model("none", "compensated_branch")
    made = event(
        lambda t: np.exp(1j * OMEGA * t) + U2 * smooth(t / 0.02) * np.exp(-1j * OMEGA * t),
        length=0.3,
        Q0=Q0,
    )
    t = times(made)
    at_rest = (t > 0.25) & (t < 0.29)
    current = vector(of.simulate(Drive.from_events([made]), np.array([r, share]), 16))
    turn = made.turn[at_rest]
    inductive = share / r
    Y = lambda w: 1 - share + inductive * (1 + r**2) / (r + 1j * w) + 1j * w * (inductive - Q0)  # noqa: E731
    assert Y(1) == pytest.approx(1 - 1j * Q0)
    known = Y(1) * turn + U2 * Y(-1) * np.conj(turn)
    assert np.abs(current[at_rest] - known).max() < 1e-6


def test_parameters_of_a_compensated_load_are_found_in_currents_made_by_scipy():
    of, made, chosen, known = compensated()
    current, _ = by_hand(made, known)
    drive = Drive.from_events([made])
    names = ["T_m", "M", "R_s", "branch_resistance", "branch_share"]
    at = [of.names.index(name) for name in names]

    def miss(factors):
        tried = chosen.copy()
        tried[at] *= factors
        off = vector(of.simulate(drive, tried, 4)) - current
        return np.concatenate([off.real, off.imag])

    found = least_squares(miss, [0.8, 1.3, 1.4, 1.4, 0.8], bounds=(0.5, 1.6)).x
    assert found == pytest.approx(np.ones(len(names)), abs=1e-3)


def test_a_load_of_which_a_negative_element_would_be_left_is_refused():
    of, made = model("stator_flux", "compensated_branch"), event(dip())
    drive = Drive.from_events([made])
    assert "the static load would generate" in of.refusal(values(of, T_m=1.05), drive)
    inductive = {"T_m": 0.1, "X_prime": 0.9, "branch_resistance": 8.0}
    assert "more active power than there is" in of.refusal(values(of, **inductive), drive)


@pytest.mark.parametrize("angle", [0.7, -2.4])
def test_a_voltage_turned_by_an_angle_gives_currents_turned_by_it(angle):
    of, whole = model("stator_flux", "branch", "shunt"), np.exp(1j * angle)
    made = event(dip(0.4, jump=0.5, negative=0.2), length=0.2)
    turned = event(dip(0.4, jump=0.5, negative=0.2), length=0.2, angle=angle)
    one, other = (
        vector(of.simulate(Drive.from_events([e]), values(of), 4)) for e in (made, turned)
    )
    assert other == pytest.approx(one * whole, abs=1e-12)


def test_third_order_with_a_stator_resistance_is_fifth_order_with_its_stator_flux():
    third, fifth = (
        model("electromechanical", "branch", "stator_resistance"),
        model("stator_flux", "branch"),
    )
    made = event(dip(0.5, jump=0.7, negative=0.25), length=0.3, f0=49.6, U0=1.02)
    assert played(third, made) == pytest.approx(played(fifth, made), abs=1e-11)


def test_double_cage_with_an_open_second_cage_is_the_single_cage():
    double = model("double_cage", "exponential", "stator_resistance")
    single = model("stator_flux", "exponential")
    made = event(dip(0.5, jump=0.7, negative=0.25), length=0.3, f0=50.3)
    closed = played(double, made, values(double, X_second=VALUES["X_prime"]))
    assert closed == pytest.approx(played(single, made), abs=1e-9)
    assert np.abs(closed - played(double, made)).max() > 0.05


def test_an_offset_decays_where_the_stator_has_a_resistance():
    """What is left of the currents' mean over a cycle, half a second after a sudden dip."""
    made = event(dip(0.4, edge=2e-4, end=10.0), length=0.6, rate=5000.0)
    left = []
    for effects in ((), ("stator_resistance",)):
        of = model("double_cage", "none", *effects)
        current = vector(of.simulate(Drive.from_events([made]), values(of), 4))
        left.append(abs(current[-100:].mean()))
    assert left[0] > 0.3
    assert left[1] < 0.01 * left[0]


# One kernel for each motor, and each static load beside one of them
PAIRS = (
    ("stator_flux", "branch", "shunt"),
    ("electromechanical", "branch", "stator_resistance"),
    ("double_cage", "exponential", "stator_resistance"),
    ("double_cage_stator_flux", "exponential"),
    ("voltage", "zip"),
    ("stator_flux", "compensated_branch"),
    ("stator_flux", "exponential"),
    ("none", "constant_power"),
    ("none", "constant_impedance"),
    ("double_cage", "none"),
    ("double_cage", "none", "stator_resistance"),
)


@pytest.mark.parametrize("names", PAIRS, ids=" ".join)
def test_before_the_event_nothing_moves(names):
    of, U0 = model(*names), 0.97
    made = event(
        lambda t: U0 * np.exp(2j * np.pi * 49.6 * t), f0=49.6, U0=U0, length=0.3, rate=2000.0
    )
    current = vector(of.simulate(Drive.from_events([made]), values(of), 8)) / made.turn
    assert np.abs(current - current[0]).max() < 1e-9
    if names[1] != "none":  # what is recorded before is drawn before
        assert U0 * np.conj(current[0]) == pytest.approx(made.P0 + 1j * made.Q0, abs=1e-9)


def test_the_pairs_are_all_there_is():
    refused = {"mechanical", "exponential_frequency"}
    assert {p[0] for p in PAIRS} == set(MOTORS) | {"none"}
    assert set(discover()["model/motor"]) == set(MOTORS) | {
        "none",
        "mechanical",
        "motor_groups",
        "line_side_converter",
    }
    assert {p[1] for p in PAIRS} == set(STATICS)
    assert set(discover()["model/static"]) == set(STATICS) | refused - {"mechanical"}


@pytest.mark.parametrize(
    ("motor", "static", "sentence"),
    [
        (
            "mechanical",
            "branch",
            "the motor 'mechanical' does not go with domain=waves: its fluxes are in equilibrium",
        ),
        (
            "none",
            "exponential_frequency",
            "the static load 'exponential_frequency' does not go with domain=waves",
        ),
    ],
)
def test_what_makes_no_sense_of_waveforms_is_refused_in_a_sentence(motor, static, sentence):
    with pytest.raises(UserError) as refused:
        _ = model(motor, static).equations
    assert sentence in str(refused.value)


def test_laws_of_a_constant_impedance_are_one_circuit():
    made = event(dip(0.5, jump=0.7, negative=0.25), length=0.2)
    plain = played(model("none", "constant_impedance"), made)
    fluxes = played(model("none", "exponential"), made, np.array([2.0, 2.0]))
    assert fluxes == pytest.approx(plain, abs=1e-12)
    branch = model("stator_flux", "branch")
    share = played(branch, made, values(branch, branch_resistance=0.05))
    assert share == pytest.approx(
        played(
            model("stator_flux", "exponential"),
            made,
            values(model("stator_flux", "exponential"), p_v=2.0, q_v=2.0),
        ),
        abs=1e-12,
    )


def test_a_constant_power_is_drawn_once_half_a_cycle_has_passed():
    of = model("none", "constant_power")
    made = event(dip(0.4, end=10.0, edge=0.002), length=0.6, Q0=0.0)
    power = made.v * np.conj(
        vector(of.simulate(Drive.from_events([made]), values(of), 4)) / made.turn
    )
    t = times(made)
    assert np.abs(power[t > 0.0121] - 1).max() < 1e-9
    # its admittance is as before
    assert power.real[np.argmin(np.abs(t - 0.002))] == pytest.approx(0.36, abs=0.06)


def test_a_dead_short_leaves_numbers():
    made = event(dip(1.0, end=0.1), length=0.2)
    for names in (("none", "constant_power"), ("stator_flux", "exponential")):
        of = model(*names)
        assert np.isfinite(played(of, made, substeps=4)).all()


@pytest.mark.parametrize(
    "names", [("stator_flux", "branch"), ("double_cage", "branch", "stator_resistance")]
)
def test_input_power_is_losses_and_shaft_power_and_what_is_stored(names):
    """At any state and voltage: v.i = T_e (1 + omega/omega_n) + losses + rate of what is stored."""
    of = model(*names)
    eq, rows = of.equations, of.equations.real_states()
    rng, states = np.random.default_rng(3), [s.name for s, _, _ in rows]
    p = dict(zip(of.names, values(of), strict=True))
    before = dict(
        U0=1.0, U=0.8, omega_s0=0.0, omega_s=0.0, omega_n=OMEGA, P0=1.0, Q0=0.6, step=1e-3
    )
    at_rest = of.at_rest(values(of), Drive.from_events([event(dip())]))
    x = dict(zip(states, rng.normal(0, 0.5, len(states)), strict=True))
    v = complex(*rng.normal(0, 1, 2))
    known = (
        p | before | at_rest | x | {"v_d": v.real, "v_q": v.imag, "turn_re": 1.0, "turn_im": 0.0}
    )
    compute = lambda e: complex(e.subs({s: known[s.name] for s in e.free_symbols}))  # noqa: E731
    slope = {s.name: compute(d).real for s, d, _ in rows}
    vec = lambda of, name: of[f"{name}_re"] + 1j * of[f"{name}_im"]  # noqa: E731

    psi, flux, dpsi, dflux = (vec(of, n) for of in (x, slope) for n in ("psi", "branch_flux"))
    T0, inner, dinner = p["T_prime"] / (1 - p["C"]), vec(x, "E"), vec(slope, "E")
    circuits = [(inner, dinner, p["X_prime"] * p["C"] / (1 - p["C"]), T0)]
    leakage = p["X_prime"]
    if "D_re" in x:
        leakage, second = p["X_second"], p["T_second"] * p["X_prime"] / p["X_second"]
        circuits.append((vec(x, "D"), vec(slope, "D"), p["X_prime"] - leakage, second))
        inner, dinner = inner + vec(x, "D"), dinner + vec(slope, "D")
    current, rate = (psi + 1j * inner) / leakage, (dpsi + 1j * dinner) / leakage
    lost = p["R_s"] * abs(current) ** 2
    stored = leakage * (rate * np.conj(current)).real / OMEGA
    for e, de, reactance, T in circuits:
        lost += reactance / (T * OMEGA) * abs(e / (1j * reactance) - current) ** 2
        stored += (de * np.conj(e)).real / reactance / OMEGA
    shaft = (inner * np.conj(current)).real * (1 + x["omega"] / OMEGA)
    assert (v * np.conj(current)).real == pytest.approx(shaft + lost + stored, rel=1e-9)

    alpha, beta, _ = (compute(eq.real(e)).real for e in eq.outputs().values())
    B = at_rest["Q_s0"] * (1 + p["branch_resistance"] ** 2)
    G = at_rest["P_s0"] - at_rest["Q_s0"] * p["branch_resistance"]
    lost = G * abs(v) ** 2 + B * p["branch_resistance"] * abs(flux) ** 2
    stored = B * (dflux * np.conj(flux)).real / OMEGA
    assert (v * np.conj(alpha + 1j * beta - current)).real == pytest.approx(lost + stored, rel=1e-9)


def test_a_capacitor_draws_its_susceptance_times_the_slope_of_the_voltage():
    """In the stationary frame b (dv/dt)/omega_n; the frame turns at 52 Hz, and where U is 0 the
    load draws nothing.
    """
    eq, turning = model("none", "constant_impedance", "shunt").equations, 2 * np.pi * 2.0
    v, slope, turn = 0.7 + 0.3j, 40.0 - 90.0j, np.exp(0.6j)
    known = {
        "capacitor": 0.2,
        "U": 0.0,
        "U0": 1.0,
        "P0": 1.0,
        "Q0": 0.6,
        "omega_s": turning,
        "omega_s0": 0.0,
        "omega_n": OMEGA,
        "v_d": v.real,
        "v_q": v.imag,
        "v_d_rate": slope.real,
        "v_q_rate": slope.imag,
        "branch_flux_re": 0.4,
        "branch_flux_im": 0.1,
        "turn_re": turn.real,
        "turn_im": turn.imag,
    }
    outputs = [eq.real(e) for e in eq.outputs().values()]
    alpha, beta = (float(e.subs({s: known[s.name] for s in e.free_symbols})) for e in outputs[:2])
    stationary = (slope + 1j * (OMEGA + turning) * v) * turn  # d(v turn)/dt
    assert alpha + 1j * beta == pytest.approx(0.2 * stationary / OMEGA, rel=1e-12)


def test_a_slow_symmetric_dip_draws_the_power_that_phasors_say():
    """The error of P and Q against the third order with its resistance falls with the slope of the
    voltage.
    """
    waves = model("stator_flux", "exponential")
    phasors = model("electromechanical", "exponential", "stator_resistance", domain="phasors")
    gaps = []
    for edge in (0.05, 0.2, 0.8):
        made = event(dip(0.3, end=1.0, edge=edge), length=2.0, rate=2000.0)
        current = vector(waves.simulate(Drive.from_events([made]), values(waves), 4)) / made.turn
        S = made.v * np.conj(current)
        n = len(made.v)
        still = Excitation(
            made.step, made.v.real.copy(), np.ones(n), np.full(n, 0.6), 1.0, 1.0, 0.6
        )
        plain = phasors.simulate(Drive.from_events([still]), values(phasors), 4)
        gaps.append(np.abs(S - plain.P[0] - 1j * plain.Q[0]).max())
    assert gaps[0] > 5e-3
    assert gaps[1] < 0.4 * gaps[0]
    assert gaps[2] < 0.4 * gaps[1]
