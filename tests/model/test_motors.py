"""The motors: each against physics and SciPy, and the limits that tie the family together."""

import functools
import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import Akima1DInterpolator

from independent import Machine
from independent.source import OMEGA
from tractexp.configuration.plugin import discover, get
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose

MOTORS = (
    "mechanical",
    "voltage",
    "electromechanical",
    "stator_flux",
    "double_cage",
    "double_cage_stator_flux",
)
STATICS = (
    "exponential",
    "zip",
    "constant_impedance",
    "constant_power",
    "exponential_frequency",
    "branch",
    "compensated_branch",
    "none",
)
VALUES = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "R_s": 0.02,
    "T_second": 0.01,
    "X_second": 0.18,
    "p_v": 1.4,
    "q_v": 3.0,
    "a_Z": 0.4,
    "a_I": 0.3,
    "b_Z": 0.7,
    "b_I": 0.2,
    "p_f": 1.3,
    "q_f": -1.1,
    "branch_resistance": 0.3,
    "branch_share": 0.3,
}


@functools.cache
def model(motor, static="constant_impedance"):
    return compose(get("model/motor", motor)(), get("model/static", static)())


def values(of, **changed):
    """Parameters of a model in its order."""
    known = VALUES | changed
    return np.array([known[name] for name in of.names])


def dip(step=1e-3, length=1.0, depth=0.4, start=0.2, duration=0.15, edge=0.02, U0=1.0, swing=0.0):
    """A dip with smooth edges, sampled uniformly; the frequency swings by `swing` rad/s where it is
    not 0.
    """
    t = np.arange(round(length / step) + 1) * step
    smooth = lambda x: 0.5 - 0.5 * np.cos(np.pi * np.clip(x, 0, 1))  # noqa: E731
    U = U0 * (1 - depth * (smooth((t - start) / edge) - smooth((t - start - duration) / edge)))
    speed = swing * smooth((t - start) / 0.3) if swing else None
    return Excitation(step, U, np.ones(len(t)), np.full(len(t), 0.6), U0, 1.0, 0.6, omega_s=speed)


def known(of, excitation, parameters, **inputs):
    """Numbers for the symbols of a model's equations, before and during an event."""
    before = {"U0": excitation.U0, "omega_s0": excitation.omega_s0, "omega_n": excitation.omega_n}
    before |= {"P0": excitation.P0, "Q0": excitation.Q0, "step": excitation.step}
    return dict(zip(of.names, parameters, strict=True)) | before | inputs


@functools.cache
def compiled(*expressions):
    """SymPy expressions as one function of numbers by name; what they share is computed once."""
    import sympy

    symbols = sorted(set().union(*(e.free_symbols for e in expressions)), key=str)
    compute = sympy.lambdify(symbols, expressions, cse=True)
    return lambda numbers: compute(*(numbers[s.name] for s in symbols))


def number(expression, numbers):
    """A SymPy expression as a complex number; its symbols are taken by name."""
    return complex(compiled(expression)(numbers)[0])


@functools.cache
def real_states(of):
    return of.equations.real_states()


def at_rest(of, excitation, parameters):
    """The steady state by name: the declared one where the balances vanish there, else SciPy's,
    begun from it.
    """
    from scipy.optimize import root

    numbers = known(of, excitation, parameters, U=excitation.U0, omega_s=excitation.omega_s0)
    start = {s.name: number(i, numbers).real for s, _, i in real_states(of)}
    balances = of.equations.real_balances()

    def missed(x):
        return [number(b, numbers | dict(zip(start, x, strict=True))).real for b in balances]

    if np.abs(missed(start.values())).max(initial=0.0) < 1e-9:
        return start
    found = root(missed, list(start.values()), tol=1e-12)
    assert found.success
    return dict(zip(start, found.x.tolist(), strict=True))


def functions(of, *names):
    """Real right-hand side, and the real named quantities `names`, as one function of numbers by
    name.
    """
    eq, rows = of.equations, real_states(of)
    states = [s.name for s, _, _ in rows]
    compute = compiled(*(d for _, d, _ in rows), *(eq.real(eq[name]) for name in names))

    def both(numbers):
        found = compute(numbers)
        return found[: len(states)], found[len(states) :]

    return states, both


def play(of, excitation, parameters, names=("P_motor", "Q_motor"), rtol=1e-11):
    """States and named quantities at the samples by DOP853 on the declared equations, restarted at
    each sample.

    Between samples the voltage is SciPy's makima, the speed a straight line.
    """
    states, compute = functions(of, *names)
    start = at_rest(of, excitation, parameters)
    fixed = known(of, excitation, parameters)
    t = np.arange(len(excitation.U)) * excitation.step
    voltage = Akima1DInterpolator(t, excitation.U, method="makima")
    speed = np.zeros(len(t)) if excitation.omega_s is None else excitation.omega_s

    def evaluate(at, x):
        inputs = {"U": float(voltage(at)), "omega_s": np.interp(at, t, speed)}
        return compute(fixed | inputs | dict(zip(states, x, strict=True)))

    x = np.array([start[s] for s in states])
    rows, quantities = [x], [evaluate(t[0], x)[1]]
    for a, b in itertools.pairwise(t):
        f = lambda at, x: evaluate(at, x)[0]  # noqa: E731
        x = solve_ivp(f, (a, b), x, method="DOP853", rtol=rtol, atol=1e-12).y[:, -1]
        rows.append(x)
        quantities.append(evaluate(b, x)[1])
    return np.array(rows).T, np.array(quantities).T


@pytest.mark.parametrize("motor", MOTORS)
def test_the_kernel_agrees_with_dop853(motor):
    of, excitation = model(motor, "none"), dip(start=0.05, duration=0.08, length=0.2, swing=2.0)
    response = of.simulate(Drive.from_events([excitation]), values(of), 16)
    _, (P, Q) = play(of, excitation, values(of))
    assert np.abs(response.P[0] - P).max() < 1e-8
    assert np.abs(response.Q[0] - Q).max() < 1e-8


@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize("speed", [0.0, -3.0])
def test_the_state_before_the_event_is_a_zero_of_the_right_hand_side(motor, speed):
    """Of derivatives where states move, and of the torque balance where the speed does not."""
    of = model(motor)
    excitation = Excitation(
        1e-3, np.ones(5), np.ones(5), np.ones(5), 0.97, 1.0, 0.6, np.full(5, speed), speed
    )
    rest = at_rest(of, excitation, values(of))
    numbers = known(of, excitation, values(of), U=0.97, omega_s=speed) | rest
    for balance in of.equations.real_balances():
        assert abs(number(balance, numbers)) < 1e-9
    torque = number(of.equations.real(of.equations["electrical_torque"]), numbers).real
    assert torque == pytest.approx(VALUES["T_m"], rel=1e-9)


@pytest.mark.parametrize("motor", MOTORS)
def test_input_power_is_losses_and_shaft_power_and_what_is_stored(motor):
    """P = T_e (1 + omega/omega_n) + losses + rate of stored energy, along a dip.

    A rotor circuit of inductance x and open time constant T carries the magnetizing current i =
    e/(jx), of which the rotor supplies i_r = i - I through its resistance x/(T omega_n). What is
    stored, x |i|^2/(2 omega_n), changes at the rate x Re(i' i*)/omega_n; without stator transients
    the stator does not see the voltage i' induces, and only the rotor's share of that rate, x Re(i'
    i_r*)/omega_n, is left. With stator transients the leakage also stores X' |I|^2/(2 omega_n).
    """
    of, excitation = model(motor, "none"), dip(length=0.4)
    p = dict(zip(of.names, values(of), strict=True))
    rows, (P, torque) = play(of, excitation, values(of), ("P_motor", "electrical_torque"))
    names, compute = functions(of)
    before = known(of, excitation, values(of), omega_s=0.0)
    slopes = [
        compute(before | {"U": u} | dict(zip(names, x, strict=True)))[0]
        for u, x in zip(excitation.U, rows.T, strict=True)
    ]
    state, slope = (
        dict(zip(names, rows, strict=True)),
        dict(zip(names, np.array(slopes).T, strict=True)),
    )
    phasor = lambda of, name: of[f"{name}_re"] + 1j * of[f"{name}_im"]  # noqa: E731

    leakage, x, T = p["X_prime"], p["X_prime"] * p["C"] / (1 - p["C"]), p["T_prime"] / (1 - p["C"])
    if motor == "mechanical":
        circuits = [(p["C"] * excitation.U / (1 - 1j * state["omega"] * p["T_prime"]), 0.0, x, T)]
    else:
        circuits = [(phasor(state, "E"), phasor(slope, "E"), x, T)]
    if motor in ("double_cage", "double_cage_stator_flux"):
        leakage, T = p["X_second"], p["T_second"] * p["X_prime"] / p["X_second"]
        circuits.append((phasor(state, "D"), phasor(slope, "D"), p["X_prime"] - leakage, T))
    E = sum(e for e, *_ in circuits)
    moves = motor in ("stator_flux", "double_cage_stator_flux")  # the stator's flux
    psi = phasor(state, "psi") if moves else excitation.U / 1j
    current = (psi + 1j * E) / leakage
    lost = p.get("R_s", 0.0) * np.abs(current) ** 2
    stored = 0.0
    for e, rate, x, T in circuits:
        rotor = e / (1j * x) - current
        lost = lost + x / (T * OMEGA) * np.abs(rotor) ** 2
        seen = e / (1j * x) if moves else rotor
        stored = stored + x * (rate / (1j * x) * np.conj(seen)).real / OMEGA
    if moves:
        rates = sum(rate for _, rate, *_ in circuits)
        change = (phasor(slope, "psi") + 1j * rates) / leakage
        stored = stored + leakage * (change * np.conj(current)).real / OMEGA
    assert np.abs(stored).max() > 1e-4 or motor == "mechanical"
    assert pytest.approx(torque * (1 + state["omega"] / OMEGA) + lost + stored, abs=1e-9) == P


@pytest.mark.parametrize("motor", ["mechanical", "electromechanical", "voltage", "stator_flux"])
def test_the_steady_state_is_the_equivalent_circuit(motor):
    """Slip, P and Q of a machine given by its T-circuit, by the circuit alone."""
    R_s = 0.03 if motor == "stator_flux" else 0.0
    machine, U, slip = Machine(R_s, 0.1, 3.0, 0.02, 0.12, 0.5), 0.98, 0.015
    rotor = machine.Rr / slip + 1j * machine.Xr
    impedance = R_s + 1j * machine.Xs + 1j * machine.Xm * rotor / (1j * machine.Xm + rotor)
    S = U**2 / np.conj(impedance)
    torque = S.real - R_s * abs(S / U) ** 2
    T_prime = machine.X_prime / machine.X * machine.T0_prime
    of = model(motor)
    C = (machine.X - machine.X_prime) / machine.X
    parameters = values(of, T_prime=T_prime, X_prime=machine.X_prime, C=C, T_m=torque, R_s=R_s)
    excitation = Excitation(1e-3, np.full(5, U), np.ones(5), np.ones(5), U, S.real, S.imag)
    rest = at_rest(of, excitation, parameters)
    numbers = known(of, excitation, parameters, U=U, omega_s=0.0) | rest
    eq = of.equations
    assert rest["omega"] == pytest.approx(-slip * OMEGA, rel=1e-9)
    assert number(eq.real(eq["P_motor"]), numbers).real == pytest.approx(S.real, rel=1e-9)
    assert number(eq.real(eq["Q_motor"]), numbers).real == pytest.approx(S.imag, rel=1e-9)


def gap(a, b, excitation, changed_a, changed_b, substeps=64):
    """Largest difference of P and Q between two motors on one event."""
    drive = Drive.from_events([excitation])
    left = model(a).simulate(drive, values(model(a), **changed_a), substeps)
    right = model(b).simulate(drive, values(model(b), **changed_b), substeps)
    assert left.miss[0, 0] == right.miss[0, 0] == 0
    return max(np.abs(left.P - right.P).max(), np.abs(left.Q - right.Q).max())


def test_third_order_with_a_fast_flux_becomes_first_order():
    """Flux ten times faster at the same mechanical time constant M/T': ten times closer."""
    fast = [dict(T_prime=0.02 / k, M=0.012 / k) for k in (1, 10, 100)]
    gaps = [gap("electromechanical", "mechanical", dip(edge=0.1), c, c, 128) for c in fast]
    assert gaps[0] > 0.01
    assert gaps[1] < 0.15 * gaps[0]
    assert gaps[2] < 0.015 * gaps[0]


def test_third_order_with_a_great_inertia_becomes_second_order():
    gaps = [gap("electromechanical", "voltage", dip(), {"M": M}, {}) for M in (0.6, 6.0, 60.0)]
    assert gaps[0] > 0.01
    assert gaps[1] < 0.15 * gaps[0]
    assert gaps[2] < 0.015 * gaps[0]


def test_double_cage_with_an_open_second_cage_is_third_order():
    assert (
        gap("double_cage", "electromechanical", dip(), {"X_second": VALUES["X_prime"]}, {}) < 1e-9
    )


def test_double_cage_whose_second_cage_fades_at_once_becomes_third_order():
    gaps = [
        gap("double_cage", "electromechanical", dip(), {"T_second": T}, {}, 256)
        for T in (1e-2, 1e-3, 1e-4)
    ]
    assert gaps[1] < 0.2 * gaps[0]
    assert gaps[2] < 0.02 * gaps[0]


def test_fifth_order_at_slow_inputs_becomes_third_order():
    """Without resistance the stator flux follows the voltage up to the offset an edge leaves, less
    the slower it is.
    """
    gaps = [
        gap(
            "stator_flux",
            "electromechanical",
            dip(length=4, duration=1, edge=e),
            {"R_s": 1e-9},
            {},
            8,
        )
        for e in (0.02, 0.2, 0.8)
    ]
    assert gaps[0] > 0.05
    assert gaps[1] < 0.2 * gaps[0]
    assert gaps[2] < 0.02 * gaps[0]


def test_seventh_order_with_an_open_second_cage_is_fifth_order():
    both = ({"X_second": VALUES["X_prime"]}, {})
    assert gap("double_cage_stator_flux", "stator_flux", dip(swing=2.0), *both) < 1e-7


def test_seventh_order_at_slow_inputs_becomes_a_double_cage():
    """Without resistance the stator flux follows the voltage up to the offset an edge leaves."""
    gaps = [
        gap(
            "double_cage_stator_flux",
            "double_cage",
            dip(length=4, duration=1, edge=e),
            {"R_s": 1e-9},
            {},
            8,
        )
        for e in (0.02, 0.8)
    ]
    assert gaps[0] > 0.05
    assert gaps[1] < 0.02 * gaps[0]


def test_fifth_order_without_inputs_to_excite_it_is_third_order_with_resistance():
    """The effect `stator_resistance` on the third order has the steady state of the fifth."""
    third = compose(
        get("model/motor", "electromechanical")(),
        get("model/static", "constant_impedance")(),
        [get("effect", "stator_resistance")()],
    )
    excitation = Excitation(1e-3, np.ones(5), np.ones(5), np.ones(5), 1.0, 1.0, 0.6)
    rests = [at_rest(of, excitation, values(of, R_s=0.05)) for of in (third, model("stator_flux"))]
    for name in ("E_re", "E_im", "omega"):
        assert rests[0][name] == pytest.approx(rests[1][name], rel=1e-8)


def test_an_oscillation_at_supply_frequency_follows_a_sudden_dip_in_the_fifth_order_only():
    excitation = dip(edge=1e-3, depth=0.2)
    spectra = {}
    for motor in ("electromechanical", "stator_flux"):
        of = model(motor, "none")
        Q = of.simulate(Drive.from_events([excitation]), values(of), 8).Q[0, 230:330]
        spectra[motor] = np.abs(np.fft.rfft((Q - Q.mean()) * np.hanning(100)))[3:10]  # 30 .. 90 Hz
    assert np.argmax(spectra["stator_flux"]) + 3 == 5  # 50 Hz
    assert spectra["stator_flux"].max() > 20 * spectra["electromechanical"].max()


def test_the_lists_above_are_all_there_is():
    assert set(discover()["model/motor"]) == {
        *MOTORS,
        "none",
        "motor_groups",
        "line_side_converter",
    }
    assert set(discover()["model/static"]) == set(STATICS)


@pytest.mark.parametrize(
    ("motor", "changed", "sentence"),
    [
        ("mechanical", {"T_m": 2.0}, "Eq. (3) needs |2 T_m X'/(C U0²)| at most 1 and it is 1.11"),
        ("voltage", {"C": 1.2}, "C = (X - X')/X must lie between 0 and 1 and is 1.2"),
        ("stator_flux", {"T_m": 3.0}, "the load torque T_m is 1.79 times the breakdown torque"),
        ("double_cage", {"X_second": 0.3}, "X'' must be at most X', of which it exceeds 0.05 pu"),
        ("double_cage", {"T_second": -0.01}, "T_second must be positive and is -0.01"),
    ],
)
def test_values_without_a_steady_state_get_a_sentence(motor, changed, sentence):
    of = model(motor)
    assert sentence in of.refusal(values(of, **changed), Drive.from_events([dip()]))
    assert of.errors(Drive.from_events([dip()]), values(of, **changed)).is_refused[0]


@pytest.mark.parametrize("seed", range(3))
def test_the_double_cage_finds_the_stable_slip_where_there_is_one(seed):
    """Against a scan of the impedance of both cages: torque over slip, its first
    crossing of T_m.
    """
    of = model("double_cage", "none")
    rng = np.random.default_rng(seed)
    low, high = np.array([p.bounds for p in of.parameters]).T
    rows = rng.uniform(low, high, (400, len(of.names)))
    p = dict(zip(of.names, rows.T[:, :, None], strict=True))
    slip = np.geomspace(1e-3, 3e4, 20000)[None, :]  # rad/s
    Z = 1j * p["X_second"] + 1j * p["X_prime"] * p["C"] / (1 - p["C"] + 1j * slip * p["T_prime"])
    second = p["T_second"] * p["X_prime"] / p["X_second"]
    Z = Z + 1j * (p["X_prime"] - p["X_second"]) / (1 + 1j * slip * second)
    S = 1 / np.conj(Z)
    first = np.argmax(S.real > p["T_m"], axis=1)
    carried = (S.real.max(axis=1) > 1.02 * p["T_m"][:, 0]) & (p["X_second"] < p["X_prime"])[:, 0]
    peak = np.argmax(np.diff(S.real) < 0, axis=1)
    # of the first cage; past it a motor crawls, and is not meant
    strongest = S.real[np.arange(len(rows)), peak]
    near = carried & (strongest > 1.02 * p["T_m"][:, 0])
    response = of.simulate(Drive.from_events([dip(length=0.01)]), rows, 64)
    found = response.miss[0] == 0
    assert near.sum() > 100
    # a shoulder of the torque curve may stop Newton's method: refused, not wrong
    assert found[near].mean() > 0.99
    near &= found
    assert not found[~carried & (S.real.max(axis=1) < 0.98 * p["T_m"][:, 0])].any()
    assert response.P[near, 0] == pytest.approx(rows[near, of.names.index("T_m")], abs=1e-9)
    assert response.Q[near, 0] == pytest.approx(S.imag[near, first[near]], rel=5e-3)
