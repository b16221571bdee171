"""Whatever unit of power a record is in, it is fitted on the base of its load and told on that of
its file.
"""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run_command
from conftest import MOTOR
from made_recordings import constant
from test_wave_input import columns, table

import tractexp
from tractexp.cache.provenance import hash_record
from tractexp.errors import UserError
from tractexp.exchange.format import Identified
from tractexp.record import Base, OwnBase, WaveEvent, convert_to_waves, detect, rebase_events
from tractexp.record.own_base import convert_base
from tractexp.tracking.model import Predictor

QUICK = {"name": "multistart_least_squares", "starts": 2}
ASKED = {
    "model": "third_order_exponential",
    "optimizer": QUICK,
    "check_intervals": False,
    "progress": False,
}
EXPONENTS = {"X_prime": -1, "M": 1, "T_m": 1}
SYSTEM = 100.0  # MVA


def scaled(record, k, **base):
    """The record on a base of a k-th of the power, of which nobody says what it is, or whose MVA
    are given.
    """
    base = dataclasses.replace(record.base, **base)
    return dataclasses.replace(record, P=k * record.P, Q=k * record.Q, base=base)


def on_base(values, k):
    return {name: value * k ** EXPONENTS.get(name, 0) for name, value in values.items()}


def close(one, other, rel):
    assert one.keys() == other.keys()
    for name, value in other.items():
        assert one[name] == pytest.approx(value, rel=rel, abs=1e-9), name


@pytest.fixture(scope="module")
def records():
    """Two dips of one load that draws S = 1.17 pu before them, the second of less load; noise of
    0.1 %.
    """
    load, noise, made = tractexp.compose(), np.random.default_rng(3), []
    for depth, share in ((0.4, 1.0), (0.5, 0.8)):
        values = MOTOR | {"T_m": share * MOTOR["T_m"]}
        run = tractexp.simulate(
            load, values, depth=depth, rate=200, length=2, P0=share, Q0=0.6 * share
        )
        P, Q = (power + 1e-3 * noise.standard_normal(len(power)) for power in (run.P, run.Q))
        made.append(tractexp.read(t=run.t, U=run.U, P=P, Q=Q, name=f"dip{len(made) + 1}")[0].record)
    return made


@pytest.fixture(scope="module")
def fits(records):
    """Identified with the file on three bases, in per unit of the load's P, of a system, and of
    something large.
    """
    return {
        k: tractexp.identify(scaled(records[0], k), validate=scaled(records[1], k), **ASKED)
        for k in (1.0, 5.04, 0.02)
    }


def test_what_is_on_the_base_of_its_load_stays_as_it_is(records):
    shipped = tractexp.read("tibet_50pct", "tibet_30pct")
    assert all(one is other for one, other in zip(rebase_events(shipped), shipped, strict=True))
    for k in (1.04, 1 / np.hypot(1, 0.6), 0.6, 0.45):  # of its P, its S, its rating
        event = detect(scaled(records[0], k))
        assert rebase_events([event])[0] is event
    for k in (0.4, 1.1, -1.1):
        moved = rebase_events([detect(scaled(records[0], k))])[0]
        assert np.hypot(moved.P0, moved.Q0) == pytest.approx(1, rel=1e-12)


def test_a_base_that_was_the_steady_state_of_the_load_is_its_own(records, tmp_path):
    """The second dip of a file is fitted on the base of the first, as a reader took it."""
    loud = detect(scaled(records[0], 0.4, power=20.0, origin="load"))
    assert rebase_events([loud])[0] is loud
    given = detect(scaled(records[0], 0.4, power=20.0))
    assert rebase_events([given])[0].record.base.power == pytest.approx(
        20 * np.hypot(given.P0, given.Q0), rel=1e-12
    )
    path = tmp_path / "megawatts.csv"
    rows = np.column_stack(
        [records[0].t, 27.5 * records[0].U, 12 * records[0].P, 12 * records[0].Q]
    )
    np.savetxt(path, rows, delimiter=",", header="t [s],U [kV],P [MW],Q [Mvar]", comments="")
    read = tractexp.read(path)[0]
    assert read.record.base.origin == "load"
    assert rebase_events([read])[0] is read
    tractexp.convert(read, to="csv", folder=tmp_path / "tidy")
    assert tractexp.read(next((tmp_path / "tidy").glob("*.csv")))[0].record.base.origin == "load"


def test_all_events_of_a_call_are_put_on_one_base(records):
    first, second = (detect(scaled(record, 4.0)) for record in records)
    one, other = rebase_events([first, second])
    S = np.hypot(first.P0, first.Q0)
    assert np.array_equal(one.record.P, first.record.P / S)
    assert np.array_equal(other.record.Q, second.record.Q / S)
    assert pytest.approx(second.P0 / S, rel=1e-12) == other.P0
    assert (one.record.original_base, one.record.base.power) == (Base(), S)
    assert other.record.notes[-1] == (
        f"put on a base of {S:.4g} pu of the file, the apparent power before the first dip that is"
        " fitted: on the"
        f" file's base powers, torque and inertia are {S:.5g} times, impedances {1 / S:.5g} times"
        " the values on this"
        " base"
    )
    again = rebase_events([other, one])  # an event that was put on a base stays on it
    assert again[0] is other
    assert again[1] is one


def test_records_of_other_megavolt_amperes_are_put_on_that_of_the_first(records):
    first = detect(scaled(records[0], 5.0, power=SYSTEM))
    second = detect(scaled(records[1], 1.0, power=500.0))
    one, other = rebase_events([first, second])
    assert one.record.base.power == other.record.base.power
    assert pytest.approx(0.8, rel=1e-2) == other.P0 / one.P0
    assert "on the file's base (100 MVA)" in one.record.notes[-1]
    unknown = detect(dataclasses.replace(scaled(records[1], 5.0), source="b.csv"))
    for pair in ([first, unknown], [unknown, first]):
        with pytest.raises(
            UserError,
            match=r"b\.csv does not say how many MVA .* per unit of 100 MVA.*say it of both",
        ):
            rebase_events(pair)


def test_harmonics_go_with_power_and_distortion_stays(records):
    more = {"P_3": 0.2 * records[0].P, "THD_u": 0.03 + 0 * records[0].P}
    event = detect(dataclasses.replace(scaled(records[0], 4.0), more=more))
    made = convert_base(event, 2.0, OwnBase(2.0)).record
    assert np.array_equal(made.more["P_3"], more["P_3"] / 2)
    assert np.array_equal(made.more["THD_u"], more["THD_u"])


def test_the_unit_of_the_file_does_not_move_the_estimate(fits):
    plain = fits[1.0].result
    for k, fit in fits.items():
        result = fit.result
        own = result.base.ratio / k  # of the first base
        close(result.parameters, on_base(plain.parameters, 1 / own), 1e-5)
        assert result.epsilon_q == pytest.approx(plain.epsilon_q, rel=1e-5)
        assert result.events[1]["epsilon_p"] == pytest.approx(
            plain.events[1]["epsilon_p"], rel=1e-5
        )
        assert not result.at_bound
    assert fits[1.0].result.parameters_on_given_base == {}
    assert fits[5.04].result.base.ratio == pytest.approx(5.04 * np.hypot(1, 0.6), rel=1e-3)


def test_values_are_told_on_the_base_of_the_file(fits):
    fit, plain = fits[5.04], fits[1.0].result
    close(fit.result.parameters_on_given_base, on_base(plain.parameters, 5.04), 1e-5)
    close(
        {n: e.value for n, e in fit.on_given_base.items()},
        fit.result.parameters_on_given_base,
        1e-12,
    )
    inertia, own = fit.on_given_base["M"], fit.parameters["M"]
    ratio = fit.result.base.ratio
    assert inertia.bounds == pytest.approx([ratio * bound for bound in own.bounds])
    assert inertia.standard_error == pytest.approx(ratio * own.standard_error)
    assert inertia.interval == pytest.approx([ratio * end for end in own.interval])
    said = f"base: X_prime = {fit.result.parameters_on_given_base['X_prime']:.5g}, M = "
    assert f"on the file's {said}" in repr(fit)
    assert said in fit.report().html
    assert "on the file's base" not in repr(fits[1.0])
    assert fits[1.0].on_given_base == fits[1.0].parameters


def test_the_result_says_what_one_per_unit_is(records):
    event = dataclasses.replace(
        scaled(records[0], 5.0, power=SYSTEM, voltage=230.0), source="north.csv"
    )
    (told,) = tractexp.identify(event, **ASKED, budget=200).result.records
    assert told["source"] == {"file": "north.csv"}
    assert told["given_base"] == {
        "voltage_kV": 230.0,
        "power_MVA": 100.0,
        "frequency_Hz": 50.0,
        "origin": "given",
    }
    S = np.hypot(1, 0.6)
    assert told["base"] == told["given_base"] | {
        "power_MVA": pytest.approx(500 * S, rel=1e-3),
        "origin": "load",
    }
    (unknown,) = tractexp.identify(records[0], **ASKED, budget=200).result.records
    assert unknown["base"]["power_MVA"] is unknown["base"]["voltage_kV"] is None
    assert "given_base" not in unknown


def test_bounds_mean_the_own_base(records):
    record = scaled(records[0], 5.04)
    fit = tractexp.identify(record, bounds={"T_m": [0.1, 0.9]}, fixed={"M": 0.005}, **ASKED)
    assert fit.result.bounds["T_m"] == [0.1, 0.9]
    assert 0.1 < fit.result.parameters["T_m"] < 0.9
    assert fit.result.parameters["M"] == 0.005
    assert fit.result.parameters_on_given_base["M"] == pytest.approx(0.005 * fit.result.base.ratio)
    with pytest.raises(
        UserError,
        match=r"could be simulated: .*bounds .*which are meant on the record's own base of 5\.8",
    ):
        tractexp.identify(
            record, bounds={"T_m": [2.5, 3.0]}, fixed={"X_prime": 1.4}, **ASKED, budget=50
        )


def test_units_of_the_user_in_and_out(records, fits):
    fit, plain, held = fits[5.04], fits[1.0], scaled(records[1], 5.04)
    answer = fit.predict(held)
    assert np.allclose(answer.measured[0], held.P, rtol=1e-12)
    assert np.allclose(answer.P, 5.04 * plain.predict(records[1]).P, rtol=1e-4)
    assert answer.notes == held.notes
    # put on the own base already, and told on that of its file
    from_own = fit.predict(fit.setup.validate[0])
    assert np.allclose(from_own.P, answer.P, rtol=1e-12)
    t, U = held.t, held.U
    by_hand = fit.predict(t=t, U=U, P0=4.0, Q0=2.4)
    assert by_hand.P[0] == pytest.approx(4.0, rel=1e-3)
    assert np.allclose(by_hand.P, fit.result.predict(t, U, P0=4.0, Q0=2.4)[0])
    pandas = pytest.importorskip("pandas")
    framed = Predictor(fit.result).predict(pandas.DataFrame({"t": t, "U": U}))
    assert np.allclose(framed["P"], fit.predict(t=t, U=U).P)
    assert framed["P"].to_numpy()[0] == pytest.approx(5.04, rel=5e-3)
    played = tractexp.simulate(fit, records=held)
    assert np.array_equal(played.P, answer.P)
    dip = tractexp.simulate(fit, depth=0.3)
    assert dip.P[0] == pytest.approx(5.04, rel=5e-3)
    assert tractexp.simulate(fit, depth=0.3, P0=4.0, Q0=2.0).Q[0] == pytest.approx(2.0, rel=1e-9)


def test_a_model_without_an_identification_is_played_in_the_units_of_its_values(records, fits):
    fit, held = fits[5.04], scaled(records[1], 5.04)
    played = tractexp.simulate(
        "third_order_exponential", fit.result.parameters_on_given_base, records=held
    )
    assert np.allclose(played.P, fit.predict(held).P, rtol=1e-6)


def test_an_event_whose_base_is_said_is_taken_in_megavolt_amperes(records):
    fit = tractexp.identify(scaled(records[0], 5.0, power=SYSTEM), **ASKED, budget=500)
    of_system, of_load = (fit.predict(scaled(records[1], k, power=500.0 / k)) for k in (5.0, 1.0))
    assert np.allclose(of_system.P, 5 * of_load.P, rtol=1e-9)


def test_what_is_saved_comes_back_on_its_bases(fits, records, tmp_path):
    fit, held = fits[5.04], scaled(records[1], 5.04)
    again = tractexp.load(fit.save(tmp_path / "fit.json"))
    assert again.result == fit.result
    assert again.setup.train[0].record.original_base == Base()
    assert again.result.records[0]["sha256"] == hash_record(
        scaled(records[0], 5.04)
    )  # as it was read
    assert hash_record(again.setup.train[0].record) == again.result.records[0]["sha256"]
    assert again.setup.train[0].record.base == fit.setup.train[0].record.base
    assert np.array_equal(again.predict(held).P, fit.predict(held).P)
    fit.result.write(tmp_path / "result.json")
    bare = tractexp.load(tmp_path / "result.json")
    assert np.array_equal(bare.predict(held).P, fit.predict(held).P)
    old = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    for key in ("own_base", "parameters_on_given_base"):  # a file of an earlier version
        del old[key]
    (tmp_path / "result.json").write_text(json.dumps(old), encoding="utf-8")
    assert tractexp.load(tmp_path / "result.json").result.base.ratio == 1


def test_a_plan_takes_the_values_of_an_identification_in_its_base(records, fits, tmp_path):
    fit, heavier = fits[5.04], scaled(records[1], 5.04)
    path = fit.result.write(tmp_path / "result.json")
    given, read = (
        tractexp.plan(heavier, parameter="M", values=values) for values in (fit, str(path))
    )
    assert given.content["parameters"] == read.content["parameters"]
    close(given.content["parameters"], on_base(fit.result.parameters, 1 / 0.8), 5e-3)


def test_waveforms_are_rebased_with_their_record(tmp_path):
    event = convert_to_waves(tractexp.read(table(tmp_path / "waves.csv", columns(constant())))[0])
    made = convert_base(event, 2.0, OwnBase(2.0))
    assert isinstance(made, WaveEvent)
    assert np.allclose(made.currents, event.currents / 2, rtol=1e-9, equal_nan=True)
    assert made.peaks[1] == pytest.approx(2 * event.peaks[1])
    assert pytest.approx(event.P0 / 2) == made.P0


@pytest.mark.parametrize("form", ["andes", "psse_dyr", "modelica"])
def test_an_export_is_on_either_base(fits, form):
    fit, ratio = fits[5.04], fits[5.04].result.base.ratio
    own, file = (
        tractexp.export(fit, form, base=base, power=SYSTEM, voltage=230, playback=False)
        for base in ("own", "file")
    )
    assert f"per unit of {SYSTEM * ratio:.6g} MVA and 230 kV, the record's own base" in own.notes
    assert "per unit of 100 MVA and 230 kV, the base of the record's file" in file.notes
    for made, mva in ((own, SYSTEM * ratio), (file, SYSTEM)):
        texts = {
            "andes": f'"Sn": {mva!r}',
            "psse_dyr": f"{mva:.8g}",
            "modelica": f"per unit of {mva:.6g} MVA",
        }
        assert texts[form] in made.text
    if form == "andes":
        (one,), (other,) = (json.loads(made.text)["Motor3"] for made in (own, file))
        assert other["xs"] == pytest.approx(one["xs"] / ratio)
        assert other["Hm"] == pytest.approx(one["Hm"] * ratio)
        (one,), (other,) = (json.loads(made.text)["PQ"] for made in (own, file))
        assert one["p0"] == pytest.approx(other["p0"], rel=1e-9)


def test_an_export_says_which_base_it_takes(records, fits):
    known = tractexp.identify(
        scaled(records[0], 5.0, power=SYSTEM, voltage=230.0), **ASKED, budget=200
    )
    assert (
        "per unit of 230 kV and 583.111 MVA"
        in tractexp.export(known, "andes", playback=False).notes[0]
    )
    assert (
        json.loads(tractexp.export(known, "andes", base="file", playback=False).text)["Motor3"][0][
            "Sn"
        ]
        == SYSTEM
    )
    assert json.loads(tractexp.export(known, "andes", playback=False).text)["Bus"][0]["Vn"] == 230.0
    guessed = "1 pu of the file is taken for 100 MVA, for no power is given"
    assert any(
        guessed in note for note in tractexp.export(fits[5.04], "andes", playback=False).notes
    )
    with pytest.raises(UserError, match=r"base=system is not one of machine, own, file"):
        tractexp.export(known, "andes", base="system")
    assert Identified(known.result).values == known.result.parameters


def test_the_command_line_tells_both_bases(records, tmp_path):
    record = scaled(records[0], 5.04)
    rows = np.column_stack([getattr(record, name) for name in "tUPQ"])
    np.savetxt(tmp_path / "north.csv", rows, delimiter=",", header="t,U,P,Q", comments="")
    units, base = (
        "data.units={U: pu, P: pu, Q: pu}",
        ["data.base_power=100", "data.base_voltage=230"],
    )
    run = [
        "data=csv",
        "data.train=[north.csv]",
        units,
        *base,
        "optimizer=multistart_least_squares",
        "optimizer.starts=2",
    ]
    done = command(
        tmp_path, "--all", *run, "tracking.enabled=false", "task.figures=false", "hydra.run.dir=run"
    )
    assert "on the file's base (100 MVA): X_prime = " in done
    told = json.loads((tmp_path / "run" / "result.json").read_text(encoding="utf-8"))
    assert told["records"][0]["given_base"]["power_MVA"] == 100
    assert told["parameters_on_given_base"]["T_m"] == pytest.approx(5.04 * 0.55, rel=0.05)
    exported = command(
        tmp_path,
        "task=export",
        "task.parameters=run/result.json",
        "task.base=file",
        "hydra.run.dir=out",
    )
    assert "note: per unit of 100 MVA and 230 kV, the base of the record's file" in exported


def command(folder, *arguments):
    done = run_command(*arguments, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout.replace("\n", " ").replace("  ", " ")


@pytest.fixture
def andes():
    folder = Path(__file__).parents[3] / "shared" / "cases" / "andes"
    if not folder.is_dir():
        pytest.skip("the dips of ANDES are not beside the repository (shared/cases/andes)")
    return [tractexp.read(folder / f"dip_{name}.csv", frequency=60)[0].record for name in "ac"]


def test_a_load_in_per_unit_of_a_system_is_found_as_in_its_own(andes):
    """P0 = 5.05 pu of 100 MVA: within bounds that mean P0 = 1, the torque rested on
    its bound of 1.
    """
    fitted, held = andes
    system = tractexp.identify(fitted, validate=held, **ASKED).result
    own = tractexp.identify(
        scaled(fitted, 1 / 5.04), validate=scaled(held, 1 / 5.04), **ASKED
    ).result
    assert own.base.ratio == 1
    assert system.base.ratio == pytest.approx(5.264, rel=1e-3)
    assert "T_m" not in system.at_bound
    close(
        system.search["parameters"],
        on_base(own.search["parameters"], 5.04 / system.base.ratio),
        1e-6,
    )
    close(system.parameters, on_base(own.parameters, 5.04 / system.base.ratio), 1e-5)
    close(system.parameters_on_given_base, on_base(own.parameters, 5.04), 1e-5)
    assert system.events[1]["epsilon_q"] == pytest.approx(own.events[1]["epsilon_q"], rel=1e-4)
