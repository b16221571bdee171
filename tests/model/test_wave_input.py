"""What a run in waveforms reads and what it refuses, one sentence each."""

from dataclasses import replace

import numpy as np
import pytest
from made_recordings import RATE, constant, recording, waves

import tractexp
from tractexp.errors import UserError
from tractexp.record import convert_to_waves
from tractexp.recording.feeder import Feeder
from tractexp.recording.measure import FeederWaves

QUICK = {
    "domain": "waves",
    "optimizer": "multistart_least_squares",
    "budget": 60,
    "check_intervals": False,
}


def table(path, columns, rate=RATE):
    """A CSV file of waveforms {name: (N,)}, kV and kA."""
    names = [f"{name} [{'kV' if name[0] == 'u' else 'kA'}]" for name in columns]
    t = np.arange(len(next(iter(columns.values())))) / rate
    rows = np.column_stack([t, *columns.values()])
    np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=",".join(["t", *names]), comments="")
    return path


def columns(rows, names=("ua", "ub", "uc", "ia", "ib", "ic")):
    return dict(zip(names, rows, strict=True))


def sampled(rate, **dip):
    """Waveforms of a constant impedance at another rate."""
    every = RATE / rate
    rows = constant(**dip)
    at = np.arange(0, rows.shape[1] - 1, every)
    return np.stack([np.interp(at, np.arange(rows.shape[1]), row) for row in rows])


def refused(path, match, **settings):
    (dip,) = tractexp.read(path, **settings)
    with pytest.raises(UserError, match=match):
        tractexp.identify(dip, progress=False, **QUICK)


def test_a_record_of_phasors_has_no_waveforms():
    refused("tibet_50pct", "has no waveforms: domain=waves needs the samples.*take domain=phasors")


def test_fewer_than_sixteen_samples_in_a_cycle_are_too_few(tmp_path):
    path = table(tmp_path / "slow.csv", columns(sampled(600.0)), rate=600.0)
    refused(
        path,
        "600 samples per second are 12 per cycle, and domain=waves needs 16; take domain=phasors",
    )


def test_less_than_two_cycles_before_the_dip_are_too_few(tmp_path):
    path = table(tmp_path / "early.csv", columns(constant(start=0.05, end=0.25)))
    refused(
        path,
        r"ms of waveforms before the dip .* needs 2 cycles \(40 ms\).*a record that starts earlier",
    )


def test_a_missing_current_is_reckoned_from_the_others_where_the_connection_says_so(tmp_path):
    rows = constant()
    whole = tractexp.read(table(tmp_path / "whole.csv", columns(rows)))[0]
    two = table(
        tmp_path / "two.csv", columns(rows[[0, 1, 2, 3, 5]], ("ua", "ub", "uc", "ia", "ic"))
    )
    (dip,) = tractexp.read(two, voltages=["ua", "ub", "uc"], currents=["ia", "ic"])
    assert any("minus the sum of the others" in note for note in dip.record.notes)
    np.testing.assert_allclose(
        convert_to_waves(dip).currents[:2], convert_to_waves(whole).currents[:2], atol=1e-6
    )


def test_one_current_of_three_is_refused(tmp_path):
    path = table(tmp_path / "one.csv", columns(constant()[:4], ("ua", "ub", "uc", "ia")))
    with pytest.raises(UserError, match=r"currents=\['ia'\] must name three channels"):
        tractexp.read(path, voltages=["ua", "ub", "uc"], currents=["ia"])


@pytest.mark.parametrize(
    "channels", [{}, {"voltages": ["ua", "ub", "uc"], "currents": ["ia", "ib", "ic"]}]
)
def test_voltage_and_current_of_different_rates_are_refused(tmp_path, channels):
    path = table(tmp_path / "rates.csv", columns(constant()))
    head, *rows = path.read_text().splitlines()
    slower = [
        row if k % 2 == 0 else ",".join([*row.split(",")[:4], "", "", ""])
        for k, row in enumerate(rows)
    ]
    path.write_text("\n".join([head, *slower]))
    told = (
        r"column ia has a number in 10 of its first 20 rows only; voltage and current .* at the"
        r" same times: keep the"
    )
    with pytest.raises(UserError, match=told):
        tractexp.read(path, **channels)


def test_channels_on_other_clocks_are_moved_by_their_skew():
    """What a file says of late channels reaches the waveforms."""
    made = recording(constant())
    late = [replace(c, skew=2e-5) if "I" in c.name else c for c in made.channels]
    made = replace(made, channels=late)
    feeder = Feeder((0, 1, 2), (3, 4, 5), "three_phase")
    assert (
        FeederWaves.from_recording(made, feeder, made.segments[0]).late.tolist()
        == [0.0] * 3 + [2e-5] * 3
    )


def test_every_dip_of_a_file_is_an_event_of_its_own(tmp_path):
    t = np.arange(round(3 * RATE)) / RATE
    U = np.where(((t >= 0.5) & (t < 0.6)) | ((t >= 2.0) & (t < 2.2)), 0.6, 1.0)
    path = table(tmp_path / "two.csv", columns(waves(t, U, 0.8 * U**2, 0.3 * U**2)))
    first, second = map(convert_to_waves, tractexp.read(path))
    assert (first.t_start, second.t_start) == pytest.approx((0.5, 2.0), abs=2e-3)
    assert second.record.t[second.lead] > first.t_end


def test_a_single_phase_feeder_is_read_and_fitted(tmp_path):
    """25 kV: the vector's imaginary part is what the voltage was a quarter of a cycle ago."""
    u, i = constant()[[0, 3]]
    path = table(tmp_path / "feeder.csv", {"u": u * 27.5 / 89.8, "i": i})
    (dip,) = tractexp.read(path, connection="single_phase")
    event = convert_to_waves(dip)
    assert event.phases == 1
    assert event.compared_channels == (True, False, False)
    np.testing.assert_allclose(np.abs(event.v[event.steady]), event.U0, rtol=2e-3)
    fit = tractexp.identify(
        dip,
        tractexp.compose(motor="none", static="branch", domain="waves"),
        progress=False,
        **QUICK,
    )
    assert fit.result.events[0]["epsilon_i"] < 0.12


@pytest.mark.parametrize("ending", [".cfg", ".cff"])
def test_files_of_comtrade_keep_their_samples(tmp_path, ending):
    source = table(tmp_path / "made.csv", columns(constant()))
    tractexp.convert(source, to="cff" if ending == ".cff" else "comtrade", folder=tmp_path / "out")
    (dip,) = tractexp.read(tmp_path / "out" / f"made{ending}")
    event, direct = convert_to_waves(dip), convert_to_waves(tractexp.read(source)[0])
    np.testing.assert_allclose(
        event.currents[:2, event.lead :], direct.currents[:2, direct.lead :], atol=2e-3
    )
