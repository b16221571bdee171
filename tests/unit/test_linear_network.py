"""The best linear network of few poles, `fit_black_boxes`: planted networks come back, and what is
no network is a sentence.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from tractexp.domain import PHASORS, WAVES
from tractexp.domain.port import Port
from tractexp.errors import UserError
from tractexp.identification.linear_network import CRITERION, choose_network, fit_black_boxes
from tractexp.identification.projection import Projection, compute_pole_response, compute_port_basis
from tractexp.record import Record, detect
from tractexp.record.synthetic import build_synthetic_event

RATE, F0 = 3200.0, 50.0
# a rotor's and a stator's, in the frame
POLES = np.array([-18 + 2j * np.pi * (47 - F0), -45 + 2j * np.pi * (3 - F0)])
SHARES, C = np.array([2.5 - 3.0j, -0.4 + 1.5j]), 2e-4 + 1e-4j
P0, Q0 = 0.9, 0.3


def choose(domain, event):
    """The network of an event, of as many poles as it asks for."""
    return choose_network(fit_black_boxes(domain, [event]), [event])


def voltage(start=640, samples=1600, depth=0.3, negative=0.1, duration=0.06):
    """A dip's space vector (N,) in the frame [pu]: the positive sequence with a jump of its angle,
    and the negative.
    """
    t = (np.arange(samples) - start) / RATE
    there = np.clip(t / 0.002, 0, 1) - np.clip((t - duration) / 0.002, 0, 1)
    return 1 - there * (depth * np.exp(0.3j) + negative * np.exp(-4j * np.pi * F0 * t))


def planted(v, poles, shares, step=1 / RATE):
    """What a network draws (N,) in the frame, by its definition: C du/dt and each pole's share of s
    / (s - p).
    """
    u = v - 1
    i = (P0 - 1j * Q0) * v + C * np.gradient(u, step)
    return i + sum(
        g * (u + p * compute_pole_response(u, p, step)) for g, p in zip(shares, poles, strict=True)
    )


def in_waves(v, i, start=640):
    """An event in waveforms of vectors (N,) in the frame."""
    t = np.arange(len(v)) / RATE
    made = build_synthetic_event("made", t, v, (1.0, P0, Q0), F0, start, start + 190)
    i = i * made.turn
    return replace(made, currents=np.stack([i.real, i.imag, np.full(len(t), np.nan)]))


def noise(n, size, seed=0):
    rng = np.random.default_rng(seed)
    return size * (rng.standard_normal(n) + 1j * rng.standard_normal(n))


def poles_of(box):
    return np.array([-p["decay"] + 2j * np.pi * (p["frequency"] - F0) for p in box.poles])


def in_phasors(u, power, rate=200.0, start=100):
    """An event of a voltage's deviation (N,) and of P + jQ's (N,) [pu], before which nothing
    happens.
    """
    t = np.arange(len(u)) / rate
    return detect(Record("made", t, 1 + u, P0 + power.real, Q0 + power.imag))


def power_dip(samples=500, start=100, depth=0.3, rate=200.0, duration=0.3):
    t = (np.arange(samples) - start) / rate
    return -depth * (np.clip(t / 0.02, 0, 1) - np.clip((t - duration) / 0.02, 0, 1))


@pytest.mark.parametrize("pole", [-30.0 + 0j, -18 + 280j, -900 - 40j])
def test_a_pole_responds_as_scipy_simulates_it(pole):
    """In real parts: x' = p x + u of a u that is a straight line between samples."""
    u = voltage() - 1
    a, b = pole.real, pole.imag
    system = signal.StateSpace([[a, -b], [b, a]], np.eye(2), np.eye(2), np.zeros((2, 2)))
    _, x, _ = signal.lsim(system, np.stack([u.real, u.imag], axis=1), np.arange(len(u)) / RATE)
    np.testing.assert_allclose(
        compute_pole_response(u, pole, 1 / RATE), x[:, 0] + 1j * x[:, 1], atol=1e-12
    )


def test_a_planted_network_comes_back_from_waves():
    v = voltage()
    boxes = fit_black_boxes(WAVES, [in_waves(v, planted(v, POLES, SHARES))], most=2)
    np.testing.assert_allclose(poles_of(boxes[2]), POLES, rtol=1e-6)
    np.testing.assert_allclose(
        sorted(boxes[2].networks[0].coefficients, key=abs), [C, *SHARES[::-1]], rtol=1e-5
    )


def test_what_noise_leaves_of_the_poles_is_what_their_covariance_says():
    """Four standard errors of the nonlinear least squares, by differences of the definition."""
    v, size = voltage(), 0.002
    i = planted(v, POLES, SHARES)
    boxes = fit_black_boxes(WAVES, [in_waves(v, i + noise(len(v), size))], most=2)

    def drawn(x):
        p, g = x[:2] + 1j * x[2:4], x[4:6] + 1j * x[6:8]
        moved = planted(v, p, g) + (x[8] + 1j * x[9]) * np.gradient(v, 1 / RATE)
        return np.concatenate([moved.real, moved.imag])

    truth = np.concatenate([POLES.real, POLES.imag, SHARES.real, SHARES.imag, [0.0, 0.0]])
    steps = np.diag(np.maximum(1e-5 * np.abs(truth), 1e-7))
    J = np.stack([(drawn(truth + s) - drawn(truth - s)) / (2 * s.max()) for s in steps], axis=1)
    errors = size * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    off = poles_of(boxes[2]) - POLES
    assert (np.abs(np.concatenate([off.real, off.imag])) < 4 * errors[:4]).all()
    assert errors[:4].max() < 0.1 * np.abs(POLES).max()


def test_planted_poles_come_back_from_p_and_q():
    """Of real P and Q an oscillating pole and its mirror: two of the network."""
    u, p, g = power_dip(), -12 + 2j * np.pi * 3, 0.4 - 0.8j
    x = compute_pole_response(u + 0j, p, 0.005)
    P, Q = 2 * (g * x).real + 1.5 * u, 2 * ((0.3 + 0.6j) * x).real + 2.2 * u
    boxes = fit_black_boxes(PHASORS, [in_phasors(u, P + 1j * Q)], most=2)
    for pole in boxes[2].poles:
        assert pole["decay"] == pytest.approx(12, rel=1e-3)
        assert pole["frequency"] == pytest.approx(3, rel=1e-3)


def test_events_are_fitted_together():
    one, other = voltage(), voltage(depth=0.5, negative=0.0, duration=0.1)
    events = [in_waves(v, planted(v, POLES, SHARES)) for v in (one, other)]
    np.testing.assert_allclose(
        poles_of(fit_black_boxes(WAVES, events, most=2)[2]), POLES, rtol=1e-6
    )


def test_without_poles_it_is_an_admittance_and_a_capacitance():
    v = voltage()
    (box,) = fit_black_boxes(WAVES, [in_waves(v, planted(v, (), ()))], most=0)
    assert box.poles == []
    np.testing.assert_allclose(box.networks[0].coefficients, [C], rtol=1e-9)
    u = power_dip()
    (box,) = fit_black_boxes(PHASORS, [in_phasors(u, (1.4 + 3.0j) * u)], most=0)
    np.testing.assert_allclose(box.networks[0].coefficients, [0.0, 1.4 - 3.0j], atol=1e-9)


def test_no_pole_is_chosen_where_there_is_none():
    v = voltage()
    assert choose(WAVES, in_waves(v, planted(v, (), ()) + noise(len(v), 0.003))).poles == []


def test_as_many_poles_are_chosen_as_were_planted():
    v = voltage()
    box = choose(WAVES, in_waves(v, planted(v, POLES, SHARES) + noise(len(v), 0.003)))
    assert len(box.poles) == 2
    assert box.chosen_by == CRITERION


def test_more_poles_leave_less_of_what_was_fitted():
    v = voltage()
    event = in_waves(v, planted(v, POLES, SHARES) * (1 + 0.1 * np.abs(v)) + noise(len(v), 0.003))
    left = [box.networks[0].squares(WAVES.ports(event)) for box in fit_black_boxes(WAVES, [event])]
    assert left == sorted(left, reverse=True)


def test_every_pole_dies_out_within_the_record_whatever_the_current():
    """Currents that no network draws: noise, and one that grows."""
    v, t = voltage(), np.arange(1600) / RATE
    for i in (noise(1600, 1.0), np.exp(8 * t) + 0j, np.exp(2j * np.pi * 600 * t)):
        for box in fit_black_boxes(WAVES, [in_waves(v, i)]):
            decays = [p["decay"] for p in box.poles]
            assert all(1 / 0.31 < decay <= RATE / 2 + 1e-6 for decay in decays)


def test_the_time_of_the_dip_does_not_matter():
    """A longer steady state before it, and a clock that began elsewhere."""
    v = voltage()
    early = in_waves(v, planted(v, POLES, SHARES))
    late_v = np.concatenate([np.ones(320), v])
    late = in_waves(late_v, planted(late_v, POLES, SHARES), start=960)
    one, other = (fit_black_boxes(WAVES, [event], most=2)[2] for event in (early, late))
    np.testing.assert_allclose(poles_of(one), poles_of(other), rtol=1e-6)


def test_a_single_phase_has_a_network_of_its_own():
    """Of its one current: conductance and R-L, whose pole is real in the phase. What the start
    shook up is over.
    """
    before, start, n = 1280, 1920, 2880
    t = np.arange(n) / RATE
    v = np.concatenate([np.ones(before), voltage(negative=0.0)]) * np.exp(2j * np.pi * F0 * t)
    quarter = round(RATE / F0 / 4)
    u = v.real + 1j * np.concatenate([v.imag[:quarter], v.real[:-quarter]])
    i = (0.6 * u + 100 * compute_pole_response(u, -30.0, 1 / RATE)).real
    I = 2 * np.mean((i * np.exp(-2j * np.pi * F0 * t))[before:start])
    made = build_synthetic_event(
        "made", t, u * np.exp(-2j * np.pi * F0 * t), (1.0, I.real, -I.imag), F0, start, start + 190
    )
    i[:before] = np.nan
    currents = np.stack([i, np.full(n, np.nan), np.full(n, np.nan)])
    event = replace(made, phases=1, currents=currents, lead=before, steady=slice(before, start))
    box = fit_black_boxes(WAVES, [event], most=1)[1]
    (pole,) = box.poles
    assert pole["decay"] == pytest.approx(30, rel=0.01)
    assert abs(pole["frequency"]) < 0.1
    calculated = WAVES.outputs(event, [box.networks[0].response(WAVES.ports(event)[0])])
    assert np.abs(calculated[0] - i)[start:].max() < 0.002 * np.nanmax(np.abs(i))


def test_what_is_periodic_before_the_dip_goes_on():
    """Harmonics and a negative sequence that the load draws, and those of the voltage."""
    v, t = voltage(), np.arange(1600) / RATE
    own = 0.05 * np.exp(-4j * np.pi * F0 * t) + 0.03 * np.exp(2j * np.pi * 6 * F0 * t)
    driven = 0.02 * np.exp(-2j * np.pi * 6 * F0 * t)
    boxes = fit_black_boxes(
        WAVES, [event := in_waves(v + driven, planted(v, POLES, SHARES) + own)], most=2
    )
    np.testing.assert_allclose(poles_of(boxes[2]), POLES, rtol=1e-6)
    calculated = WAVES.outputs(event, [boxes[2].networks[0].response(WAVES.ports(event)[0])])
    np.testing.assert_allclose(calculated[:2], event.currents[:2], atol=1e-6)


def test_the_zero_sequence_has_a_path_of_resistance_and_inductance():
    t = np.arange(1600) / RATE
    v = voltage()
    zero = np.where(t >= 0.2, 0.2 * np.cos(2 * np.pi * F0 * t), 0.0)
    i_zero = 500 * compute_pole_response(zero + 0j, -25.0, 1 / RATE).real
    event = in_waves(v, planted(v, POLES, SHARES))
    event = replace(event, v_zero=zero, currents=np.stack([*event.currents[:2], i_zero]))
    path = fit_black_boxes(WAVES, [event], most=0)[0].networks[1]
    np.testing.assert_allclose(path.poles, [-25.0], rtol=1e-5)
    np.testing.assert_allclose(path.coefficients, [500.0], rtol=1e-5)


def test_the_slopes_are_those_of_the_residual_where_it_is_zero():
    v = voltage()
    fit = Projection.from_ports(WAVES.ports(in_waves(v, planted(v, POLES, SHARES))))
    x, step = np.concatenate([np.log(-POLES.real), POLES.imag]), 1e-5
    left = lambda x: fit.linear_part(-np.exp(x[:2]) + 1j * x[2:])[2]  # noqa: E731
    slopes = np.stack([(left(x + d) - left(x - d)) / (2 * step) for d in step * np.eye(4)], axis=1)
    expected = np.concatenate([slopes.real, slopes.imag])
    assert np.abs(fit.jacobian(POLES) - expected).max() < 2e-3 * np.abs(expected).max()


def test_gaps_are_no_samples():
    u = power_dip()
    event = in_phasors(u, (1.4 + 3.0j) * u)
    gap = replace(event.record, P=np.where(np.arange(500) % 7 == 3, np.nan, event.record.P))
    (box,) = fit_black_boxes(PHASORS, [replace(event, record=gap)], most=0)
    np.testing.assert_allclose(box.networks[0].coefficients, [0.0, 1.4 - 3.0j], atol=1e-9)


def test_a_short_record_has_fewer_poles_or_is_refused():
    u = power_dip(samples=118, duration=0.05)
    assert len(fit_black_boxes(PHASORS, [in_phasors(u, 2 * u + 0j)])) == 1
    event = in_phasors(power_dip(), power_dip() + 0j)
    few = replace(event, start=event.record.samples - 6)
    with pytest.raises(
        UserError,
        match=r"made: 6 samples from the dip on are too few .* needs 10; take a record that",
    ):
        choose(PHASORS, few)


def test_a_constant_voltage_tells_nothing():
    event = in_waves(np.ones(1600), np.ones(1600))
    with pytest.raises(
        UserError, match="the voltage of made does not change, and a network is known by"
    ):
        choose(WAVES, event)


def test_the_basis_of_a_port_is_as_wide_as_what_is_unknown():
    u = voltage() - 1
    port = Port(u, u, 1 / RATE, 640, None)
    assert compute_port_basis(port, POLES).shape == (1600, 4)
    assert compute_port_basis(replace(port, steady=1.0), POLES).shape == (1600, 3)
    assert compute_port_basis(replace(port, series=True), POLES[:0]).shape == (1600, 0)


def test_the_networks_of_records_are_fitted_once_and_the_same_for_the_next_model(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("TRACTEXP_CACHE_DIR", str(tmp_path))
    v = voltage()
    train = in_waves(v, planted(v, POLES, SHARES))
    first = fit_black_boxes(WAVES, [train], most=2)
    monkeypatch.setattr(Projection, "optimum", None)  # is not called again
    for one, again in zip(first, fit_black_boxes(WAVES, [train], most=2), strict=True):
        np.testing.assert_array_equal(again.networks[0].poles, one.networks[0].poles)
        np.testing.assert_array_equal(again.networks[0].coefficients, one.networks[0].coefficients)
    other = in_waves(v, planted(v, POLES, 1.01 * SHARES))
    with pytest.raises(TypeError):
        fit_black_boxes(WAVES, [other], most=2)
