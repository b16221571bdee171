"""Effects in waveforms: which make sense, that they are nested in the base model, and what circuits
say of each.
"""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from tractexp.configuration.plugin import discover, get
from tractexp.kernel.layout import INPUTS, SMOOTH
from tractexp.model.drive import WAVES, Drive
from tractexp.model.model import compose
from tractexp.testing import drives

OMEGA_N, P0, Q0 = 100 * np.pi, drives.P0, drives.Q0
OMEGA = OMEGA_N - 1.5  # of the frame of the drives
NAMES = sorted(discover()["effect"])
PHASORS_ONLY = {
    "inductive_static_load",
    "frequency_dependence",
    "measurement_window",
    "negative_sequence_braking",
    "transformer_inrush",
    "polynomial_static_load",
    "rotor_flux",
    "second_cage",
    "stator_transients",
}
WAVES_ONLY = {
    "zero_sequence_path",
    "transformer_saturation",
    "negative_sequence_path",
    "fault_resistance",
    "stuck_pole",
    "current_transformer_saturation",
    "transformer_error",
    "harmonics_source",
    "infeed",
    "resonant_branch",
}
STACK = (
    "feeder_impedance",
    "shunt_capacitor",
    "second_motor_group",
    "undervoltage_trip",
    "transformer_saturation",
    "current_transformer_saturation",
    "harmonics_source",
)
DIP = drives.wave_dip(0.5)
DIPS = Drive.from_events([DIP])


def effect(name):
    return get("effect", name)()


@functools.cache
def model(*names, motor="none", static="branch"):
    parts = get("model/motor", motor)(), get("model/static", static)()
    return compose(*parts, [effect(n) for n in names], domain=WAVES)


def run(*names, motor="none", substeps=16, drive=DIPS, **chosen):
    """The current's space vector in its frame and the zero sequence, (N,) each, at defaults but for
    what is chosen.
    """
    of = model(*names, motor=motor)
    response = of.simulate(drive, [chosen.pop(p.name, p.default) for p in of.parameters], substeps)
    assert not chosen
    assert (response.miss == 0).all()
    rows = dict(zip(INPUTS, drive.inputs, strict=True))
    turned = (response.outputs[0, 0] + 1j * response.outputs[1, 0]) * (
        rows["turn_re"] - 1j * rows["turn_im"]
    )
    return turned, response.outputs[2, 0]


def smooth(*names):
    """A row of the drive between samples, or two as real and imaginary part, and its slope."""
    rows = dict(zip(INPUTS, DIPS.inputs, strict=True))
    value, rate = (
        sum(unit * rows[n] for unit, n in zip((1, 1j), which, strict=False))
        for which in (names, [SMOOTH[n] for n in names])
    )
    curve = CubicHermiteSpline(rows["t"], value, rate)
    return curve, curve.derivative()


def solved(slope, start):
    """States (k, N), complex."""
    t = DIPS.inputs[INPUTS.index("t")]
    start = np.asarray(start, dtype=complex)
    return solve_ivp(
        slope, (0, t[-1]), start, "DOP853", t, rtol=1e-9, atol=1e-11, max_step=DIP.step
    ).y


# which there are


def test_each_is_taken_or_refused_for_a_reason_of_its_own():
    """Those of one domain say so in the other."""
    refused = {n: model(motor="electromechanical").acceptance(effect(n)).refusal for n in NAMES}
    assert refused.pop("rotor_speed") == "its speed moves already"
    assert {n for n, why in refused.items() if why} == PHASORS_ONLY
    assert all(why == effect(n).phasors_only for n, why in refused.items() if why)
    assert {n for n in NAMES if effect(n).waves_only} == WAVES_ONLY


def test_several_at_their_nulls_are_the_base_model():
    whole, bare = model(*STACK, motor="stator_flux"), model(motor="stator_flux")
    together = whole.simulate(DIPS, [p.default for p in whole.parameters], 8)
    alone = bare.simulate(DIPS, [p.default for p in bare.parameters], 8)
    assert (together.miss == 0).all()
    assert np.abs(together.outputs - alone.outputs).max() < 1e-12


# what circuits say


def branch_of(P, Q, v=1.0, r=0.3):
    """Conductance, susceptance of the branch's inductance and its resistance over reactance, that
    draw P + jQ at v.
    """
    speed = OMEGA / OMEGA_N
    B = Q * (speed**2 + r**2) / speed / abs(v) ** 2
    return (P - Q * r / speed) / abs(v) ** 2, B, r


def test_a_capacitor_draws_what_the_slope_of_the_voltage_says():
    b = 0.4
    v, rate = smooth("v_d", "v_q")
    G, B, r = branch_of(P0, Q0 + b * OMEGA / OMEGA_N)
    (psi,) = solved(
        lambda t, y: OMEGA_N * v(t) - (r * OMEGA_N + 1j * OMEGA) * y,
        [1 / (r + 1j * OMEGA / OMEGA_N)],
    )
    t = DIPS.inputs[INPUTS.index("t")]
    known = G * v(t) + B * psi + b * (rate(t) / OMEGA_N + 1j * OMEGA / OMEGA_N * v(t))
    assert np.abs(run("shunt_capacitor", capacitor=b)[0] - known).max() < 1e-6


def test_a_feeder_is_its_circuit():
    """Its reactance with what lies beside it, before conductance and branch: states are the two
    inductors' currents.
    """
    R, X, T = 0.02, 0.1, 5e-5
    R_p = X / OMEGA_N / T
    i_0 = P0 - 1j * Q0
    inductor_0 = i_0 / (1 + 1j * T * OMEGA)
    v_0 = 1 - R * i_0 - R_p * (i_0 - inductor_0)
    left = v_0 * np.conj(i_0)
    G, B, r = branch_of(left.real, left.imag, v_0)
    v, _ = smooth("v_d", "v_q")
    at = lambda t, y: (v(t) + R_p * y[0] - (R + R_p) * B * y[1]) / (1 + (R + R_p) * G)  # noqa: E731

    def slope(t, y):
        node = at(t, y)
        drawn = G * node + B * y[1]
        return [
            (drawn - y[0]) / T - 1j * OMEGA * y[0],
            OMEGA_N * node - (r * OMEGA_N + 1j * OMEGA) * y[1],
        ]

    y = solved(slope, [inductor_0, v_0 / (r + 1j * OMEGA / OMEGA_N)])
    t = DIPS.inputs[INPUTS.index("t")]
    known = G * at(t, y) + B * y[1]
    seen, _ = run("feeder_impedance", R_f=R, X_f=X, substeps=32)
    assert np.abs(seen - known).max() < 2e-6
    assert np.abs(seen - run()[0]).max() > 0.1


def test_a_feeder_and_a_capacitor_ring_at_their_resonance():
    """b = 1 behind X = 0.12, beside a branch of Q0 + b: the step rings at sqrt(1/X + Q0 + b) times
    nominal.
    """
    n = 3200
    still = drives.wave_flat(1.0, rate=12800.0, samples=n)
    step = np.where(np.arange(n) < 600, 1.0, 0.9)
    for array, values in ((still.v, step), (still.U, step)):
        array[:] = values
    drive = Drive.from_events([still])
    seen, _ = run("feeder_impedance", "shunt_capacitor", X_f=0.12, capacitor=1.0, drive=drive)
    ringing = (seen * still.turn)[620:1100] - (
        run("shunt_capacitor", capacitor=1.0, drive=drive)[0] * still.turn
    )[620:1100]
    spectrum = np.abs(np.fft.fft(ringing * np.hanning(480), 1 << 16))
    f = np.fft.fftfreq(1 << 16, 1 / 12800.0)
    high = np.abs(f) > 90
    found = abs(f[high][np.argmax(spectrum[high])])
    assert found == pytest.approx(50 * np.sqrt(1 / 0.12 + Q0 + 1.0), rel=0.03)


def test_a_load_behind_a_feeder_draws_before_the_dip_what_was_recorded():
    for motor in ("stator_flux", "electromechanical"):
        seen, _ = run(
            "feeder_impedance", "shunt_capacitor", motor=motor, R_f=0.02, X_f=0.1, capacitor=0.3
        )
        assert np.abs(seen[:380] - (P0 - 1j * Q0)).max() < 1e-6


def test_a_resonant_branch_is_its_resistance_inductance_and_capacitor():
    """In the stationary frame, where it is not declared: 1/b = X_L (n² - 1), R = 2
    X_L/(omega_n T).
    """
    b, f, T = 0.3, 190.0, 0.02
    square = (f / 50) ** 2
    X, speed = 1 / (b * (square - 1)), OMEGA / OMEGA_N
    R, susceptance = 2 * X / (OMEGA_N * T), 1 / (square * X)
    admittance = 1 / (R + 1j * X * speed + 1 / (1j * susceptance * speed))
    v, _ = smooth("v_d", "v_q")
    angle = lambda t: np.exp(1j * OMEGA * t)  # noqa: E731
    i_0 = admittance * v(0.0)

    def slope(t, y):
        return [OMEGA_N / X * (v(t) * angle(t) - R * y[0] - y[1]), OMEGA_N * y[0] / susceptance]

    i, _ = solved(slope, [i_0, v(0.0) - (R + 1j * X * speed) * i_0])
    t = DIPS.inputs[INPUTS.index("t")]
    drawn = admittance.conjugate()
    G, B, r = branch_of(P0 - drawn.real, Q0 - drawn.imag)
    (psi,) = solved(
        lambda t, y: OMEGA_N * v(t) - (r * OMEGA_N + 1j * OMEGA) * y,
        [1 / (r + 1j * OMEGA / OMEGA_N)],
    )
    known = G * v(t) + B * psi + i / angle(t)
    chosen = {"resonant_susceptance": b, "resonance_frequency": f, "ringing_time": T}
    assert np.abs(run("resonant_branch", substeps=32, **chosen)[0] - known).max() < 2e-6


def test_a_resonant_branch_rings_at_its_frequency_until_its_time_is_over():
    drive = Drive.from_events([drives.wave_dip(0.3, rate=12800.0, length=0.4)])
    chosen = {"resonant_susceptance": 0.3, "resonance_frequency": 190.0, "ringing_time": 0.02}
    ringing = run("resonant_branch", drive=drive, **chosen)[0] - run(drive=drive)[0]
    turned = (ringing - ringing[-1]) * drives.wave_dip(0.3, rate=12800.0, length=0.4).turn
    after = turned[-2600:]  # from 0.2 s on, the dip over
    spectrum = np.abs(np.fft.fft(after * np.hanning(len(after)), 1 << 16))
    f = np.abs(np.fft.fftfreq(1 << 16, 1 / 12800.0))
    high = f > 100
    assert f[high][spectrum[high].argmax()] == pytest.approx(190, abs=6)


def test_an_infeed_is_a_source_behind_its_resistance_and_inductance():
    """Of the source the change alone is seen: what it gives at rest is in P0 and Q0."""
    b, r = 0.8, 0.15
    v, _ = smooth("v_d", "v_q")
    (psi,) = solved(lambda t, y: OMEGA_N * (v(t) - v(0.0) - r * y) - 1j * OMEGA * y, [1e-9])
    more = run("infeed", infeed_susceptance=b, infeed_resistance=r)[0] - run()[0]
    assert np.abs(more - b * psi).max() < 1e-6
    assert np.abs(more[:350]).max() < 1e-12
    assert np.abs(more).max() > 0.1


def test_a_capacitor_beside_a_compensated_branch_is_refused():
    refusal = model(static="compensated_branch").acceptance(effect("shunt_capacitor")).refusal
    assert refusal == "its static load has a capacitor already"


def test_the_zero_sequence_follows_its_branch():
    b, r = 20.0, 0.03
    v, _ = smooth("v_zero")
    (psi,) = solved(lambda t, y: OMEGA_N * (v(t) - r * y), [1e-9])
    assert (
        np.abs(
            run("zero_sequence_path", zero_susceptance=b, zero_resistance=r)[1] - b * psi.real
        ).max()
        < 1e-6
    )
    assert b * psi.real.max() > 0.2


def test_a_second_group_is_two_motors_side_by_side():
    g, r = 0.3, 5.0
    M = get("model/motor", "stator_flux").M.default
    both = run("second_motor_group", motor="stator_flux", group_share=g, inertia_ratio=r)[0]
    first, second = (run(motor="stator_flux", M=inertia)[0] for inertia in (M, r * M))
    assert np.abs(both - (1 - g) * first - g * second).max() < 1e-11
    assert np.abs(both - first).max() > 1e-3


def test_a_trip_takes_its_share_of_the_currents():
    chosen = {"tripped_share": 0.4, "trip_level": 0.8, "trip_delay": 0.01}
    drive = Drive.from_events([drives.wave_dip(0.6)])
    names = ("undervoltage_trip", "zero_sequence_path")
    i, zero = run(*names, drive=drive, zero_susceptance=10.0, **chosen)
    whole, whole_zero = run("zero_sequence_path", drive=drive, zero_susceptance=10.0)
    late = slice(520, 700)
    assert pytest.approx(0.6 * whole[late], abs=1e-4) == i[late]
    assert pytest.approx(0.6 * whole_zero[late], abs=1e-4) == zero[late]
    assert pytest.approx(whole[:400], abs=1e-6) == i[:400]


def test_a_drift_grows_with_its_part_of_the_current():
    seen, whole = run("load_change", drift_P=0.05, drift_Q=-0.03)[0], run()[0]
    t = DIPS.inputs[INPUTS.index("t")]
    known = whole.real * (1 + 0.05 * t) + 1j * whole.imag * (1 - 0.03 * t)
    assert np.abs(seen - known).max() < 1e-12


def test_a_skew_shifts_the_currents_of_the_stationary_frame():
    late, whole = run("time_skew", skew=2 / 3200)[0] * DIP.turn, run()[0] * DIP.turn
    assert np.abs(late[5:] - whole[3:-2]).max() < 1e-12


TURN = np.exp(2j * np.pi / 3)


def of_phase(vector, k):
    return (vector * DIP.turn * TURN ** (-k)).real


def test_a_core_that_a_dip_leaves_offset_draws_peaks_of_one_sign_until_the_offset_has_decayed():
    y, knee, T = 2.0, 1.1, 0.05
    chosen = {"saturated_admittance": y, "flux_knee": knee, "flux_decay": T}
    extra = run("transformer_saturation", **chosen)[0] - run()[0]
    v, _ = smooth("v_d", "v_q")
    (psi,) = solved(
        lambda t, x: OMEGA_N * v(t) - (1 / T + 1j * OMEGA) * x, [OMEGA_N / (1 / T + 1j * OMEGA)]
    )
    limit = knee * abs(psi[0])
    flux = np.array([of_phase(psi, k) for k in range(3)])
    drawn = y * np.sign(flux) * np.maximum(0, abs(flux) - limit)
    known = 2 / 3 * (drawn[0] + TURN * drawn[1] + TURN**2 * drawn[2]) / DIP.turn
    assert np.abs(extra - known).max() < 2e-3  # the corner of the curve, stepped over
    assert np.abs(extra[:380]).max() < 1e-12
    assert np.abs(drawn[:, 560:]).max() > 0.05
    assert np.abs(extra[-20:]).max() < 0.3 * np.abs(extra[560:]).max()


def test_a_saturated_current_transformer_loses_what_its_core_takes():
    chosen = {"core_slope": 1.0, "core_knee": 1.5, "core_decay": 0.1}
    names = ("current_transformer_saturation", "zero_sequence_path")
    seen, zero = run(*names, zero_susceptance=10.0, **chosen)
    whole, whole_zero = run("zero_sequence_path", zero_susceptance=10.0)
    size = abs(P0 - 1j * Q0)
    flux = np.array(
        [0 - 1j * (P0 - 1j * Q0) * OMEGA_N / OMEGA * DIP.turn[0] * TURN ** (-k) for k in range(3)]
    ).real
    phases = np.array([of_phase(seen, k) + zero for k in range(3)])
    true = np.array([of_phase(whole, k) + whole_zero for k in range(3)])
    lost = true - phases
    assert np.abs(lost[:, :380]).max() < 1e-9
    assert np.abs(lost).max() > 0.1
    for i in range(380, 895):  # the core's flux is the integral of what is seen, by trapezoids
        now = 1.0 * np.sign(flux) * np.maximum(0, np.abs(flux) - 1.5 * size)
        if i > 381:
            assert pytest.approx(lost[:, i], abs=0.03) == now
        if i == 380:
            flux = np.array(
                [
                    of_phase(np.full(896, -1j * (P0 - 1j * Q0) * OMEGA_N / (OMEGA - 10j)), k)[i]
                    for k in range(3)
                ]
            )
        mean = (phases[:, i] + phases[:, i + 1]) / 2
        flux = (flux * (1 - 0.5 / 3200 / 0.1) + OMEGA_N * mean / 3200) / (1 + 0.5 / 3200 / 0.1)


def test_a_power_that_is_held_is_the_conjugate_path_to_first_order():
    """i = conj(S/v) less its value before is -conj(S) conj(dv) for a small dv that moves slowly."""
    drive = Drive.from_events([drives.wave_dip(0.01, edge=0.04)])
    chosen = {"conjugate_conductance": -0.5, "conjugate_susceptance": 0.2, "conjugate_lag": 3e-4}
    extra = (
        run("negative_sequence_path", drive=drive, substeps=16, **chosen)[0] - run(drive=drive)[0]
    )
    v = drive.inputs[INPUTS.index("v_d")] + 1j * drive.inputs[INPUTS.index("v_q")]
    held = np.conj((0.5 + 0.2j) / v) - np.conj(0.5 + 0.2j)
    late = np.roll(held, 1)  # 0.3 ms
    assert np.abs(extra - late).max() < 0.03 * np.abs(held).max()


def test_a_fault_inside_the_load_lasts_as_long_as_the_voltage_is_off():
    g = 0.7
    extra, zero = (
        a - b for a, b in zip(run("fault_resistance", fault_conductance=g), run(), strict=True)
    )
    inside, outside = slice(392, 540), np.r_[0:383, 575:896]
    assert pytest.approx(g * DIP.v[inside], abs=1e-9) == extra[inside]
    assert pytest.approx(g * DIP.v_zero[inside], abs=1e-9) == zero[inside]
    assert np.abs(extra[outside]).max() < 1e-12


@pytest.mark.parametrize("phase", [0, 1, 2])
def test_a_pole_that_stays_open_carries_nothing(phase):
    chosen = {"opened_share": 1.0, "opened_phase": float(phase), "opened_after": 0.04}
    seen, zero = run("stuck_pole", **chosen)
    whole, _ = run()
    late = slice(530, 896)
    for k in range(3):
        through = of_phase(seen, k) + zero
        known = 0 if k == phase else of_phase(whole, k)
        assert np.abs(through - known)[late].max() < 1e-4
        assert np.abs(through - of_phase(whole, k))[:500].max() < 1e-4


def test_an_error_of_the_transformers_scales_and_turns_what_departs():
    seen, whole = run("transformer_error", scale_error=0.05, angle_error=-0.02)[0], run()[0]
    before = P0 - 1j * Q0
    assert np.abs(seen - before - (1.05 - 0.02j) * (whole - before)).max() < 1e-12


def test_harmonics_of_the_record_go_on_through_the_dip():
    fifth = 0.1 * np.exp(-5j * (100 * np.pi - 1.5) * np.arange(896) / 3200.0 + 0.4j)
    bare = run()[0]
    measured = bare * DIP.turn + fifth
    recorded = np.stack([measured.real, measured.imag, np.zeros(896)])
    recorded[:, :64] = np.nan
    drive = Drive.from_events([dataclasses.replace(DIP, currents=recorded)])
    seen = run("harmonics_source", drive=drive, harmonics=1.0)[0]
    added = (seen - bare) * DIP.turn
    learnt = slice(64, 193)  # the two cycles they are found in stand as they are
    assert not added[learnt].any()
    assert np.abs(added - fifth)[193:].max() < 1e-6
