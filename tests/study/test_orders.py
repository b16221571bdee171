"""The orders of a motor as effects: nested in the base model, equal to the higher order at the
other end, named.
"""

import json

import make_contactors
import numpy as np
import pytest
from command_line import run_command
from test_shipped_data import DATA

import tractexp
from tractexp.configuration.choices import set_holding
from tractexp.configuration.plugin import discover, get
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose
from tractexp.record import Record, detect
from tractexp.record.window import average, averaged_power

TRUTH = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "p_v": 1.4,
    "q_v": 3.0,
}
ORDERS = ("rotor_flux", "rotor_speed", "second_cage", "stator_transients")
ONLY = ("stator_transients", "stator_resistance", "dc_link_lag")  # of an investigation of tibet
FEW = ("second_cage", "stator_resistance", "stator_transients")
EXACT = 1e-11  # pu: rounding over 800 samples
# effects beside a base motor, what makes them the motor of higher order, and that motor's own
# parameters
ENDS = [
    (
        "electromechanical",
        ("stator_transients",),
        {"stator_share": 1, "offset_decay": 0},
        "stator_flux",
        {"R_s": 0},
    ),
    (
        "electromechanical",
        ("stator_transients", "stator_resistance"),
        {"stator_share": 1, "offset_decay": 0, "R_s": 0.03},
        "stator_flux",
        {"R_s": 0.03},
    ),
    (
        "electromechanical",
        ("second_cage",),
        {"cage_share": 0.3, "cage_time": 0.004},
        "double_cage",
        {"X_second": 0.7 * 0.25, "T_second": 0.004},
    ),
    (
        "electromechanical",
        ("second_cage",),
        {"cage_share": 0.7, "cage_time": 0.03},
        "double_cage",
        {"X_second": 0.3 * 0.25, "T_second": 0.03},
    ),
    ("mechanical", ("rotor_flux",), {"flux_share": 1}, "electromechanical", {}),
    ("voltage", ("rotor_speed",), {"swing": 1 / 0.006}, "electromechanical", {}),
]


def model(motor, *names):
    effects = [get("effect", name)() for name in names]
    return compose(get("model/motor", motor)(), get("model/static", "exponential")(), effects)


def dip(depth=0.5, step=1e-3, U0=1.0):
    t = np.arange(800) * step
    shape = np.clip((t - 0.1) / 0.02, 0, 1) - np.clip((t - 0.25) / 0.02, 0, 1)
    return Drive.from_events(
        [Excitation(step, U0 - depth * shape, np.ones(800), np.full(800, 0.6), U0, 1.0, 0.6)]
    )


def response(of, drive, **values):
    known = TRUTH | values
    row = np.array(
        [known.get(p.name, p.default if p.null is None else p.null) for p in of.parameters]
    )
    got = of.simulate(drive, row, 8)
    assert (got.miss == 0).all(), of.refusal(row, drive)
    return got.outputs[:, 0]


def drawn(motor, depths=(0.5, 0.3, 0.65), **values):
    """Noisy dips of a load with this motor, as a recorder shows them."""
    rng, found = np.random.default_rng(7), []
    for k, depth in enumerate(depths):
        drive = dip(depth)
        P, Q = response(model(motor), drive, **values) + 0.001 * rng.standard_normal((2, 800))
        record = Record(
            f"dip{k + 1}",
            t=np.arange(800) * 1e-3,
            U=drive.inputs[0],
            P=P,
            Q=Q,
            source=f"made {k + 1}",
        )
        found.append(detect(record.check()))
    return found


@pytest.mark.parametrize("motor", ["electromechanical", "double_cage", "voltage", "mechanical"])
def test_at_their_nulls_they_are_the_base_model_whatever_their_other_parameters(motor):
    for name in ORDERS:
        if model(motor).acceptance(get("effect", name)()).refusal is None:
            with_it, drive = model(motor, name), dip()
            others = {
                p.name: p.bounds[1] for p in get("effect", name)().parameters if p.null is None
            }
            assert (
                np.abs(response(with_it, drive, **others) - response(model(motor), drive)).max()
                < 1e-12
            ), name


@pytest.mark.parametrize(("motor", "names", "there", "higher", "own"), ENDS)
def test_at_their_other_end_they_are_the_motor_of_higher_order(motor, names, there, higher, own):
    drive = dip()
    with_it, motor_itself = (
        response(model(motor, *names), drive, **there),
        response(model(higher), drive, **own),
    )
    assert np.abs(with_it - motor_itself).max() < EXACT
    assert np.abs(with_it - response(model(motor), drive)).max() > 0.01


def test_the_stator_s_offset_rings_at_the_supply_frequency_and_decays_as_told():
    drive, of = dip(), model("electromechanical", "stator_transients")
    ring = (
        response(of, drive, stator_share=1, offset_decay=20)[0]
        - response(model("electromechanical"), drive)[0]
    )
    after = ring[300:700] - average(ring[None], np.r_[0.5, np.ones(19), 0.5] / 20)[0, 300:700]
    power = np.abs(np.fft.rfft(after * np.hanning(400)))
    assert np.argmax(power) * 2.5 == pytest.approx(50, abs=2.6)
    sizes = [np.abs(after[a : a + 40]).max() for a in (0, 100)]
    assert np.log(sizes[0] / sizes[1]) / 0.1 == pytest.approx(20, rel=0.1)


@pytest.mark.parametrize(
    ("motor", "name", "why"),
    [
        ("stator_flux", "stator_transients", "its stator flux moves already"),
        ("mechanical", "stator_transients", "its rotor flux does not move"),
        ("none", "stator_transients", "no stator_impedance"),
        ("double_cage", "second_cage", "its rotor has a second cage already"),
        ("stator_flux", "second_cage", "its stator flux moves"),
        ("mechanical", "second_cage", "its first cage has no flux that moves"),
        ("none", "second_cage", "no stator_current"),
        ("electromechanical", "rotor_flux", "its rotor flux moves already"),
        ("none", "rotor_flux", "no internal_voltage"),
        ("electromechanical", "rotor_speed", "its speed moves already"),
        ("none", "rotor_speed", "no electrical_torque"),
    ],
)
def test_a_motor_that_has_the_balance_or_lacks_what_it_needs_refuses(motor, name, why):
    assert why in model(motor).acceptance(get("effect", name)()).refusal


@pytest.mark.parametrize("name", ["rotor_flux", "second_cage", "stator_transients"])
def test_of_waveforms_they_refuse_and_say_what_to_take(name):
    parts = get("model/motor", "electromechanical")(), get("model/static", "exponential")()
    assert (
        "of waveforms" in compose(*parts, domain="waves").acceptance(get("effect", name)()).refusal
    )


def test_the_order_that_the_load_has_is_named():
    """Here a second cage; of the stator transients test_docs_run and the shipped dips tell it."""
    made = drawn("double_cage", X_second=0.15, T_second=0.01)
    base = tractexp.compose()
    found = tractexp.investigate(made[:2], base, validate=made[2:], effects=FEW, progress=False)
    assert (found.verdict, found.names) == ("named", ("second_cage",)), found.reason
    assert abs(found.gap.validate.closed - 1) < 0.1


# the story a newcomer meets


def test_the_windowed_ring_of_whole_cycles_averages_out_up_to_the_ends_of_the_record():
    t = np.arange(400) * 2e-3
    weights = np.r_[0.5, np.ones(9), 0.5] / 10
    assert np.abs(average(np.cos(2 * np.pi * 50 * t + 0.4)[None], weights)).max() < 1e-12
    assert np.abs(average((0.3 * t)[None], weights) - 0.3 * t).max() < 1e-12  # and a trend goes on
    assert (
        np.abs(averaged_power(np.ones((2, 1, 400)), np.full(400, 0.8 + 0j), weights) - 1).max()
        < 1e-12
    )


@pytest.mark.parametrize("name", ["tibet", "contactors"])
def test_the_sets_are_fitted_on_two_dips_and_held_out_on_a_deeper_one(name):
    shipped = [f"pkg://tractexp.data/{name}_{depth}pct.csv" for depth in (50, 30)]
    assert set_holding(tuple(shipped[:1])) == set_holding(tuple(shipped)) == name
    assert set_holding((f"pkg://tractexp.data/{name}_65pct.csv",)) == ""
    assert set_holding(("dip.csv",)) == ""


def test_the_power_of_what_diverges_is_not_finite_and_warns_nobody():
    power = np.full((2, 1, 400), 1.0)
    power[..., 200:] = np.finfo(float).max
    averaged = averaged_power(power, np.full(400, 0.8 + 0j), np.full(21, 1 / 21))
    assert np.isfinite(averaged[..., 25:150]).all()
    assert not np.isfinite(averaged[..., 250:350]).any()


def test_the_script_makes_the_shipped_contactors(tmp_path):
    made = make_contactors.write(tmp_path)
    assert len(made) == 6
    for path in made:
        there = (DATA / path.name).read_text(encoding="ascii")
        if path.suffix == ".json":
            assert json.loads(path.read_text())["effects"] == json.loads(there)["effects"]
            continue
        new, old = (
            np.loadtxt(text.splitlines(), delimiter=",", skiprows=1)
            for text in (path.read_text(), there)
        )
        # the last of five decimals may round otherwise elsewhere
        assert np.abs(new - old).max() < 1.5e-5


def test_what_it_does_comes_from_another_simulator_s_law():
    told = json.loads((DATA / "contactors_50pct.json").read_text())
    (effect,) = told["effects"]
    assert effect["name"] in discover()["effect"]
    assert not set(effect) & {p.name for p in get("effect", effect["name"])().parameters}


def test_a_table_says_the_window_that_is_stated_of_it():
    """An investigation then tries no other (test_recorder_window)."""
    [event] = tractexp.read("tibet_50pct", estimator="one_cycle")
    assert (event.record.window.name, event.record.window.length) == (
        "one_cycle",
        pytest.approx(0.02),
    )


@pytest.mark.long  # the tutorial, followed in test_docs_run, tells the name and the gap
def test_the_line_of_the_readme_names_the_stator_transients_and_closes_the_gap_on_the_deep_dip(
    tmp_path,
):
    only = f"task.effects=[{','.join(ONLY)}]"
    done = run_command(
        "data=tibet",
        "task=discrepancy",
        only,
        "tracking.enabled=false",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    made = json.loads((tmp_path / "run" / "discrepancy.json").read_text())
    assert made["verdict"] == "named", done.stdout
    # and no skew that the recorder's window looks like
    assert made["effects"] == ["stator_transients"]
    assert (made["complete"], made["remainder"]) == (True, None)
    assert made["phasor_window"] == pytest.approx(0.02)
    truth = json.loads((DATA / "tibet_50pct.json").read_text())["truth"]
    for name, at in made["parameters"].items():
        if name in truth:
            assert abs(at["value"] - truth[name]) < 2 * at["standard_error"], name
    gap = made["gap"]["validate"]
    assert gap["closed"] > 0.9
    assert gap["after"]["epsilon_p"] < 0.5 * gap["before"]["epsilon_p"]


@pytest.mark.long  # the default order is the tutorial's
@pytest.mark.parametrize(("fitted", "window"), [((30, 65), None), ((50, 65), 0.02)])
def test_in_other_orders_no_skew_is_named_either(fitted, window):
    """With its level taken as known, and too few coefficients for an average over ten samples,
    noise passed for an oscillation behind the right window: p 2.7e-4 and 1e-4. In the first order
    that window leaves a skew at p 4e-7, so it is not believed.
    """
    (held,) = {30, 50, 65} - {*fitted}
    train, validate = (
        [f"pkg://tractexp.data/tibet_{depth}pct.csv" for depth in some] for some in (fitted, [held])
    )
    found = tractexp.investigate(train, validate=validate, progress=False)
    assert (found.verdict, found.names) == ("named", ("stator_transients",)), found.reason
    assert found.content["phasor_window"] == (window and pytest.approx(window))
    assert found.content["adequacy"]["grade"] == "adequate"
