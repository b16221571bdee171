"""Priors in a fit: real motors are machines by them, and where nothing but noise is left nothing
moves.
"""

from pathlib import Path

import pytest
import wave_records as waves

import tractexp

STATION = Path(__file__).parents[3] / "shared" / "data" / "dfr220kv-shandong" / "xtz.cfg"
LOADS = {
    "first": {"voltages": [0, 1, 2], "currents": [16, 17, 18]},
    "second": {"voltages": [4, 5, 6], "currents": [8, 9, 10]},
}  # fmt: skip
QUICK = {
    "optimizer": "multistart_least_squares",
    "budget": 600,
    "check_intervals": False,
    "progress": False,
}


def identified(records, priors, **known):
    model = tractexp.compose(**known).with_(priors=priors, physical=False)
    return tractexp.identify(records, model, **QUICK)


def test_where_nothing_but_noise_is_left_no_digit_moves():
    _, events = waves.drawn_events([1, 3])
    free, held = (
        identified(events, priors, model="fifth_order_branch", domain="waves")
        for priors in (False, True)
    )
    assert free.adequate
    assert held.result.parameters == free.result.parameters
    assert held.result.standard_errors == free.result.standard_errors


def test_a_load_as_loads_are_is_not_told_of_machines():
    free = identified(tractexp.read("tibet_50pct"), False)
    assert not any("model.physical" in sentence for sentence in free.advice)


@pytest.mark.skipif(not STATION.is_file(), reason="../shared/data is not here")
@pytest.mark.parametrize("load", ["first", pytest.param("second", marks=pytest.mark.long)])
def test_no_motor_of_a_real_station_is_beyond_its_load(load):
    """Held neither by priors nor by physical ranges the motor draws about three times the load, and
    the static part generates.
    """
    dips = tractexp.read(str(STATION), **LOADS[load])
    effects = ["zero_sequence_path"] * (load == "first")
    free = identified(dips[:1], False, model="fifth_order_branch", domain="waves", effects=effects)
    assert free.operating_point.share > 2
    assert "physical=True" in free.advice[-1]
    for dip in dips:
        held = identified([dip], True, model="fifth_order_branch", domain="waves", effects=effects)
        assert 0.3 < held.operating_point.share < 1.2
        assert held.operating_point.doubt == ""
        assert 0.8 < held.result.parameters["C"] < 0.98
        (note,) = [n for n in held.result.uncertainty["notes"] if "model.priors" in n]
        assert "standard deviations off where it is farthest" in note
        assert not any("physical=True" in sentence for sentence in held.advice)


def contactors(**known):
    """Two dips that the plain model misses by far, and the model that is asked of them."""
    folder = Path(tractexp.__file__).parent / "data"
    dips = [tractexp.read(folder / f"contactors_{depth}pct.csv")[0] for depth in (50, 30, 65)]
    return dips, tractexp.compose().with_(priors=True, **known)


@pytest.mark.long
def test_the_base_model_of_an_investigation_is_that_of_an_identification_with_priors(no_proposal):
    dips, model = contactors(fixed={"C": 0.9}, bounds={"T_m": (0.1, 0.8)})
    alone = tractexp.identify(dips[:2], model, **QUICK)
    found = tractexp.investigate(
        dips[:2], model, validate=dips[2:], effects=["stator_resistance"], progress=False
    )
    context, fit = found.steps.context, found.steps.evidence.base.fit
    assert found.steps.evidence.is_predicted
    at = context.coordinates
    assert "C" not in [at.names[k] for k in at.base]
    for k in at.base:
        own, width = at.box.from_unit(fit.unit)[k], at.box.width[k]
        assert own == pytest.approx(alone.result.parameters[at.names[k]], abs=0.01 * width)
