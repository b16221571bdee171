"""Recorders that average phasors over whole cycles, `RecorderWindow`: the average, the voltage
reckoned back, and what is said of it.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_dips import FAST, events, investigate
from scipy.integrate import quad

import tractexp
from tractexp.configuration.plugin import build_chosen
from tractexp.discrepancy.window_search import _choose_window
from tractexp.domain.excitation import excite_phasors
from tractexp.errors import UserError
from tractexp.inference.criteria import Criteria
from tractexp.inference.recorder_window import RecorderWindow, list_recorder_windows
from tractexp.model.drive import Drive
from tractexp.record.window import average, averaged_power


def mean(y, samples):
    """Mean of y (..., N) over a recorder's window around each sample."""
    return average(y, RecorderWindow(samples).weights(1.0))


@pytest.mark.parametrize("samples", [1.0, 2.5, 10.0, 16.67])
def test_the_average_is_the_integral_over_the_window(samples):
    rng = np.random.default_rng(0)
    y = rng.normal(size=60)
    curve = lambda x: np.interp(x, np.arange(60), y)  # noqa: E731
    for at in (9, 31, 50):  # what it goes on with beyond its ends stands in test_orders
        low, high = at - samples / 2, at + samples / 2
        knots = np.arange(np.ceil(low), np.ceil(high))
        area, _ = quad(curve, low, high, points=knots, limit=200)
        assert mean(y, samples)[at] == pytest.approx(area / samples, abs=1e-10)


def test_a_straight_line_is_its_own_average():
    y = np.outer([1.0, -2.0], np.arange(50))
    assert mean(y, 12.3)[:, 8:-8] == pytest.approx(y[:, 8:-8])


@pytest.mark.parametrize("cycles", [1, 2, 4])
def test_the_voltage_reckoned_back_is_that_which_was_averaged(cycles):
    (event,) = events(count=1, recorder=FAST)
    step, window = event.record.step, 0.02 * cycles
    shown = replace(event, record=replace(event.record, U=mean(event.record.U, window / step)))
    back = RecorderWindow(window).sharpen_event(shown).record.U
    shows, error = shown.record.U - event.record.U, back - event.record.U
    assert np.abs(shows).max() > 0.01
    # What repeats with the window itself cannot be told: corners lose a little where it is shorter
    # than the edges.
    assert error @ error < (0.2 if cycles == 1 else 1e-3) * (shows @ shows)


def test_windows_are_whole_cycles_and_those_of_measurement_units_that_the_sampling_resolves():
    (event,) = events(count=1)
    windows = list_recorder_windows([event])
    assert [w.window for w in windows if not w.shape] == pytest.approx(
        [0.02 * k for k in (1, 2, 3, 4, 5, 6)]
    )
    assert {w.shape.name: w.window for w in windows if w.shape} == pytest.approx(
        {"p_class": 0.04, "m_class": 0.1775}
    )
    assert "40 ms by the weights of p_class" in next(w for w in windows if w.shape).describe()
    slow = replace(event, record=replace(event.record, t=event.record.t * 10))
    assert min(w.window for w in list_recorder_windows([slow])) >= 2 * slow.record.step


def test_a_window_that_the_records_say_is_the_only_one_tried():
    (event,) = events(count=1)
    said = replace(
        event,
        record=replace(event.record, window=build_chosen("estimator", "p_class").window(50.0)),
    )
    (window,) = list_recorder_windows([said, said])
    assert window.window == pytest.approx(0.04)
    assert "p_class" in window.describe()
    # where they contradict each other it is searched for
    assert len(list_recorder_windows([said, event])) == 8


def test_what_a_triangle_did_is_undone():
    (event,) = events(count=1)
    known = build_chosen("estimator", "p_class").window(50.0)
    recorder = RecorderWindow(known.length, known, said=True)
    weights = recorder.weights(event.record.step)
    U = np.convolve(np.pad(event.record.U, len(weights) // 2, "edge"), weights, "valid")
    back = recorder.sharpen_event(replace(event, record=replace(event.record, U=U))).record.U
    shows, error = U - event.record.U, back - event.record.U
    assert np.abs(shows).max() > 0.01
    assert error @ error < 0.2 * (shows @ shows)


def turn_voltage(event, jump):
    """The event with the voltage turned by `jump` [rad] during the dip, as phasors averaged over
    20 ms show it, f the slope of their angle; and the voltage (N,) that was averaged.
    """
    record, window = event.record, 0.02
    rise = np.clip((record.t[event.start - 1] - record.t) / -0.004, 0, 1)
    fall = np.clip((record.t[event.end - 1] - record.t) / -0.004, 0, 1)
    u = record.U * np.exp(1j * jump * (rise - fall))
    shown = mean(u.real, window / record.step) + 1j * mean(u.imag, window / record.step)
    slope = np.gradient(np.unwrap(np.angle(shown)), record.step)
    f = record.base.frequency + slope / (2 * np.pi)
    turned = replace(record, U=np.abs(shown), f=f)
    return replace(event, record=turned, f0=record.base.frequency), u


def test_a_jump_of_the_angle_is_reckoned_back_with_the_voltage():
    (event,) = events(count=1, recorder=FAST)
    shown, u = turn_voltage(event, -0.2)
    record = RecorderWindow(0.02).sharpen_event(shown).record
    back = record.U * np.exp(1j * record.U_angle)
    angle = 2 * np.pi * np.cumsum(shown.record.f - 50.0) * record.step
    seen = np.linalg.norm(shown.record.U * np.exp(1j * angle) - u)
    assert np.linalg.norm(back - u) < 0.5 * seen
    assert record.U_angle[event.start + 15] == pytest.approx(-0.2, abs=0.02)


def test_a_voltage_that_does_not_turn_is_reckoned_back_as_before():
    (event,) = events(count=1, recorder=FAST)
    off_nominal = replace(event.record, f=np.full(event.record.samples, 50.3))
    steady = replace(event, record=off_nominal, f0=50.3)
    window = RecorderWindow(0.02)
    record = window.sharpen_event(steady).record
    assert record.U.tolist() == window.sharpen_event(event).record.U.tolist()
    assert record.f is off_nominal.f


def test_the_noise_of_a_frequency_is_no_turn_of_the_voltage():
    """Else an angle that never turned is computed back with what noise it has at the edges."""
    (event,) = events(count=1, recorder=FAST)
    record = event.record
    angle = 2e-4 * np.random.default_rng(3).standard_normal(record.samples)  # as noisy as U
    noisy = replace(record, f=50.0 + np.gradient(angle, record.step) / (2 * np.pi))
    seen = replace(event, record=noisy, f0=50.0)
    back = RecorderWindow(0.02).sharpen_event(seen).record
    assert back.f is noisy.f
    assert back.U.tolist() == RecorderWindow(0.02).sharpen_event(event).record.U.tolist()


def test_the_power_of_turning_phasors_is_that_of_their_averages():
    t = np.arange(400) * 2e-3
    u = (1 - 0.3 * (t > 0.4)) * np.exp(0.3j * (t > 0.4))
    current = (0.7 - 0.2j) * np.exp(2j * np.pi * 3 * t)
    S = u * np.conj(current)
    weights = np.full(11, 1 / 11)
    U, I = (average(x.real, weights) + 1j * average(x.imag, weights) for x in (u, current))
    shown = averaged_power(np.stack([S.real, S.imag])[:, None], u, weights)[:, 0]
    assert shown[0] + 1j * shown[1] == pytest.approx(U * np.conj(I), abs=1e-12)


def test_a_window_of_phasors_is_no_missing_effect():
    """The load is nonlinear, so that a window on voltage and current shows, and no effect is named
    for it.
    """
    made = events(nuisances=(("phasor_window", 3.0),))
    told = []
    found = investigate(made, progress=told.append)
    assert (found.verdict, found.names) == ("none", ())
    assert found.content["phasor_window"] == pytest.approx(0.06)
    assert any("60 ms" in line for line in told)
    assert "60 ms" in found.reason
    assert "though no record says so: ask whoever runs the recorder" in found.reason


@pytest.mark.parametrize(
    ("gained", "said", "believed"),
    [(0.5, True, False), (20.0, True, True), (20.0, False, False), (2000.0, False, True)],
)
def test_a_window_must_show_whether_or_not_the_records_say_it(gained, said, believed):
    """By a gain of 0.5 of a deviance of 9,000 the order of two dips decided, where it was 57 less
    in the other. One that is a guess must explain half as much as the best effect, too.
    """
    window = SimpleNamespace(said=said)
    behind = SimpleNamespace(records=SimpleNamespace(window=window))
    first = SimpleNamespace(
        scores=[SimpleNamespace(drop=3000.0)],
        criteria=Criteria(),
        fit=SimpleNamespace(deviance=9000.0),
    )
    tried = behind, SimpleNamespace(deviance=9000.0 - gained)
    assert _choose_window([tried], first) is (tried if believed else None)


def test_no_window_is_found_where_there_is_none(planted):
    """Nor where no effect is (test_discrepancy)."""
    assert planted.content["phasor_window"] is None
    assert planted.names == ("stator_resistance",)


@pytest.mark.parametrize("window", [0.02, 0.035, "p_class", "m_class"])
def test_a_model_set_to_a_window_is_looked_at_as_an_investigation_looks(window):
    """`model.window`: driven by the voltage reckoned back, its power averaged; the same as behind
    the recorder.
    """
    (event,) = events(count=1)
    load = tractexp.compose().model
    shape = build_chosen("estimator", window).window(50.0) if isinstance(window, str) else None
    recorder = RecorderWindow(shape.length if shape else window, shape)
    assert recorder.setting == window
    behind = Drive.from_events(
        [excite_phasors(recorder.sharpen_event(event), load.place_behind_recorder(recorder))]
    )
    through = tractexp.compose(window=window).model
    drive = Drive.from_events([excite_phasors(event, through)])
    values = np.array([[p.default for p in load.parameters]])
    assert drive.inputs == pytest.approx(behind.inputs, nan_ok=True)
    expected = load.place_behind_recorder(recorder).simulate(behind, values).outputs
    assert through.simulate(drive, values).outputs == pytest.approx(expected, abs=1e-12)
    plain = load.simulate(Drive.from_events([excite_phasors(event, load)]), values).outputs
    assert np.abs(expected - plain).max() > 1e-3


def test_a_window_that_the_records_say_is_theirs():
    (event,) = events(count=1)
    shape = build_chosen("estimator", "p_class").window(50.0)
    said = replace(event, record=replace(event.record, window=shape))
    model = tractexp.compose(window="recorded").model
    assert np.array_equal(
        excite_phasors(said, model).window,
        excite_phasors(event, tractexp.compose(window="p_class").model).window,
    )
    assert excite_phasors(event, model).window is None
    assert RecorderWindow(shape.length, shape, said=True).setting == "recorded"


@pytest.mark.parametrize(
    ("window", "sentence"),
    [
        (0.0, "is no window: give its length"),
        (-0.02, "is no window: give its length"),
        (20.0, "at most 2 s"),
        (10.0, "at most 2 s"),
        (float("nan"), "is no window"),
        ("two_cycles", "there is no such window"),
    ],
)
def test_what_is_no_window_is_refused(window, sentence):
    with pytest.raises(UserError, match=sentence):
        tractexp.compose(window=window)


def test_waveforms_have_no_window():
    with pytest.raises(UserError, match="no meaning on waveforms"):
        tractexp.compose(domain="waves", window=0.02)


@pytest.mark.long
def test_the_extended_model_has_the_window_that_was_taken_into_account(tmp_path):
    """As a file and as a call's, so that the next step sees the records as the
    investigation did.
    """
    made = events("stator_resistance", size=3.0, count=3, nuisances=(("phasor_window", 3.0),))
    train, held = made[:2], made[2:]
    model = tractexp.compose(window=0.06)
    found = tractexp.investigate(
        train, model, validate=held, effects=["stator_resistance"], progress=False
    )
    assert found.names == ("stator_resistance",)
    assert found.content["recorder_window"] == pytest.approx(0.06)
    assert found.extended_model.window == pytest.approx(0.06)
    assert found.fit.result.model["window"] == pytest.approx(0.06)
    found.write_results(tmp_path)
    file = tmp_path / "conf" / "model" / "extended.yaml"
    assert tractexp.compose(file).window == pytest.approx(0.06)
    first, second, third = file.read_text(encoding="utf-8").splitlines()[:3]
    assert first.startswith("# tractexp ")
    assert str(file) in first
    assert "found missing: stator_resistance" in second
    assert third == "# window: as in the base model."
    again = tractexp.identify(
        train, file, optimizer="multistart_least_squares", check_intervals=False, progress=False
    )
    assert again.grade == found.content["adequacy"]["grade"]
