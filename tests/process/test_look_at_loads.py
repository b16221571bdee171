"""What a look says of loads that change, that are lost, or that are none."""

import numpy as np
import pytest
from made_recordings import RATE, constant, recording

import tractexp
from tractexp.filetypes.comtrade_writer import write
from tractexp.record.wave_event import convert_to_waves


def saved(path, values, **more):
    write(recording(values, **more), path, "BINARY", 1999)
    return path


def course(values, *steps):
    """Waveforms whose currents change, by (time [s], factor), from then on."""
    t, size = np.arange(values.shape[1]) / RATE, np.ones(values.shape[1])
    for at, factor in steps:
        size[t >= at] = factor
    return np.concatenate([values[:3], size * values[3:]])


POWER = pytest.approx(40.0, rel=5e-3)  # MW, of 0.8 per unit of 50 MVA


def test_the_headline_is_the_power_before_the_load_trips(tmp_path):
    shown = tractexp.look(
        saved(tmp_path / "trip.cfg", course(constant(0.0, length=5.0), (0.8, 1e-4)))
    )
    [load], [event] = shown.feeders, shown.events
    assert load["P"] == POWER
    assert load["loaded"]
    assert event["kind"] == "load loss"
    assert "At first 110 kV, 40 MW" in shown.report().html


def test_the_headline_is_the_power_before_the_dip_not_at_the_beginning(tmp_path):
    path = saved(
        tmp_path / "shed.cfg",
        course(constant(start=1.2, end=1.4, length=3.0), (0.0, 3.0), (0.8, 1.0)),
    )
    shown, [event] = tractexp.look(path), tractexp.read(path)
    [load] = shown.feeders
    assert load["P"] == POWER
    assert load["P"] == pytest.approx(event.P0 * event.record.base.power)
    assert "the steady state before the dip is that of the" in shown.events.rows[1]["why"]
    assert "Before the dip 110 kV, 40 MW" in shown.report().html


def test_the_samples_that_are_fitted_begin_after_the_step_too(tmp_path):
    path = saved(
        tmp_path / "shed.cfg",
        course(constant(start=1.2, end=1.4, length=3.0), (0.0, 3.0), (0.8, 1.0)),
    )
    event = convert_to_waves(tractexp.read(path)[0])
    assert 0.8 < event.record.t[event.first] < 0.83
    assert event.P0 * event.record.base.power == POWER


def test_the_headline_is_that_before_a_dip_that_is_not_worth_fitting_too(tmp_path):
    path = saved(
        tmp_path / "near.cfg",
        course(constant(start=1.2, end=1.4, length=3.0), (0.0, 3.0), (1.13, 1.0)),
    )
    shown = tractexp.look(path)
    assert shown.feeders.rows[0]["P"] == POWER
    assert "no steady state of 100 ms comes before it" in shown.events.rows[1]["why"]


def test_a_dip_that_leaves_nothing_of_the_load_is_not_worth_fitting(tmp_path):
    [event] = tractexp.look(
        saved(tmp_path / "all.cfg", course(constant(length=2.0), (0.6, 0.0)))
    ).events
    assert not event["worth"]
    assert "the load is switched off in it" in event["why"]


def test_a_load_that_is_lost_in_the_dip_is_worth_it_only_with_that_word(tmp_path):
    [event] = tractexp.look(
        saved(tmp_path / "lost.cfg", course(constant(length=2.0), (0.6, 6 / 32)))
    ).events
    assert "the load loses 81 % of its power in the dip (P 40" in event["why"]


def test_a_record_that_is_cut_says_so_in_a_look_too(tmp_path):
    path = saved(tmp_path / "cut.cfg", course(constant(length=3.0), (1.2, 0.0)))
    dip, loss = tractexp.look(path).events
    assert dip["P_after"] == POWER
    assert "MW" in dip["why"]
    assert dip["why"].endswith("the record is cut there")
    assert loss["kind"] == "load loss"
    assert tractexp.read(path)[0].record.t[-1] < 1.2


def test_an_unloaded_feeder_beside_a_dip_says_that_it_has_no_load(tmp_path):
    values = constant(length=2.0)
    noise = 1e-6 * np.random.default_rng(0).standard_normal((3, values.shape[1]))
    names = ("UA", "UB", "UC", "Q1 IA", "Q1 IB", "Q1 IC", "Q2 IA", "Q2 IB", "Q2 IC")
    shown = tractexp.look(saved(tmp_path / "two.cfg", np.concatenate([values, noise]), names=names))
    assert [load["loaded"] for load in shown.feeders] == [True, False]
    for page in (str(shown), shown.report().html):
        assert (
            "o load here: what happens to the voltage is listed with the loads of its bus" in page
        )
        assert "nothing happened" not in page.lower()


@pytest.mark.parametrize("names", [("UA", "UB", "UC", "IA", "IB", "IC")])
def test_where_no_feeder_has_a_load_the_dip_is_shown_and_not_worth_fitting(tmp_path, names):
    values = constant(length=2.0)
    values[3:] = 1e-6 * np.random.default_rng(0).standard_normal((3, values.shape[1]))
    shown = tractexp.look(saved(tmp_path / "none.cfg", values, names=names))
    [load], [event] = shown.feeders, shown.events
    assert "no load here" in load["why"][-1]
    assert (event["kind"], event["worth"]) == ("dip", False)


def test_a_load_of_steady_power_has_no_event_of_its_own(tmp_path):
    shown = tractexp.look(saved(tmp_path / "quiet.cfg", constant(0.0, length=3.0)))
    assert len(shown.events) == 0
    assert "nothing happened" in str(shown)


def test_all_loads_of_a_bus_have_its_voltage_and_its_events(tmp_path):
    """A dip of most of the record; the second load doubles before it, the third feeder
    has no load.
    """
    values = constant(start=0.6, end=1.7, length=2.0)
    double = course(values, (0.3, 2.0))[3:]
    noise = 1e-6 * np.random.default_rng(0).standard_normal((3, values.shape[1]))
    names = ["UA", "UB", "UC", *(f"Q{k} I{p}" for k in (1, 2, 3) for p in "ABC")]
    shown = tractexp.look(
        saved(tmp_path / "bus.cfg", np.concatenate([values, double, noise]), names=names)
    )
    first, second, third = shown.feeders
    assert first["U"] == second["U"] == third["U"] == pytest.approx(110.0, rel=1e-3)
    dips = [e for e in shown.events if e["kind"] == "dip"]
    assert len(dips) == 2
    assert (
        len({(e["start"], e["end"], e["depth"], e["jump"], e["U2"], e["dip"]) for e in dips}) == 1
    )
    (bus,) = (line for line in str(shown).splitlines() if "bus 1" in line)
    assert "110 kV; dip 1 at 0.5" in bus
    assert "load step" not in bus
    (row,) = (line for line in str(shown).splitlines() if line.strip().startswith("Q2"))
    assert "load step at 0.3" in row


def test_a_table_that_is_fitted_is_worth_fitting_though_a_longer_ramp_follows_its_dip(tmp_path):
    """A dip of 45 % and a slow swing after it: what `read` makes an event of, no look calls 'no
    dip'.
    """
    t = np.arange(-240, 720) / 240.0
    U = np.where((t >= 0) & (t < 1.29), 0.55, 1.0)
    U = np.where(t >= 1.29, 0.99 + 0.1 * np.clip(t - 1.4, 0.0, 1.5), U)
    path = tmp_path / "swing.csv"
    rows = np.stack([t, U, 0.8 * U**1.5, 0.3 * U**2], axis=1)
    np.savetxt(path, rows, delimiter=",", header="t,U,P,Q", comments="")
    [event] = tractexp.read(path)
    shown = tractexp.look(path)
    [dip] = [one for one in shown.events if one["dip"] == 1]
    assert (dip["kind"], dip["worth"]) == ("dip", True)
    assert dip["start"] == pytest.approx(event.t_start, abs=0.02)
    assert len(shown.commands) == 1
    assert not any("no dip" in one["why"] for one in shown.events)
