"""Waveforms of known truth through the product: a short run of benchmarks/waves.py and
benchmarks/waves_hidden.py, and their noise by `estimate_wave_noise`.

The generator's equations, frame and solver are its own; it is judged first.
"""

from dataclasses import replace

import numpy as np
import pytest
import wave_records as waves
import waves as study
import waves_hidden

import tractexp
from independent import Machine
from independent.circuit import (
    Across,
    Arc,
    Branch,
    Breaker,
    Core,
    Earthed,
    Group,
    Held,
    Rectifier,
    Relay,
    Shunt,
    Switched,
    drawn,
)
from independent.fault import Fault, vector
from independent.sampler import CurrentTransformer, Sampler
from independent.source import OMEGA
from tractexp.noise.waves import compute_covariances, estimate_wave_noise, solve_levinson
from tractexp.record import convert_to_waves

MACHINE = Machine(Rs=0.03, Xs=0.10, Xm=3.2, Rr=0.018, Xr=0.18, H=0.7)
FAULT = Fault((0.2, 1.0, 0.9j), start=0.1, duration=0.06, frequency=50.1)
T = np.arange(0.0, 0.3, 2e-5)


# The generator


def test_a_branch_draws_what_its_impedance_says_and_forgets_the_fault():
    made = drawn((Branch(0.5, 1.5),), FAULT, T)
    before = T < 0.09
    speed = 1.002
    np.testing.assert_allclose(
        made.current[before], made.voltage[before] / (0.5 + 1.5j * speed), rtol=1e-6
    )
    left = np.abs(made.current - made.voltage / (0.5 + 1.5j * speed))
    assert left[(T > 0.1) & (T < 0.16)].max() > 0.1 > 1e-3 > left[T > 0.28].max()


def test_a_group_rests_before_a_fault_whatever_the_frequency():
    group = Group(MACHINE, 0.5, 0.7, fan=0.5, saturation=0.5)
    made = drawn((group,), FAULT, T)
    power = made.voltage * made.current.conj()
    before = power[T < 0.09]
    assert np.ptp(before.real) < 1e-6
    assert np.ptp(before.imag) < 1e-6
    assert before.real.mean() == pytest.approx(
        0.5 * 0.7 * 1.002 + 0.5 * 0.03 * np.abs(made.current[0] / 0.5) ** 2, 2e-4
    )


def test_energy_is_conserved_through_an_unbalanced_fault():
    """What enters is lost in resistances, done by the shaft, or stored."""
    from scipy.integrate import trapezoid

    made = drawn((Group(MACHINE, 1.0, 0.7), Branch(0.5, 1.5), Shunt(0.3)), FAULT, T)
    alone = [
        drawn((d,), FAULT, T).current
        for d in (Group(MACHINE, 1.0, 0.7), Branch(0.5, 1.5), Shunt(0.3))
    ]
    # of the solver, far below any noise
    np.testing.assert_allclose(sum(alone), made.current, atol=1e-4)
    branch = alone[1]
    entered = trapezoid((made.voltage * branch.conj()).real, T)
    stored = 1.5 * (np.abs(branch[-1]) ** 2 - np.abs(branch[0]) ** 2) / (2 * OMEGA)
    assert entered == pytest.approx(trapezoid(0.5 * np.abs(branch) ** 2, T) + stored, rel=1e-4)


def test_devices_that_may_be_hidden_do_what_they_are_named_for():
    capacitor = drawn((Shunt(B=0.3),), FAULT, T)
    before = T < 0.09
    np.testing.assert_allclose(
        capacitor.current[before], 0.3j * 1.002 * capacitor.voltage[before], rtol=1e-4
    )
    core = drawn((Core(1.15, 0.5, 0.02),), FAULT, T)
    assert np.abs(core.current[before]).max() == 0.0 < np.abs(core.current[T > 0.17]).max()
    star = replace(FAULT, delta=False)
    earthed = drawn((Earthed(0.2, 1.0),), star, T)
    assert np.abs(earthed.current).max() == 0.0 < 0.05 < np.abs(earthed.current_zero).max()
    # a delta keeps it out
    assert np.abs(drawn((Earthed(0.2, 1.0),), FAULT, T).current_zero).max() < 1e-9
    relay = Relay(0.05, 0.04, 0.01)  # from 50 ms after the fault's start to 40 ms after its end
    tripped = drawn((Switched(Shunt(0.4), 1.0, relay),), FAULT, T)
    assert np.abs(tripped.current[(T > 0.151) & (FAULT.end + 0.04 > T)]).max() == 0.0
    assert np.abs(tripped.current[-1]) == pytest.approx(0.4, abs=1e-2)


def test_what_may_be_hidden_in_one_phase_or_in_the_fault_alone_is_there():
    before, late = T < 0.09, T > 0.25
    across = drawn((Across(0.3, 0.8),), FAULT, T)
    b, c = ((across.current * np.exp(-2j * np.pi / 3 * k)).real for k in (1, 2))
    np.testing.assert_allclose(b, -c, atol=1e-12)
    np.testing.assert_allclose(across.current.real, 0.0, atol=1e-12)
    power = (across.voltage * across.current.conj()).real[before]
    assert power.mean() == pytest.approx(
        2 / 3 * 3 / 2 * 0.3 / (0.3**2 + (0.8 * 1.002) ** 2), rel=2e-2
    )

    held = drawn((Held(0.3 + 0.1j),), FAULT, T)
    power = held.voltage * held.current.conj()
    for part in (before, late):
        np.testing.assert_allclose(power[part], 0.3 + 0.1j, atol=5e-3)

    arc = drawn((Arc(0.5),), FAULT, T)
    assert np.abs(arc.current[before | late]).max() == 0.0
    there = (FAULT.start < T) & (FAULT.end > T)
    np.testing.assert_allclose(arc.current[there], 0.5 * arc.voltage[there])

    rectifier = drawn((Rectifier(0.06j, 0.03),), FAULT, T)
    assert np.abs(rectifier.current).max() == pytest.approx(0.09, rel=1e-3)
    # s: fifth and seventh, of either sequence, are the same again after it but for the frame
    sixth = 0.02 / 6 / 1.002
    shift = round(6 * sixth / 2e-5)
    np.testing.assert_allclose(rectifier.current[shift:], rectifier.current[:-shift], atol=1e-3)

    pole = Breaker((0.0, 1.0, 0.0), Relay(0.05))
    whole, open_ = (drawn((Shunt(0.4), *more), FAULT, T) for more in ((), (pole,)))
    phases = [
        (made.current * np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]).real + made.current_zero
        for made in (whole, open_)
    ]
    assert np.abs(phases[1][1, T > 0.151]).max() < 1e-12 < np.abs(phases[0][1, T > 0.151]).max()
    np.testing.assert_allclose(phases[1][[0, 2]], phases[0][[0, 2]], atol=1e-12)


def test_the_sampler_adds_what_it_says():
    t = Sampler(3200.0).instants(0.0, 0.25)
    made = drawn((Shunt(1.0),), FAULT, t)
    clean = Sampler(3200.0, cutoff=None).read(made, 0.0, np.random.default_rng(0))
    v, zero = vector(clean[:3])
    np.testing.assert_allclose(v, made.voltage[t >= -1e-9][::12], atol=1e-9)
    np.testing.assert_allclose(zero, 0.0, atol=1e-9)
    off = Sampler(3200.0, 1e-3, (0.0, 0.0, 0.0, 0.01, 0.0, 0.0), 14, cutoff=None)
    seen = off.read(made, 0.0, np.random.default_rng(0)) - clean
    assert seen[3].mean() == pytest.approx(0.01, abs=2e-4)
    assert seen[0].std() == pytest.approx(
        np.hypot(1e-3 / np.sqrt(2), 4 / 2**14 / np.sqrt(12)), rel=0.05
    )
    passed = CurrentTransformer(knee=0.5).passed(clean[3:], 1 / 3200)
    assert np.abs(passed - clean[3:]).max() > 0.3
    np.testing.assert_allclose(
        CurrentTransformer(knee=50.0).passed(clean[3:], 1 / 3200), clean[3:], atol=1e-12
    )


# The noise that the voltage's noise makes of currents


def test_levinson_gives_back_the_autoregression_of_its_covariances():
    a = 0.9 * np.exp(0.3j)
    lags = np.arange(30)
    made = solve_levinson(a**lags / (1 - abs(a) ** 2))
    assert made.order == 1
    assert made.coefficients[1, 0] == pytest.approx(a)
    assert made.deviation[1] == pytest.approx(1.0)


def test_noise_that_turns_one_way_is_whitened_and_its_parts_are_told_apart():
    rng = np.random.default_rng(1)
    answer = 0.3 * np.exp((-0.02 + 0.1j) * np.arange(400))
    shocks = rng.standard_normal((2, 6000))
    slow = np.convolve(shocks[0] + 1j * shocks[1], answer)[400:6000]
    own = 0.5 * rng.standard_normal((2, len(slow)))
    residuals = np.stack([slow.real + own[0], slow.imag + own[1], np.zeros(len(slow))])
    known = np.ones(residuals.shape, dtype=bool)
    known[2] = False
    noise = estimate_wave_noise(residuals, known, [slice(0, 5000)], (answer, np.zeros(400)), 3)
    white = noise.pairs[0][0].whiten(
        residuals[0] + 1j * residuals[1], np.ones(len(slow), dtype=bool)
    )
    assert np.std(white.real) == pytest.approx(1.0, abs=0.05)
    lagged = [
        abs(np.vdot(white[k:], white[:-k])) / np.vdot(white, white).real for k in range(1, 40)
    ]
    assert max(lagged) < 5 / np.sqrt(len(white))
    least = solve_levinson(
        np.r_[compute_covariances(answer, 48)[0] + 0.25, compute_covariances(answer, 48)[1:]]
    ).deviation[-1]
    assert noise.pairs[0][0].deviation[-1] == pytest.approx(least, rel=0.03)


# The product


@pytest.fixture(scope="module")
def row():
    case, events = waves.drawn_events([1, 3])
    return study.judged(study.identified(events[0]), case.site)


def test_parameters_lie_within_their_intervals_and_the_model_is_adequate(row):
    """How many of many loads do stands in benchmarks/waves.json."""
    assert all(row["inside"].values())
    assert row["grade"] == "adequate"
    assert row["p"] > 0.01
    assert max(abs(z) for z in row["z"].values()) < 3.5
    assert row["epsilon_i"] < 0.01
    assert abs(row["off"]["X_prime"]) < 0.02


@pytest.mark.long
def test_without_noise_little_but_interpolation_is_left():
    case, _ = waves.drawn_events([1, 3])
    still = replace(case, sampler=replace(case.sampler, noise=0.0, bits=None, offsets=(0.0,) * 6))
    row = study.judged(study.identified(waves.events(still, [1, 3])[0]), case.site)
    assert row["epsilon_i"] < 2e-4
    # What the voltage did between samples at its edges is left open, which costs the branch's ratio
    # most.
    limits = {"branch_resistance": 1e-2}
    assert {
        name: off for name, off in row["off"].items() if abs(off) > limits.get(name, 5e-3)
    } == {}


def test_what_is_recorded_reaches_the_event_through_the_product():
    """Frequency, voltage, offsets: what the product takes for the state before the event is the
    generator's.
    """
    case, events = waves.drawn_events([1, 2])
    event = convert_to_waves(events[0])
    fault = case.faults[0]
    assert event.f0 == pytest.approx(fault.frequency, abs=2e-3)
    assert pytest.approx(fault.voltage, rel=2e-4) == event.U0
    peak = waves.BASE_VOLTAGE * np.sqrt(2 / 3)
    one = np.repeat([peak, 2 * waves.BASE_POWER / (3 * peak)], 3)
    np.testing.assert_allclose(event.offsets / one, case.sampler.offsets, atol=3e-4)
    assert event.record.t[event.start] == pytest.approx(fault.start, abs=3 / case.sampler.rate)
    floor = np.hypot(1e-3 / np.sqrt(2), 4 / 2**case.sampler.bits / np.sqrt(12)) * np.sqrt(2 / 3)
    assert event.noise_U == pytest.approx(floor, rel=0.15)


@pytest.mark.long
def test_nothing_is_named_where_nothing_is_hidden():
    """That what is hidden is named stands in test_wave_discrepancy."""
    nothing = waves_hidden.HIDDEN[0]
    row = waves_hidden.run(nothing, [3, 0], only=["second_motor_group", "speed_dependent_torque"])
    assert "failed" not in row
    assert row["names"] == []


def test_a_record_made_here_is_read_from_comtrade_as_it_is(tmp_path):
    """Written by the product's own writer from a table of samples, read, fitted to the
    same values.
    """
    _, events = waves.drawn_events([1, 3])
    kept = events[0].record.waves
    t = kept.start + np.arange(kept.samples.shape[1]) / kept.rate
    table = tmp_path / "site.csv"
    head = "t [s],ua [kV],ub [kV],uc [kV],ia [kA],ib [kA],ic [kA]"
    np.savetxt(
        table, np.vstack([t, kept.samples]).T, delimiter=",", header=head, comments="", fmt="%.9g"
    )
    tractexp.convert(table, to="comtrade", folder=tmp_path)
    read = tractexp.read(tmp_path / "site.cfg")[0]
    np.testing.assert_allclose(
        read.record.waves.samples[:, 100:1000], kept.samples[:, 100:1000], rtol=1e-5, atol=1e-5
    )
