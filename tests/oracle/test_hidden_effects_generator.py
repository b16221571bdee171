"""The generator of hidden effects judged: the base against the printed equations, each effect
against its physics.
"""

import ast
import json
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.signal import find_peaks

from hidden_effects import (
    CATALOG,
    EFFECTS,
    NUISANCES,
    OUTSIDE,
    PHYSICAL,
    Case,
    Noise,
    Recorder,
    cases,
    make,
    scene,
    sizes,
    truth,
    write,
)
from hidden_effects.controls import (
    CurrentControlled,
    DeadBand,
    Held,
    InputFilter,
    IntegralLink,
    Ramped,
    Rectifier,
    ResistiveInrush,
    SusceptanceControl,
    SynchronousMotor,
    Thermostat,
    TwoPaces,
    VoltageLink,
)
from hidden_effects.devices import Converter, Inrush, Link, Statcom
from hidden_effects.imperfections import FOREIGN, IMPERFECTIONS
from hidden_effects.laws import FAMILY, LAWS, MEMBERS_LAW
from hidden_effects.limits import (
    detection_limit,
    joint_limit,
    misfit,
    part_misfits,
    size_of_error,
)
from hidden_effects.motor import Motor
from hidden_effects.noise import autoregressive
from hidden_effects.recorder import weighed
from hidden_effects.site import Response
from hidden_effects.supply import Moment, Relay, Supply
from independent import Dip, Load, Machine, Static, simulate
from independent.source import OMEGA
from tractexp.configuration.plugin import discover

PACKAGE = Path(__file__).parent / "hidden_effects"
LOAD = Load(
    Machine(Rs=0.0, Xs=0.10, Xm=3.2, Rr=0.018, Xr=0.14, H=0.8),
    rating=0.6,
    torque=0.7,
    static=Static(P=0.45, Q=0.12, p_v=1.3, q_v=2.6),
)
DIP = Dip(depth=0.4, start=0.5, duration=0.25, sag=0.2, before=1.02, negative=0.1, swing=0.8)
LONG = Dip(depth=0.25, start=0.4, duration=0.9, fall=0.02, rise=0.03)
CLEAN = Noise(level=0.0)
# what the solver's tolerance, 1e-9 of a slip of 1e-2 in each of some hundred steps, leaves in P
SOLVED = 3e-7


def case(name: str | None = None, size: float = 1.0, dip: Dip = DIP, **settings) -> Case:
    return Case(name, size, (dip,), CLEAN, load=LOAD, spread=0.0, **settings)


def clean(
    name: str | None = None, size: float = 1.0, dip: Dip = DIP, **settings
) -> dict[str, np.ndarray]:
    return make(case(name, size, dip, **settings), 1)[0]


def response(name: str | None = None, size: float = 1.0, dip: Dip = DIP) -> Response:
    return scene(case(name, size, dip), 1).responses()[0]


def steady(U: float = 1.0, f: float = 1.0, U2: float = 0.0, rate: float = 0.0) -> Moment:
    return Moment(0.0, U, f, U2, rate, 0.0)


def bottom(record: dict[str, np.ndarray]) -> int:
    """The last sample before the voltage of LONG returns."""
    return int(np.searchsorted(record["t"], LONG.start + LONG.duration)) - 1


def test_the_package_imports_nothing_of_the_product():
    names = set()
    for file in PACKAGE.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names.update(alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                names.add((node.module or "").partition(".")[0])
    standard = {
        "bisect",
        "collections",
        "dataclasses",
        "functools",
        "itertools",
        "json",
        "math",
        "pathlib",
        "typing",
    }
    assert names == {"numpy", "scipy", "hidden_effects", "independent", "zlib"} | standard


def printed_equations(load: Load, dip: Dip, t: np.ndarray) -> np.ndarray:
    """P + jQ of Eqs. (1)-(7) as printed, in polar form, integrated by DOP853."""
    p, static = load.truth(), load.static

    def equation_1(now: float, state: np.ndarray) -> list[float]:
        E, delta, omega = state
        U, omega_s = float(dip.magnitude(now)), 2 * np.pi * float(dip.frequency(now))
        return [
            (-E + p["C"] * U * np.cos(delta)) / p["T_prime"],
            -p["C"] * U * np.sin(delta) / (p["T_prime"] * E) + omega - omega_s,
            (-U * E * np.sin(delta) / p["X_prime"] - p["T_m"]) / p["M"],
        ]

    U0 = dip.before
    delta = 0.5 * np.arcsin(-2 * p["T_m"] * p["X_prime"] / (p["C"] * U0**2))
    E = p["C"] * U0 * np.cos(delta)
    begin = [E, delta, OMEGA + p["C"] * U0 * np.sin(delta) / (p["T_prime"] * E)]
    E, delta, _ = solve_ivp(
        equation_1, (0.0, t[-1]), begin, "DOP853", t, rtol=1e-10, atol=1e-12, max_step=0.004
    ).y
    U = dip.magnitude(t)
    static_power = static.P * (U / U0) ** static.p_v + 1j * static.Q * (U / U0) ** static.q_v
    return static_power + (-U * E * np.sin(delta) + 1j * U * (U - E * np.cos(delta))) / p["X_prime"]


@pytest.mark.parametrize("recorder", [Recorder(), Recorder(100.0, 300)], ids=["500 Hz", "100 Hz"])
@pytest.mark.parametrize("dip", [DIP, LONG], ids=["swinging", "long"])
def test_without_an_effect_the_record_is_that_of_the_printed_equations(dip, recorder):
    record = clean(None, dip=dip, recorder=recorder)
    expected = printed_equations(LOAD, dip, record["t"])
    np.testing.assert_allclose(record["P"] + 1j * record["Q"], expected, rtol=0, atol=1e-6)
    np.testing.assert_allclose(record["U"], dip.magnitude(record["t"]), rtol=1e-14)


def test_the_scalar_supply_is_the_array_one():
    t = np.linspace(0.0, 2.0, 777)
    now = [Supply(DIP).at(x) for x in t]
    np.testing.assert_allclose([n.U for n in now], DIP.magnitude(t), rtol=1e-14)
    np.testing.assert_allclose([50 * n.f for n in now], DIP.frequency(t), rtol=1e-14)
    np.testing.assert_allclose([n.U2 for n in now], DIP.negative * DIP.shape(t), atol=1e-15)
    smooth = np.abs(t[:, None] - Supply(DIP).breaks).min(axis=1) > 1e-5
    slope = (DIP.magnitude(t + 1e-6) - DIP.magnitude(t - 1e-6)) / 2e-6
    np.testing.assert_allclose(np.array([n.rate for n in now])[smooth], slope[smooth], atol=1e-5)


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_of_size_zero_is_no_effect(name):
    base, record = clean(), clean(name, 0.0)
    for channel in ("U", "P", "Q"):
        np.testing.assert_allclose(
            record[channel], base[channel], rtol=0, atol=SOLVED, err_msg=channel
        )


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_of_size_one_shows_and_leaves_the_power_before_alone(name):
    base, record = clean(), clean(name)
    change = max(np.abs(record[channel] - base[channel]).max() for channel in ("P", "Q"))
    assert change > 1e-4
    for channel in ("P", "Q"):
        assert record[channel][0] == pytest.approx(base[channel][0], abs=1e-8), channel


@pytest.mark.parametrize("name", sorted({n for n, e in CATALOG.items() if e.needs}))
def test_effects_that_need_a_recorded_channel_draw_dips_that_have_it(name):
    record = make(Case(name), 3)[0]
    channel = {"swing": "f", "negative": "U2"}[CATALOG[name].needs]
    assert np.ptp(record[channel]) > 0
    assert channel not in make(Case(None), 3)[0]


def test_stator_resistance_takes_its_copper_loss_from_the_static_load():
    found = response("stator_resistance", 2.0)
    motor, static = found.parts[0], found.parts[-1]
    assert motor.machine.Rs == pytest.approx(0.04 * LOAD.rating)
    _, states = motor.settled(DIP.before + 0j)
    current = motor.flow(steady(DIP.before), DIP.before + 0j, states)[0]
    P0 = LOAD.torque * LOAD.rating + LOAD.static.P
    assert static.S.real == pytest.approx(
        P0 - LOAD.torque * LOAD.rating - 0.04 * abs(current) ** 2, rel=1e-10
    )


def test_a_fan_needs_the_square_of_the_speed():
    motor, states = Motor(LOAD.machine, 1.0, 0.7, fan=0.5).settled(1 + 0j)
    slower = [states[0], 0.9 * states[1]]
    constant = replace(motor, fan=0.0)
    swing = [m.flow(steady(), 1 + 0j, slower)[1][1] for m in (motor, constant)]
    assert swing[0] - swing[1] == pytest.approx(
        0.7 * 0.5 * (1 - 0.9**2) / (2 * LOAD.machine.H), rel=1e-12
    )


def test_the_saturated_air_gap_obeys_its_magnetizing_curve():
    motor, states = Motor(LOAD.machine, 1.0, 0.7, saturation=0.8).settled(1 + 0j)
    m = LOAD.machine
    for V in (1.0, 0.6, 1.15):
        gap, current = motor.circuit(V + 0j, states)
        magnetizing = current + (states[0] - gap) / m.Xr
        curve = gap / m.Xm * (1 + 0.8 * (abs(gap) ** 2 - motor.flux))
        assert magnetizing == pytest.approx(curve, abs=1e-11)


def test_a_second_group_like_the_first_is_no_second_group():
    made = scene(case("second_motor_group"), 1)
    twin = replace(
        made, effects=((("second_motor_group"), CATALOG["second_motor_group"](0.4, ratio=1.0)),)
    )
    np.testing.assert_allclose(twin.records()[0]["P"], clean()["P"], atol=1e-7)


def test_the_static_load_goes_with_powers_of_the_frequency():
    base, record = clean(), clean("frequency_dependence", 1.0)
    u, f = base["U"] / DIP.before, base["f"] / 50
    np.testing.assert_allclose(
        record["P"] - base["P"], LOAD.static.P * u**1.3 * (f**1.5 - 1), atol=1e-8
    )
    np.testing.assert_allclose(
        record["Q"] - base["Q"], LOAD.static.Q * u**2.6 * (f**-1.05 - 1), atol=1e-8
    )


def test_active_power_recovers_to_the_smaller_exponent():
    dip = replace(LONG, duration=40.0)
    recorder = Recorder(10.0, 400)
    base, record = (
        clean(None, dip=dip, recorder=recorder),
        clean("exponential_recovery", dip=dip, recorder=recorder),
    )
    recovered = LOAD.static.P * (0.75 ** (1.3 - 0.6) - 0.75**1.3)
    assert record["P"][-1] - base["P"][-1] == pytest.approx(recovered, abs=1e-7)


def test_the_relay_s_timers_open_and_close_when_they_should():
    dip = Dip(depth=0.4, start=0.5, duration=0.25, fall=0.02, rise=0.04)
    opened = Relay(level=0.8, reset=0.9, delay=0.05, wait=0.3, ramp=0.2).opened(dip, 2.0)
    falls = 0.5 + 0.02 / 2  # a raised cosine is at half its depth, 0.8, halfway
    rises = 0.75 + 0.04 * np.arccos(1 - 2 * 0.75) / np.pi  # three quarters of the depth are back
    np.testing.assert_allclose(
        opened.times, [falls + 0.05, falls + 0.0501, rises + 0.3, rises + 0.5], atol=2.5e-4
    )
    assert [opened(t) for t in (0.54, 0.7, 1.2, 1.9)] == pytest.approx(
        [0.0, 1.0, 0.49, 0.0], abs=0.2
    )
    assert Relay(0.8, 0.9, 0.3, 0.3, 0.2).opened(dip, 2.0)(0.8) == 0.0, (
        "the dip is shorter than the delay"
    )
    assert Relay(0.55, 0.9, 0.05, 0.3, 0.2).opened(dip, 2.0)(0.7) == 0.0, (
        "the dip is shallower than the level"
    )


def test_a_trip_takes_its_share_of_the_whole_load():
    base, record = clean(), clean("undervoltage_trip", 4.0)
    made = scene(case("undervoltage_trip", 4.0), 1).effects[0][1]
    left = record["P"] / base["P"]
    tripped = base["t"][np.isclose(left, 1 - made.amount, atol=1e-6)]
    assert len(tripped) > 10
    assert DIP.start + made.delay < tripped[0] < DIP.start + DIP.fall + made.delay + 0.004
    assert left[-1] == pytest.approx(1.0, abs=1e-7)
    np.testing.assert_allclose(record["Q"] / base["Q"], left, atol=1e-6)


@pytest.mark.parametrize(
    ("u", "limit", "power"), [(0.9, 1.3, 1.0), (0.7, 1.3, 0.91), (0.2, 1.3, 0.39 * (2 / 3) ** 2)]
)
def test_a_converter_keeps_its_power_up_to_its_current_limit(u, limit, power):
    converter, _ = Converter(0.5, limit=limit).settled(1.02 + 0j)
    V = 1.02 * u * np.exp(0.3j)
    current, rates = converter.flow(steady(1.02 * u), V, [u + 0j])
    assert V * current.conjugate() == pytest.approx(0.5 * power, rel=1e-12)
    assert rates[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("u", "power"), [(0.95, 1.0), (0.9, 1.0), (0.8, 0.55), (0.7, 0.1), (0.6, 0.1)]
)
def test_trains_take_less_where_the_line_voltage_is_low(u, power):
    converter, _ = Converter(1.0, full=0.9, empty=0.7, rest=0.1).settled(1 + 0j)
    assert converter.allowed(u) == pytest.approx(power, rel=1e-12)


def test_a_dc_link_restores_the_power_with_its_lag():
    device = Link.lagging(1.0, lag=0.05)

    def energy(t: float, x: np.ndarray) -> list[complex]:
        return device.flow(steady(0.8), 0.8 + 0j, x.tolist())[1]

    t = np.array([0.0, 0.05, 0.1])
    states = solve_ivp(energy, (0.0, 0.1), [0j], t_eval=t, rtol=1e-9, atol=1e-11).y
    powers = [0.8 * device.flow(steady(0.8), 0.8 + 0j, x.tolist())[0].real for x in states.T]
    # At first the current is the old one, then the power missing decays with 1/(k u).
    np.testing.assert_allclose(powers, 1 - 0.2 * np.exp(-0.8 * t / 0.05), rtol=1e-7)


def test_a_badly_damped_dc_link_rings_at_its_frequency():
    made = scene(case("low_frequency_oscillation", 3.0), 1).effects[0][1]
    device = Link.ringing(1.0, made.frequency, made.damping)
    matrix = np.array([[-device.k, -device.c], [1.0, 0.0]])  # W_0 - W and its integral, at U = U_0
    natural = 2 * np.pi * made.frequency
    roots = np.roots([1.0, 2 * made.damping * natural, natural**2])
    np.testing.assert_allclose(sorted(np.linalg.eigvals(matrix).imag), sorted(roots.imag))
    np.testing.assert_allclose(np.linalg.eigvals(matrix).real, roots.real)
    dip = Dip(depth=0.1, start=0.3, duration=0.1)
    ring = clean("low_frequency_oscillation", 3.0, dip)["P"] - clean(None, dip=dip)["P"]
    peaks, _ = find_peaks(ring[300:], prominence=1e-4)
    assert 500 / np.diff(peaks).mean() == pytest.approx(abs(roots.imag[0]) / (2 * np.pi), rel=0.02)


def test_the_feeder_obeys_kirchhoff():
    found = response("feeder_impedance", 3.0)
    t = np.array([0.3, 0.6, 0.74, 0.78, 1.2])
    Z = found.site.feeder
    for now, x in zip(t, found.states(t).T.tolist(), strict=True):
        bus, current, _ = found.network(now, x)
        behind = sum(
            part.flow(found.supply.at(now), bus - Z * current, x[own])[0]
            for part, own in zip(found.parts, found.slices, strict=True)
        )
        assert behind == pytest.approx(current, abs=1e-11)


def test_a_capacitor_gives_with_the_square_of_the_voltage_and_with_frequency():
    base, record = clean(), clean("shunt_capacitor")
    b, U = 0.3, base["U"]
    # the static load is larger by what the bank gave before
    taken_over = b * DIP.before**2 * (U / DIP.before) ** 2.6
    np.testing.assert_allclose(
        record["Q"] - base["Q"], taken_over - b * U**2 * base["f"] / 50, atol=1e-9
    )
    np.testing.assert_allclose(record["P"], base["P"], atol=1e-9)


def test_the_negative_sequence_brakes_by_the_power_that_crosses_the_air_gap():
    motor = Motor(replace(LOAD.machine, Rs=0.02), 1.0, 0.7, braking=1.0)
    power, torque = motor.negative(steady(U2=0.1), 0.97)
    m, slip = motor.machine, 1.97
    rotor = m.Rr / slip + 1j * m.Xr
    Z = m.Rs + 1j * m.Xs + 1 / (1 / (1j * m.Xm) + 1 / rotor)
    assert power == pytest.approx(0.01 / Z.conjugate(), rel=1e-12)
    assert torque == pytest.approx(power.real - m.Rs * abs(0.1 / Z) ** 2, rel=1e-12)


@pytest.mark.parametrize("offset", [0.3, 0.6, 1.5, 3.0])
def test_the_inrush_is_the_fundamental_of_the_core_s_current(offset):
    device = Inrush(b=0.4, depth=0.3)
    excess = lambda x: max(0.95 * np.cos(x) + offset - device.knee, 0.0)  # noqa: E731
    fundamental = quad(lambda x: excess(x) * np.cos(x), -np.pi, np.pi, limit=200)[0] / np.pi
    current, rates = device.flow(steady(0.95), 0.95 + 0j, [offset + 0j])
    assert current == pytest.approx(-1j * 0.4 * fundamental, abs=1e-8)
    assert rates[0] == pytest.approx(-offset / device.decay)


def test_there_is_no_inrush_before_the_voltage_returns():
    change = np.abs(clean("transformer_inrush")["Q"] - clean()["Q"])
    returns = np.searchsorted(clean()["t"], DIP.start + DIP.duration)
    assert change[: returns + 1].max() < SOLVED
    assert 0 < np.argmax(change) - returns < 0.06 * 500


@pytest.mark.parametrize(("depth", "given"), [(0.04, 0.4), (0.3, 1.0), (-0.05, -0.5)])
def test_a_compensator_gives_in_proportion_up_to_its_rating(depth, given):
    dip = replace(LONG, depth=depth)
    change = clean("static_var_compensator", dip=dip)["Q"] - clean(None, dip=dip)["Q"]
    assert change[bottom(clean(None, dip=dip))] == pytest.approx(
        -0.05 * given * (1 - depth), rel=1e-6
    )
    assert Statcom(0.05).settled(1 + 0j)[1] == [0j]


def test_a_skew_of_one_sample_shifts_power_by_one_sample():
    base, record = clean(), clean("time_skew")  # 2 ms at 500 Hz
    for channel in ("P", "Q"):
        np.testing.assert_allclose(record[channel][1:], base[channel][:-1], atol=1e-7)
    np.testing.assert_array_equal(record["U"], base["U"])


def test_a_window_is_the_mean_over_it():
    found, record = response(), clean("measurement_window", 2.0)
    for k in (200, 252, 255, 380, 500):
        t = record["t"][k] + np.linspace(-0.02, 0.02, 4001)
        V, current = found.at(t)
        assert record["P"][k] == pytest.approx(
            np.trapezoid((V * current.conj()).real, t) / 0.04, abs=1e-5
        )  # a grid of 1 ms


@pytest.mark.parametrize("frequency", [0.0, 3.0, 12.5, 25.0, 40.0])
def test_a_measurement_unit_passes_what_its_class_passes(frequency):
    """The triangle's gain is the square of a box's; the M class stops what is above half the
    reporting rate.
    """
    fine, t = np.arange(-0.2, 1.2, 0.001), np.linspace(0.0, 1.0, 41)
    turning = lambda at: np.exp(2j * np.pi * frequency * at)  # noqa: E731
    gains = {pmu: weighed(fine, turning(fine), t, pmu) / turning(t) for pmu in ("P", "M")}
    np.testing.assert_allclose(gains["P"], np.sinc(0.02 * frequency) ** 2, atol=2e-3)
    expected = {0.0: (1.0, 1e-6), 3.0: (1.0, 0.05)}.get(
        frequency, (0.0, 0.1) if frequency >= 25 else (0.7, 0.3)
    )
    np.testing.assert_allclose(gains["M"], expected[0], atol=expected[1])


def test_a_linear_load_does_not_show_that_both_channels_are_averaged_alike():
    impedance = Load(LOAD.machine, 1e-9, 0.0, Static(0.8, 0.3, 2.0, 2.0))
    dip = replace(DIP, swing=0.0)
    one = make(Case("phasor_window", 2.0, (dip,), CLEAN, load=impedance, spread=0.0), 1)[0]
    plain = make(Case(None, 1.0, (dip,), CLEAN, load=impedance, spread=0.0), 1)[0]
    assert np.abs(one["U"] - plain["U"]).max() > 0.01
    np.testing.assert_allclose(one["P"], 0.8 * (one["U"] / DIP.before) ** 2, atol=1e-7)


def test_a_drifting_load_grows_by_what_it_says():
    flat = Dip(depth=0.0, start=0.5, duration=0.1)
    record = clean("load_change", dip=flat)
    for channel in ("P", "Q"):
        grown = record[channel][0] * (1 + 0.01 * record["t"])
        np.testing.assert_allclose(record[channel], grown, atol=SOLVED)


def test_stator_transients_are_those_of_the_waveform_simulator():
    """The same machine in two frames and by two programs: waveforms at the bus, and
    phasors here.
    """
    machine = replace(LOAD.machine, Rs=0.03)
    whole = Motor(machine, 0.6, 0.7, stator=True)
    dip = replace(DIP, negative=0.0, swing=0.0)
    site = replace(response(dip=dip).site, motors=(whole,))
    t = np.linspace(0.4, 1.2, 801)
    V, current = site.response().at(t)
    waves = simulate(
        Load(machine, 0.6, 0.7, Static(0.0, 0.0, 1.0, 1.0)), dip, np.concatenate([[0.0], t])
    )
    motor = waves.current[1:] * np.exp(-1j * OMEGA * t)
    u, S = np.abs(V) / dip.before, site.S - dip.before * waves.current[0].conjugate()
    static = ((S.real * u**1.3 + 1j * S.imag * u**2.6) / V).conj()
    np.testing.assert_allclose(current, motor + static, atol=1e-5)
    assert np.abs(current - response(dip=dip).at(t)[1]).max() > 0.01


def test_the_outer_cage_carries_its_share_of_the_torque_at_rest():
    motor, states = Motor(LOAD.machine, 1.0, 0.7, cage=0.5).settled(1 + 0j)
    current, rates = motor.flow(steady(), 1 + 0j, states)
    np.testing.assert_allclose(np.abs(rates), 0.0, atol=1e-8)
    m, slip = LOAD.machine, 1 - states[1]
    cages = 1 / (m.Rr / slip + 1j * m.Xr) + 0.5 / (6 * m.Rr / slip + 1j * m.Xr)
    assert current == pytest.approx(1 / (1j * m.Xs + 1 / (1 / (1j * m.Xm) + cages)), rel=1e-8)


def rates_of(device, x: list[float], u: float = 1.0) -> np.ndarray:
    """Rates of a device's states at a voltage u over that before."""
    return np.array(device.flow(steady(u), u + 0j, [complex(v) for v in x])[1]).real


def modes(device, x: list[float]) -> np.ndarray:
    """Eigenvalues of a device about states at rest."""
    h = 1e-6 * np.eye(len(x))
    return np.linalg.eigvals(
        np.stack([(rates_of(device, x + d) - rates_of(device, x - d)) / 2e-6 for d in h], axis=1)
    )


def at_rest(device, u: float, x: list[float]) -> tuple[complex, np.ndarray]:
    """Power over that before, and states, in the steady state at u, found from x."""
    found = solve_ivp(
        lambda t, x: rates_of(device, x, u), (0, 60), x, "LSODA", rtol=1e-10, atol=1e-12
    ).y[:, -1]
    return u * device.flow(steady(u), u + 0j, found.astype(complex).tolist())[
        0
    ].conjugate() / device.power, found


@pytest.mark.parametrize(
    "device", [InputFilter(1.0, frequency=3.0, damping=0.08), SynchronousMotor(1.0, frequency=3.0)]
)
def test_what_rings_does_so_at_its_frequency_and_with_its_damping(device):
    rest = [v.real for v in device.rest()]
    np.testing.assert_allclose(rates_of(device, rest), 0.0, atol=1e-12)
    # Behind the filter's resistance the drive's negative one takes from w^2.
    stiff = 1 - device.resistance if isinstance(device, InputFilter) else 1.0
    natural = 6 * np.pi
    assert np.prod(modes(device, rest)).real == pytest.approx(natural**2 * stiff, rel=1e-5)
    assert -np.sum(modes(device, rest)).real / 2 == pytest.approx(0.08 * natural, rel=1e-5)


@pytest.mark.parametrize(
    ("device", "u", "power"),
    [
        (CurrentControlled(0.3, limit=1.3), 0.9, 1.0),
        (CurrentControlled(0.3, limit=1.3), 0.5, 0.65),
        (VoltageLink(0.3, gain=1.2), 0.9, 1.0),
        (IntegralLink(0.3), 0.9, 1.0),
        (Ramped(0.3), 0.95, 0.95),
        (Ramped(0.3), 0.65, 0.325),
        (Thermostat(0.3), 0.9, 1.0),
        (Thermostat(0.3), 0.5, 1.5 * 0.25),
    ],
)
def test_controls_end_where_they_aim(device, u, power):
    assert at_rest(device, u, [v.real for v in device.rest()])[0] == pytest.approx(power, rel=1e-6)


def test_an_integral_control_brings_the_link_back_to_its_voltage_at_its_frequency():
    """Linearised in a small dip: v'' + 2 zeta w v' + w^2 v, a constant current taking from the
    damping.
    """
    device = IntegralLink(0.3, frequency=4.0, damping=0.7)
    _, (v, z) = at_rest(device, 0.95, [1.0, 0.0])
    assert (v, 1 + z) == pytest.approx((1.0, 1 / 0.95), rel=1e-6)
    assert np.prod(modes(device, [1.0, 0.0])).real == pytest.approx((8 * np.pi) ** 2, rel=1e-4)
    assert -np.sum(modes(device, [1.0, 0.0])).real == pytest.approx(2 * 0.7 * 8 * np.pi, rel=1e-4)


def test_power_that_was_given_up_is_held_until_the_line_is_back():
    device = Held(0.3, rate=2.0)
    power, (m,) = at_rest(device, 0.75, [1.0])
    assert (power, m) == (pytest.approx(0.5, rel=1e-6), pytest.approx(0.5, rel=1e-6))
    assert rates_of(device, [0.5], 0.91) == [0.0]  # above the curve, below what counts as back
    assert rates_of(device, [0.5], 0.95) == [2.0]
    assert rates_of(device, [1.0], 0.95) == [0.0]


def test_a_link_s_voltage_gives_what_the_current_needs():
    _, (v,) = at_rest(VoltageLink(0.3, gain=1.2), 0.9, [1.0])
    assert 1 + 1.2 * (1 - v) == pytest.approx(1 / 0.9, rel=1e-6)


@pytest.mark.parametrize(("u", "current"), [(1.0, 1.0), (0.9, None), (0.5, 1.4)])
def test_a_rectifier_holds_dc_power_and_pays_for_commutation(u, current):
    device, k = Rectifier(0.88, overlap=0.12), 0.12
    S = u * device.flow(steady(u), u + 0j, [])[0].conjugate()
    i = abs(S) / u
    assert S.real / abs(S) == pytest.approx(1 - k * i / u, rel=1e-9)
    if current is None:
        assert S.real == pytest.approx(0.88, rel=1e-9)
    else:
        assert i == pytest.approx(current, rel=1e-9)


@pytest.mark.parametrize(("u", "b"), [(0.98, 0.4), (0.8, 1.0), (1.2, -1.0)])
def test_an_integrating_compensator_ends_on_its_droop_or_at_its_rating(u, b):
    device = SusceptanceControl(0.2, droop=0.05)
    solved = solve_ivp(lambda t, x: rates_of(device, x, u), (0, 5), [1.0, 0.0], max_step=1e-3).y[
        :, -1
    ]
    current = device.flow(steady(u), u + 0j, solved.astype(complex).tolist())[0]
    assert current == pytest.approx(1j * 0.2 * b * u, rel=1e-4)


def test_froelich_s_curve_is_bounded_flux():
    motor, states = Motor(LOAD.machine, 1.0, 0.7, saturation=0.6, ceiling=True).settled(1 + 0j)
    m, before = LOAD.machine, motor.flux**0.5
    a = before / 0.6
    b = before / m.Xm * (a - before) / before  # so that the flux before needs psi/Xm
    for V in (1.0, 0.6):
        gap, current = motor.circuit(V + 0j, states)
        magnetizing = current + (states[0] - gap) / m.Xr
        assert a * abs(magnetizing) / (b + abs(magnetizing)) == pytest.approx(abs(gap), rel=1e-9)


@pytest.mark.parametrize(
    ("power", "head", "w", "driven"),
    [
        (1.0, 0.0, 0.9, 0.9),
        (2.0, 0.8, 1.0, 1.0),
        (2.0, 0.8, 0.7, 0.0),
        (2.0, 0.6, 0.8, 0.28 / 0.64),
    ],
)
def test_what_is_driven_follows_its_own_curve(power, head, w, driven):
    assert Motor(LOAD.machine, 1.0, 0.7, fan_power=power, head=head).driven(w) == pytest.approx(
        driven
    )


def test_a_transformer_whose_ratio_steps_neither_gives_nor_takes_power():
    made = response("tap_changer_step", 8.0)
    t = max(made.site.tap.times)
    for now in (t - 0.05, t + 0.05):
        x = made.states(np.array([now])).T.tolist()[0]
        bus, current, _ = made.network(now, x)
        behind = bus * made.site.tap(now)
        drawn = made._parts(made.supply.at(now), behind, x)[0]
        assert bus * np.conj(current) == pytest.approx(behind * np.conj(drawn), rel=1e-12)
    assert abs(behind) > 1.05 * abs(bus)


def test_a_tap_changer_restores_its_voltage_to_a_step():
    made = scene(case("tap_recovery", 1.0, LONG), 1)
    device = made.site(0).devices[-1]
    lowest = (1 - LONG.depth) * (1 + max(device.profile.values))
    assert lowest <= 1 - LONG.depth + 0.15
    assert max(device.profile.values) >= 0.1, "six steps of 0.02 and more fit into 0.9 s"
    assert abs(device.profile(LONG.start)) == 0.0


@pytest.mark.parametrize("name", ["staged_power_limit", "switched_capacitors"])
def test_stages_act_one_by_one_and_return(name):
    dip = replace(LONG, depth=0.25, duration=0.6)
    profile = scene(case(name, 1.0, dip), 1).site(0).devices[-1].profile
    assert profile(dip.start + 0.3) == pytest.approx(2 / 3), (
        "levels 0.9 and 0.8 are passed, 0.7 is not"
    )
    assert profile(1.9) == pytest.approx(0.0)


def test_a_resistance_ends_an_inrush_sooner():
    both = Inrush(0.4, 0.3), ResistiveInrush(0.4, 0.3)
    plain, braked = (device.flow(steady(), 1 + 0j, [0.7 + 0j]) for device in both)
    assert plain[0] == braked[0]
    excess = lambda x: max(np.cos(x) + 0.7 - 1.15, 0.0)  # noqa: E731
    mean = quad(excess, -np.pi, np.pi, limit=200)[0] / (2 * np.pi)
    assert plain[1][0] - braked[1][0] == pytest.approx(20 * mean, rel=1e-6)


def test_a_load_of_two_paces_is_of_constant_current_in_the_end():
    device = TwoPaces(0.4)
    current, rates = device.flow(steady(), 0.5 + 0j, [0j, 0j])
    assert current == pytest.approx(0.4 * 0.5**2 / 0.5)  # at once it is an impedance
    assert rates[0] / rates[1] == pytest.approx(10.0)  # ten times as soon
    ended = [(0.5 - 0.25) / 2 + 0j] * 2
    current, rates = device.flow(steady(), 0.5 + 0j, ended)
    assert current == pytest.approx(0.4)
    assert rates == [0, 0]


def test_a_compensator_with_a_dead_band_sleeps_in_it_and_moves_no_faster_than_its_rate():
    device = DeadBand(0.2, band=0.08, gain=5.0, rate=10.0)
    assert device.flow(steady(), 0.95 + 0j, [0j]) == (0, [0])
    _, (fast,) = device.flow(steady(), 0.6 + 0j, [0j])
    assert fast == 10.0
    current, (rest,) = device.flow(steady(), 0.88 + 0j, [0.2 + 0j])
    assert rest == pytest.approx(0.0, abs=1e-12)  # 5 x 0.04 of its rating
    assert current == pytest.approx(0.04j)
    _, (back,) = device.flow(steady(), 1.2 + 0j, [0j])
    assert back < 0


def test_every_effect_but_circuits_and_definitions_has_two_laws_of_others():
    one = {
        "stator_resistance",
        "feeder_impedance",
        "shunt_capacitor",
        "negative_sequence_braking",
        "second_motor_group",
        "time_skew",
        "measurement_window",
        "frequency_dependence",
    }
    assert FAMILY.keys() == LAWS.keys()
    assert MEMBERS_LAW.keys() < FAMILY.keys()
    others = [family for hidden, family in FAMILY.items() if hidden not in MEMBERS_LAW]
    counts = {name: others.count(name) for name in CATALOG}
    assert {name for name, count in counts.items() if count < 2} == one


def test_what_is_said_to_be_a_members_law_is_of_its_family():
    known = discover()["effect"]
    assert {hidden: known[member].family for hidden, member in MEMBERS_LAW.items()} == {
        hidden: FAMILY[hidden] for hidden in MEMBERS_LAW
    }


def test_loads_that_step_do_so_once_and_stay():
    made = scene(case("load_step"), 1).effects[0][1]
    base, record = clean(), clean("load_step")
    change, at = record["P"] - base["P"], DIP.start + DIP.duration + made.delay
    assert np.abs(change[base["t"] <= at]).max() < SOLVED
    later = base["t"] > at + 1e-3
    expected = 0.02 * base["P"][0] * (base["U"][later] / DIP.before) ** 2
    np.testing.assert_allclose(change[later], expected, atol=1e-9)


def test_an_angle_that_jumps_does_not_touch_a_static_load():
    only = Load(LOAD.machine, 1e-9, 0.0, Static(0.8, 0.3, 1.5, 2.5))
    records = [
        make(Case(name, 4.0, (DIP,), CLEAN, load=only, spread=0.0), 1)[0]
        for name in (None, "phase_jump")
    ]
    np.testing.assert_allclose(records[1]["P"], records[0]["P"], atol=1e-8)
    assert np.abs(clean("phase_jump")["P"] - clean()["P"]).max() > 0.01


def test_a_current_transformer_is_exact_below_the_current_before():
    base, record = clean(), clean("current_transformer_saturation")
    current = np.hypot(base["P"], base["Q"]) / base["U"]
    low, high = current < current[0] * (1 - 1e-6), current > 1.2 * current[0]
    np.testing.assert_allclose(record["P"][low], base["P"][low], atol=1e-9)
    assert (np.hypot(record["P"], record["Q"])[high] < np.hypot(base["P"], base["Q"])[high]).all()


def test_a_drifting_ratio_scales_voltage_and_power_alike():
    base, record = clean(), clean("voltage_gain_drift")
    for channel in ("U", "P", "Q"):
        np.testing.assert_allclose(
            record[channel], base[channel] * (1 + 0.01 * base["t"]), rtol=1e-12
        )


def test_one_seed_gives_one_data_set_and_sizes_share_everything_else():
    first, again, other = (make(Case("dc_link_lag", events=2), seed) for seed in (5, 5, 6))
    for a, b, c in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(a["P"], b["P"])
        assert not np.array_equal(a["P"], c["P"])
    small, large = (scene(Case("dc_link_lag", size, events=2), 5) for size in (0.5, 2.0))
    assert small.load == large.load
    assert small.dips == large.dips
    assert small.effects[0][1].lag == large.effects[0][1].lag
    noise = [
        make(Case("dc_link_lag", s, 2), 5)[1]["P"]
        - make(Case("dc_link_lag", s, 2, CLEAN), 5)[1]["P"]
        for s in (1, 2)
    ]
    np.testing.assert_allclose(noise[0], noise[1], atol=1e-12)


def test_drawn_data_sets_are_as_wide_as_promised():
    made = [scene(Case(None, events=3), seed) for seed in range(12)]
    dips = [dip for one in made for dip in one.dips]
    assert min(d.depth for d in dips) < 0.1
    assert max(d.depth for d in dips) > 0.5
    for dip in dips:
        assert 0.05 <= dip.depth <= 0.6
        assert dip.start >= 0.3
        assert 0.06 <= dip.duration - dip.fall <= 0.6
    for one in made:
        assert sorted(
            int(d.depth > 0.05 + 0.55 / 3) + int(d.depth > 0.05 + 1.1 / 3) for d in one.dips
        ) == [0, 1, 2]
        assert 0 < one.load.truth()["C"] < 1


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.8, 0.95])
def test_noise_has_the_stated_spread_and_color(phi):
    n = 200_000
    clean_record = {
        "t": np.arange(n) / 500,
        "U": np.ones(n),
        "P": np.full(n, 0.8),
        "Q": np.full(n, 0.3),
    }
    noisy = Noise(level=0.01, phi=phi, voltage=0.003).add(clean_record, np.random.default_rng(0))
    for channel, expected in (("P", 0.008), ("Q", 0.008), ("U", 0.003)):
        y = noisy[channel] - clean_record[channel]
        colored = phi if channel != "U" else 0.0
        # The deviation of a variance and of a correlation estimated from n values, correlated by
        # phi: five of each.
        spread = np.sqrt(2 / n * (1 + colored**2) / (1 - colored**2))
        assert y.var() == pytest.approx(expected**2, rel=5 * spread)
        for lag in (1, 3):
            assert (y[lag:] * y[:-lag]).mean() / y.var() == pytest.approx(
                colored**lag, abs=5 * spread
            )
    assert abs(np.corrcoef(noisy["P"], noisy["Q"])[0, 1]) < 5 * np.sqrt(
        (1 + phi**2) / (1 - phi**2) / n
    )


def test_heavy_tails_keep_the_variance_and_show_outliers():
    y = Noise(tails=4.0).white(400_000, np.random.default_rng(1))
    assert y.var() == pytest.approx(1.0, rel=0.05)
    assert np.mean(np.abs(y) > 4) > 20 * 6.3e-5  # a Gaussian has 6.3e-5 beyond four


def test_the_wander_of_a_load_is_slow_and_as_large_as_stated():
    step, n = 0.01, 400_000
    y = autoregressive(np.random.default_rng(2).standard_normal(n), np.exp(-step / 0.5))
    assert y.var() == pytest.approx(1.0, rel=0.1)
    assert (y[50:] * y[:-50]).mean() == pytest.approx(np.exp(-1), abs=0.06)
    record = {"t": np.arange(n) * step, "U": np.ones(n), "P": np.full(n, 0.8), "Q": np.full(n, 0.3)}
    noisy = Noise(level=0.0, wander=0.02, wander_time=0.5).add(record, np.random.default_rng(2))
    np.testing.assert_allclose(noisy["P"] / 0.8, noisy["Q"] / 0.3, rtol=1e-12)
    assert noisy["P"].std() == pytest.approx(0.8 * 0.02, rel=0.05)


def test_a_quantized_record_has_steps():
    P = make(replace(case(), noise=Noise(level=0.01, quantum=0.005)), 1)[0]["P"]
    step = 0.005 * clean()["P"][0]
    np.testing.assert_allclose(P / step, np.round(P / step), atol=1e-8)
    assert len(np.unique(P)) > 20


def test_voltage_noise_is_in_the_record_and_not_in_the_load():
    record = make(replace(case(), noise=Noise(level=0.0, voltage=0.005)), 1)[0]
    np.testing.assert_array_equal(record["P"], clean()["P"])
    assert np.std(record["U"] - clean()["U"]) == pytest.approx(0.005 * DIP.before, rel=0.1)


def test_files_hold_the_records_and_the_truth_stands_beside_them(tmp_path):
    made = Case(("dc_link_lag", "load_step"), (1.0, 2.0), events=2, nuisances=(("time_skew", 0.5),))
    paths = write(made, 4, tmp_path)
    assert [p.name for p in paths] == ["event1.csv", "event2.csv"]
    table = np.genfromtxt(paths[1], delimiter=",", names=True)
    assert table.dtype.names == ("t", "U", "P", "Q")
    np.testing.assert_allclose(table["P"], make(made, 4)[1]["P"], rtol=1e-8)
    told = json.loads((tmp_path / "truth.json").read_text())
    assert [e["name"] for e in told["effects"]] == ["dc_link_lag", "load_step"]
    assert told["effects"][1]["amount"] == pytest.approx(0.04)
    assert told["nuisances"][0] == {"name": "time_skew", "amount": 0.001, "unit": "s"}
    assert set(told["load"]) == {"T_prime", "X_prime", "C", "M", "T_m", "p_v", "q_v"}


def test_the_truth_says_where_the_effect_is():
    told = truth(replace(case("load_step"), events=(DIP, LONG)), 1)["where"]
    delay = scene(case("load_step"), 1).effects[0][1].delay
    assert [(w["event"], w["channel"]) for w in told] == [(0, "P"), (0, "Q"), (1, "P"), (1, "Q")]
    assert told[0]["start"] == pytest.approx(DIP.start + DIP.duration + delay, abs=0.003)
    assert told[0]["end"] == pytest.approx(999 / 500)
    assert truth(case(None), 1)["where"] == []


def test_the_detection_limit_is_proportional_to_the_noise_and_rises_with_its_color():
    limits = {
        noise: detection_limit(replace(case("stator_resistance"), noise=noise), 1)
        for noise in (Noise(0.002), Noise(0.004), Noise(0.004, phi=0.8))
    }
    white, double, colored = limits.values()
    assert double == pytest.approx(2 * white, rel=0.02)
    assert colored != pytest.approx(double, rel=0.05)


@pytest.mark.long
def test_a_pair_s_joint_limit_is_where_no_single_effect_of_the_catalogue_could_take_it():
    """Two effects that nothing else resembles need what each needs alone; two that resemble each
    other need more.
    """
    apart, alike = (
        replace(case(), effect=names, size=(1.0, 1.0), noise=Noise(0.005))
        for names in (
            ("undervoltage_trip", "static_var_compensator"),
            ("stator_resistance", "feeder_impedance"),
        )
    )
    over = {}
    for pair in (apart, alike):
        alone = [detection_limit(replace(pair, effect=name, size=1.0), 1) for name in pair.effect]
        ratios = np.array(joint_limit(pair, 1)) / alone
        assert ratios[0] == pytest.approx(ratios[1], rel=1e-9)
        over[pair.effect] = ratios[0]
    assert 1 < over[apart.effect] < 1.05, (
        "the best single effect is one of the two and leaves the other whole"
    )
    assert over[alike.effect] > 1.3


def test_an_effect_is_measured_against_what_the_base_model_cannot_imitate():
    """Load drift alone, nothing else to imitate it: its limit is that of a straight line in white
    noise.
    """
    flat = Dip(depth=1e-6, start=0.5, duration=0.1)
    made = replace(case("load_change", dip=flat), noise=Noise(0.005))
    t, P0, Q0 = np.arange(1000) / 500, clean(None, dip=flat)["P"][0], clean(None, dip=flat)["Q"][0]
    # the level is free, per event
    line = 0.01 * np.linalg.norm(t - t.mean()) / 0.005 * np.hypot(1, Q0 / P0)
    z = 3.0048 + 1.2816  # one in 20 over 19 effects, two-sided, and nine in ten
    assert detection_limit(made, 1) == pytest.approx(z / line, rel=0.01)


def made_of(planned, count: int) -> list[cases.Trial]:
    return [one.make() for one in islice(planned, count)]


def test_salted_seeds_are_others_and_reproducible():
    plain, salted, again = (list(islice(cases.seeds("a label", salt), 5)) for salt in (None, 7, 7))
    assert salted == again
    assert not set(plain) & set(salted)
    assert not set(salted) & set(islice(cases.seeds("another label", 7), 5))


def test_the_suites_hide_what_they_say():
    planned = next(cases.single("undervoltage_trip", 2.0))
    trial = planned.make()
    assert (trial.label, trial.seed) == (planned.label, planned.seed)
    made = scene(trial.case, trial.seed)
    assert trial.case.effect == ("undervoltage_trip",)
    assert trial.case.size[0] == pytest.approx(
        2 * detection_limit(replace(trial.case, size=1.0), trial.seed)
    )
    assert made.effects[0][1].level > min(1 - d.depth / d.before for d in made.dips)
    assert trial.multiples == (pytest.approx(2.0),)
    capped = cases.at_limit(("constant_power_converter",), 1e6, 1, events=(DIP,), load=LOAD)
    assert capped.multiples[0] < 1e6
    assert capped.case.size[0] * 0.2 < LOAD.static.P / (LOAD.static.P + LOAD.torque * LOAD.rating)
    assert [t.case.noise.phi for t in made_of(cases.nulls("AR(1) 0.95"), 2)] == [0.95, 0.95]
    for trial in made_of(cases.nuisances(), 3):
        faults = dict(
            (name, size * NUISANCES[name].reference) for name, size in trial.case.nuisances
        )
        assert 0 <= faults["time_skew"] <= 0.003
        assert trial.case.effect is None


@pytest.mark.long
def test_an_imperfect_load_misses_what_is_asked_once_the_base_model_is_fitted():
    exact = Case(events=2)
    case = cases.imperfect(exact, 3, 0.01)
    assert {name for name, _ in case.imperfections} == IMPERFECTIONS.keys()
    assert misfit(case, 3) == pytest.approx(0.01, rel=0.02)
    assert misfit(exact, 3) == 0.0
    half = replace(case, imperfections=tuple((name, size / 2) for name, size in case.imperfections))
    assert misfit(half, 3) == pytest.approx(0.005, rel=0.2)
    assert cases.imperfect(exact, 3, 0.0) is exact
    named = replace(case, effect="shunt_capacitor")
    assert size_of_error(replace(named, imperfections=half.imperfections), 3) == pytest.approx(
        size_of_error(named, 3) / 2, rel=0.2
    )
    assert truth(named, 3)["imperfections"][0]["name"] == next(iter(IMPERFECTIONS))


def test_a_foreign_load_is_inexact_by_what_no_family_has():
    """Each part misses a share of the response alone, the only one as much as the whole."""
    case = cases.imperfect(Case(events=1), 3, 0.01, FOREIGN)
    assert misfit(case, 3) == pytest.approx(0.01, rel=0.05)
    parts = part_misfits(case, 3)
    assert tuple(parts) == FOREIGN
    assert not {*parts} & {*FAMILY, *CATALOG, *(IMPERFECTIONS.keys() - {"mixing_exponents"})}
    (largest,) = (one for one in case.imperfections if one[0] == max(parts, key=parts.__getitem__))
    alone = replace(case, imperfections=(largest,))
    assert part_misfits(alone, 3) == {largest[0]: misfit(alone, 3)}
    assert 0.0 < max(parts.values()) < 0.02


@pytest.mark.long
def test_data_sets_of_the_field_differ_in_recorder_noise_and_error():
    made = made_of(cases.in_the_field("shunt_capacitor", 4.0, events=1), 3)
    assert {t.case.effect for t in made} == {("shunt_capacitor",)}
    assert all(0 < t.multiples[0] <= 4.0 + 1e-9 for t in made)  # fewer where more makes no sense
    assert len({t.case.recorder for t in made}) > 1
    imperfect = [t.case for t in made if t.case.imperfections]
    assert 0 < len(imperfect) < len(made)
    (three,) = made_of(cases.several(3, 2.0, events=1), 1)
    assert len(three.case.effect) == 3


@pytest.mark.long
def test_a_loud_data_set_has_a_load_that_no_model_fits_to_twenty_times_its_noise():
    """The effect leaves four times as much as the load's own error, or as much as there is room
    for.
    """
    (made,) = made_of(cases.loud("feeder_impedance", 4.0, events=2), 1)
    alone = replace(made.case, effect=None, size=1.0)
    assert misfit(alone, made.seed) == pytest.approx(0.02, rel=0.2)
    assert made.case.noise.level == 0.001
    assert 1 < made.multiples[0] <= 4.0 + 1e-9


def test_names_are_those_of_the_contract():
    assert len(PHYSICAL) == 16
    assert len(CATALOG) == 19
    assert len(OUTSIDE) >= 8
    assert not CATALOG.keys() & OUTSIDE.keys()
    assert sizes()["stator_resistance"] == (0.02, "pu")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"effect": "dc_link"}, "no effect 'dc_link'"),
        ({"effect": ("dc_link_lag", "load_step"), "size": (1.0,)}, "give one size"),
        ({"effect": "dc_link_lag", "size": 100.0}, "beyond 0.9"),
        ({"effect": "constant_power_converter", "size": 4.0}, "must be positive"),
        ({"events": (Dip(depth=0.95, start=0.5, duration=2.0),)}, "shallower or shorter"),
    ],
)
def test_what_makes_no_sense_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        make(Case(**settings), 1)


@pytest.mark.parametrize(
    "settings", [{"phi": 1.0}, {"tails": 2.0}, {"level": -0.1}, {"voltage": float("nan")}]
)
def test_impossible_noise_is_refused(settings):
    with pytest.raises(ValueError, match="noise"):
        Noise(**settings)


def test_a_control_that_chatters_about_its_limit_ends_with_a_sentence(monkeypatch):
    """Such a simulation once went on for more than ten minutes, in steps of a nanosecond."""
    monkeypatch.setattr("hidden_effects.site.MOST", 200)
    with pytest.raises(
        ArithmeticError, match=r"the simulation chatters at t = \d\.\d+ s: 200 derivatives"
    ):
        make(Case("constant_power_converter", 2.0, events=1), 800001)
