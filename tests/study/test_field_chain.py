"""From a recorder to parameters: the window that a record was seen through, and the shipped dips as
COMTRADE.
"""

from dataclasses import replace
from pathlib import Path

import make_tibet_comtrade
import numpy as np
import pytest

import tractexp
from tractexp.filetypes import comtrade
from tractexp.record.window import average, sharpen_voltage

DATA = Path(tractexp.__file__).parent / "data"
NAMES = ("tibet_30pct", "tibet_50pct", "tibet_65pct")


def test_a_model_is_looked_at_through_the_window_where_it_follows_what_happens_within():
    """The third order and a record without window are left alone."""
    [event] = tractexp.read("tibet_50pct_comtrade")
    bare = replace(event, record=replace(event.record, window=None))
    for name, looked in (("third_order_exponential", False), ("fifth_order_stator_flux", True)):
        load = tractexp.compose(model=name)
        values = {p.name: p.default for p in load.model.parameters}
        seen, plain = (tractexp.simulate(load, values, records=[e]).P for e in (event, bare))
        assert (np.abs(seen - plain).max() > 1e-3) == looked


def test_the_voltage_reckoned_back_has_the_recorded_average():
    [event] = tractexp.read("tibet_50pct_comtrade", estimator="p_class")
    weights = event.record.window.compute_weights(event.record.step)
    back = sharpen_voltage(event, weights, event.record.window.length).record.U
    inside = slice(len(weights), -len(weights))
    assert np.abs(average(back, weights) - event.record.U)[inside].max() < 5e-3
    assert np.abs(back - event.record.U).max() > 0.01


def test_the_script_makes_the_shipped_comtrade_bit_for_bit(tmp_path):
    made = make_tibet_comtrade.make(tmp_path)
    assert sorted(path.name for path in made) == sorted(
        f"{name}{end}" for name in NAMES for end in (".cfg", ".dat")
    )
    for path in made:
        there = DATA / path.name
        if path.suffix == ".cfg":
            assert path.read_bytes() == there.read_bytes()
        # the last bits of an integration differ by platform, and a step of the converter with them
        else:
            raw = [
                np.frombuffer(p.read_bytes(), np.uint8).reshape(-1, 18)[:, 8:16].view("<i2")
                for p in (path, there)
            ]
            assert np.abs(raw[0].astype(int) - raw[1]).max() <= 1
        assert there.stat().st_size < 300_000


@pytest.mark.parametrize("name", NAMES)
def test_a_dip_as_comtrade_is_the_dip_as_csv(name):
    """The same load, dip and time; only the noise is another."""
    [csv], [event] = tractexp.read(name), tractexp.read(f"{name}_comtrade")
    record, power, voltage = (
        event.record,
        event.record.base.power / 10.0,
        event.record.base.voltage / 27.5,
    )
    assert record.window.name == "one_cycle"
    assert voltage == pytest.approx(1, abs=1e-3)
    for mine, theirs, scale in (("U", "U", voltage), ("P", "P", power), ("Q", "Q", power)):
        values = np.interp(csv.record.t, record.t - 0.02, scale * getattr(record, mine))
        inside = (csv.record.t > 0.02) & (csv.record.t < 1.98)
        off = (values - getattr(csv.record, theirs))[inside]
        assert np.sqrt(np.mean(off**2)) < 3e-3
        assert abs(off.mean()) < 5e-4


def test_the_recorder_has_four_channels_and_says_what_it_is():
    recording = comtrade.load(DATA / "tibet_50pct.cfg")
    assert [channel.name for channel in recording.channels] == ["UAB", "UBC", "IA", "IC"]
    assert "not measured" in recording.station
    assert recording.segments[0].rate == 4000
