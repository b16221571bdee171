"""The first model of a record in waveforms: what the record shows beside the load is in it, and
nothing else.
"""

from dataclasses import replace
from pathlib import Path

import pytest
import wave_records as waves

import tractexp
from independent.circuit import Earthed, Rectifier
from tractexp.api.compose import resolve_model

STATION = Path(__file__).parents[3] / "shared" / "data" / "dfr220kv-shandong" / "xtz.cfg"
FIRST = {"voltages": [0, 1, 2], "currents": [16, 17, 18]}  # neutral earthed
SECOND = {"voltages": [4, 5, 6], "currents": [8, 9, 10]}  # neutral isolated
QUICK = {
    "domain": "waves",
    "optimizer": "multistart_least_squares",
    "budget": 600,
    "check_intervals": False,
    "progress": False,
}


def shown(events):
    return set(resolve_model(None, "waves").add_shown_effects(events).effects)


def beside(seed, *devices, delta=False):
    """Events of a load that is drawn by lot, with more devices beside it, in
    phase-to-earth faults.
    """
    case = waves.case(seed, kind="phase to earth")
    faults = tuple(replace(fault, delta=delta) for fault in case.faults)
    return waves.events(replace(case, faults=faults, site=replace(case.site, more=devices)), seed)


def test_a_path_to_earth_is_in_the_model_where_the_neutral_is_earthed():
    assert shown(beside([2, 7])) == set()  # the voltage has zero sequence, and nothing is earthed
    assert shown(beside([2, 7], Earthed(0.2, 1.0))) == {"zero_sequence_path"}
    # earthed, and no zero sequence comes in
    assert shown(beside([2, 7], Earthed(0.2, 1.0), delta=True)) == set()


def test_harmonics_that_the_load_draws_are_in_the_model():
    assert shown(beside([2, 7], Rectifier(0.06j, 0.03))) == {"harmonics_source"}
    assert shown(beside([2, 7], Rectifier(0.006j, 0.003))) == set()


def test_a_capacitor_is_in_the_model_of_a_load_that_supplies_reactive_power():
    case = waves.case([2, 7], kind="two phases")
    rich = replace(case, site=replace(case.site, shunt=replace(case.site.shunt, B=1.2)))
    assert shown(waves.events(case, [2, 7])) == set()
    # and harmonics, which it draws of the voltage's
    assert "shunt_capacitor" in shown(waves.events(rich, [2, 7]))


@pytest.mark.parametrize("data", ["tibet_50pct_comtrade", "tibet_65pct_comtrade"])
def test_the_shipped_records_show_nothing_beside_the_load(data):
    assert shown(tractexp.read(data)) == set()


def test_a_model_that_is_asked_for_stays_as_it_is():
    events = beside([2, 7], Earthed(0.2, 1.0))
    for model in (
        resolve_model("fifth_order_branch", "waves"),
        resolve_model(None, "waves").with_(shown_effects=False),
        resolve_model(None),
    ):
        assert model.add_shown_effects(events) is model


def test_a_model_that_has_what_its_records_show_stays_as_it_is():
    events = beside([2, 7], Earthed(0.2, 1.0))
    model = resolve_model(None, "waves").add_shown_effects(events)
    again = model.add_shown_effects(events)
    assert (again.effects, again.shown) == (model.effects, model.shown)


def test_what_carries_the_network_alone_is_told_in_a_line_and_not_in_the_table():
    """The path's susceptance and resistance are found, and the fit leaves nothing but noise."""
    fit = tractexp.identify(beside([2, 7], Earthed(0.2, 1.0)), **QUICK)
    result = fit.result
    assert set(result.shown_effects) == {"zero_sequence_path"}
    assert result.nuisances == {
        n: result.parameters[n] for n in ("zero_susceptance", "zero_resistance")
    }
    one = result.base.ratio  # the generator's base is the file's
    assert result.nuisances["zero_resistance"] == pytest.approx(0.2, rel=0.05)
    assert result.nuisances["zero_susceptance"] * one == pytest.approx(1.0, rel=0.05)
    text = str(fit.summary())
    assert "nuisances of the fit: zero_susceptance" in text
    assert "in the model because the record shows it: zero_sequence_path (zero sequence, " in text
    assert "zero_susceptance" not in [row[0] for row in fit.table().rows]
    assert "of 7 parameters are identified" in text


def test_a_load_with_a_path_to_earth_has_an_operating_point_and_an_export():
    fit = tractexp.identify(beside([2, 7], Earthed(0.2, 1.0)), **QUICK)
    point = fit.operating_point
    assert point is not None
    assert 0 < point.share < 1.2
    assert "zero" not in tractexp.export(fit, "andes", doubtful=True, playback=False).text


@pytest.mark.skipif(not STATION.is_file(), reason="../shared/data is not here")
def test_a_real_station_is_fitted_by_its_default_model():
    """Before the first transformer's path to earth was in it, 219 and 253 % of the current were
    left.
    """
    first, second = (tractexp.read(str(STATION), **channels) for channels in (FIRST, SECOND))
    assert shown(first[:1]) == {"zero_sequence_path", "harmonics_source", "shunt_capacitor"}
    assert shown(second[:1]) == set()
    fit = tractexp.identify(first[:1], validate=first[1:], **QUICK)
    fitted, held_out = (event["epsilon_i"] for event in fit.result.events)
    assert fitted < 0.175
    assert held_out < 0.18
    assert fit.operating_point is not None
    assert 0 < fit.operating_point.share < 1
    assert fit.result.free_optimum["parameters"]["C"] < 0.5  # no machine
