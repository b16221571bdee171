"""The investigation, `investigate`: what is planted is named, what is not there is not, and the
linear algebra behind it is right.

Records come from the independent generator of `tests/oracle/hidden_effects`; only a few effects are
tested against each other here, so that the tests stay short. The study over the whole catalogue is
`benchmarks/hidden_effects_study.py`.
"""

import json
import re
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import run_command
from scipy.special import chdtrc
from screens import LINES, WIDTH, count_rows
from written_out import dense_normal

from hidden_effects import Case, Noise, Recorder, make, write
from tractexp.cache import store
from tractexp.configuration.plugin import get
from tractexp.discrepancy import explanations
from tractexp.discrepancy.all_events import AllEvents
from tractexp.discrepancy.decide import holds, needs_all_events
from tractexp.discrepancy.disagreement import disagreement, examine_fit
from tractexp.discrepancy.discrepancy_json import content, write_left, write_model
from tractexp.discrepancy.explanations import beneath, search_effect_sets, without_needless
from tractexp.discrepancy.held_out import assess, carry_fits, compare_on
from tractexp.discrepancy.investigate import investigate
from tractexp.discrepancy.judgement import judgements
from tractexp.discrepancy.recommend import recommendation
from tractexp.errors import UserError
from tractexp.inference import kernels, multistart, residual_statistics
from tractexp.inference.base_fit import base_fit
from tractexp.inference.catalogue import catalogue
from tractexp.inference.chance import BLURRED, scales
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.fit_effort import FITS_AT_ONCE
from tractexp.inference.fitting import Refit, refit
from tractexp.inference.goodness_of_fit import GoodnessOfFit, Scale, tail
from tractexp.inference.injection import PUSHES
from tractexp.inference.least_squares import normal
from tractexp.inference.linearization import tangent
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records, check_events
from tractexp.inference.score_test import ScoreTest, signed_drop
from tractexp.inference.separable import SeparableColumns
from tractexp.model.model import compose
from tractexp.noise import Autoregression, white_noise
from tractexp.noise import Noise as PowerNoise
from tractexp.noise.quiet import estimate
from tractexp.noise.random_walk import Load, RandomWalk, Rest, find
from tractexp.noise.voltage import smooth_voltage
from tractexp.record import Record, detect

FEW = ("stator_resistance", "speed_dependent_torque", "exponential_recovery")
SLOW = Recorder(rate=250.0, samples=500)  # an investigation takes as long as there are samples
FAST = Recorder()  # 500 samples a second, where half of them do not show what is to be shown
QUIET, LOUD = Noise(0.002), Noise(0.005)


def base():
    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


def events(effect=None, size=1.0, seed=3, count=2, noise=QUIET, recorder=SLOW, **settings):
    records = make(
        Case(effect, size, events=count, noise=noise, recorder=recorder, **settings), seed
    )
    return [
        detect(Record(f"event{k + 1}", **r, source=f"made {k + 1}").check())
        for k, r in enumerate(records)
    ]


def bench(model, made, only=FEW, bounds=None):
    missing = catalogue(model, made, only)
    return Context.from_records(
        model, missing, Records.from_events(made), bounds or {}, {}, Criteria(), Effort()
    )


def steady(samples):
    """A load that takes the same power throughout, in one event."""
    return Load(np.tile([[1.0], [0.0]], samples), np.array([[1.0, 0.0]]))


@pytest.fixture(scope="module")
def silent():
    return investigate(base(), events(), (), {}, {}, only=FEW)


def test_names_the_effect_that_was_planted(planted):
    assert planted.verdict.word == "named"
    assert planted.names == ("stator_resistance",)
    assert planted.first.p_left < 0.01


def test_stays_silent_when_nothing_is_missing(silent):
    assert silent.verdict.word == "none"
    assert silent.names == ()
    assert silent.places == ()
    assert content(silent)["phasor_window"] is None
    assert silent.train.after.chi2_per_sample == pytest.approx(1.0, abs=0.1)


def test_the_base_model_is_fitted_in_the_better_of_two_valleys(monkeypatch):
    """Where the reactive static load may stand for a part of the motor's, the box alone led to the
    worse side.
    """
    made = events(
        "feeder_impedance", size=0.6377, seed=287367529, count=4, noise=LOUD, recorder=FAST
    )[:3]
    best = base_fit(bench(base(), made, ())).fit.deviance
    monkeypatch.setattr(multistart, "along_least_certain", lambda likelihood, unit: unit[None])
    assert base_fit(bench(base(), made, ())).fit.deviance > best + 100


def test_descents_on_several_cores_say_how_many_have_ended(monkeypatch):
    @contextmanager
    def parts(total):
        counted.append(total)
        yield lambda: counted.append("ended")

    counted = []
    fit = base_fit(bench(base(), events(noise=LOUD)))
    monkeypatch.setattr(fit.context.effort, "parts", parts)
    starts = [((name,), fit.fit.unit) for name in FEW] * FITS_AT_ONCE
    # what was fitted before is read back at once
    monkeypatch.setattr(store.DESCENTS, "read", lambda key: None)
    refit(fit.context, fit.noise, starts)
    assert counted == [3, "ended", "ended", "ended"]


def test_another_is_named_as_well():
    effect = "speed_dependent_torque"
    found = investigate(
        base(), events(effect, size=2.0), (), {}, {}, only=("stator_resistance", effect)
    )
    assert (found.verdict.word, found.names) == ("candidate", (effect,))
    assert found.reason.endswith("; no event was held out to confirm it")
    assert "record a further dip as deep as event" in recommendation(
        found
    ) or "hold out event" in recommendation(found)


def test_what_explains_as_well_is_told_as_a_tie_with_the_dip_that_decides():
    """A feeder's reactance at the bus does what a stator's resistance does, until a dip is deep."""
    alike = ("stator_resistance", "feeder_impedance")
    found = investigate(base(), events("stator_resistance", noise=LOUD), (), {}, {}, only=alike)
    assert found.verdict.word == "tied"
    assert {*found.verdict.sets} == {(name,) for name in alike}
    told = "either explains the disagreement, and these events cannot tell them apart; 2 classes:"
    assert f"{told} they predict alike in milder dips" in found.reason
    assert found.next_event.probability > 0.9
    made = content(found)
    assert (made["verdict"], made["effects"]) == ("tied", [*found.names])
    assert made["recommendation"] == found.next_event.sentence()


def test_the_gap_shrinks_on_fitted_and_on_held_out_events(planted):
    for gap in (planted.train, planted.validate):
        assert gap.after.epsilon_p < gap.before.epsilon_p
        assert gap.after.chi2_per_sample < gap.before.chi2_per_sample
        assert gap.closed_share > 0.9
        assert gap.gain > 0
    assert planted.train.after.chi2_per_sample == pytest.approx(1.0, abs=0.1)


def test_the_place_found_is_the_dip_and_what_follows(planted):
    event = planted.context.events[0]
    assert planted.places
    assert all(p.end > event.t_start - 0.05 for p in planted.places)
    assert sum(p.share for p in planted.places) > 0.5


def test_every_effect_is_judged_and_what_cannot_be_seen_is_said(planted):
    judged = {j.name: j for j in judgements(planted)}
    assert judged["stator_resistance"].status == "relevant"
    assert {"time_skew", "measurement_window", "load_change"} <= judged.keys()
    silent_channels = catalogue(base(), planted.context.events).untestable
    assert "not recorded" in silent_channels["frequency_dependence"]
    assert "U2" in silent_channels["negative_sequence_braking"]


def test_the_contract_holds_what_machines_read(planted, tmp_path):
    made = json.loads(json.dumps(content(planted), default=str))
    assert made["verdict"] == "named"
    assert made["effects"] == ["stator_resistance"]
    assert made["name_sets"] == [["stator_resistance"]]
    assert {"event", "channel", "start", "end", "share"} == made["where"][0].keys()
    for role in ("train", "validate"):
        assert {"model_error", "epsilon_p", "epsilon_q", "chi2_per_sample"} == made["gap"][role][
            "before"
        ].keys()
    candidate = next(c for c in made["candidates"] if c["effects"] == ["stator_resistance"])
    assert {"status", "likelihood_ratio", "parameters"} <= candidate.keys()
    assert min(made["left"].values()) > 0.001
    node = {
        "motor": {"name": "electromechanical"},
        "static": {"name": "exponential"},
        "bounds": {},
        "fixed": {},
    }
    path = write_model(planted, node, tmp_path / "model" / "extended.yaml")
    assert "effects:\n- stator_resistance" in path.read_text()


def test_a_score_is_the_drop_of_the_refitted_linear_problem():
    """(s'r)^2/s's equals the difference of two least-squares fits, with and without the column."""
    rng = np.random.default_rng(5)
    N, s, r = rng.normal(size=(200, 6)), rng.normal(size=200), rng.normal(size=200)
    Q, _ = np.linalg.qr(N)
    off = lambda y: y - Q @ (Q.T @ y)  # noqa: E731
    drop, p = signed_drop(off(s)[None], off(r)[None], np.array([0]))
    without = np.linalg.lstsq(N, r, rcond=None)[1][0]
    both = np.linalg.lstsq(np.column_stack([N, s]), r, rcond=None)[1][0]
    assert drop[0] == pytest.approx(without - both, rel=1e-9)
    assert p[0] == pytest.approx(chdtrc(1, without - both), rel=1e-9)


def test_a_size_that_may_only_grow_has_half_of_its_chi_square():
    rng = np.random.default_rng(6)
    s, r = rng.normal(size=100), rng.normal(size=(4000, 100))
    drops, p = signed_drop(s[None], r, np.array([1]))
    assert np.mean(drops == 0) == pytest.approx(0.5, abs=0.03)
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.01)


def test_noise_that_is_drawn_is_noise_that_is_found():
    """Correlated channels, one of them colored: mix, level and color come back from a
    long stretch.
    """
    mix = np.linalg.inv(np.array([[0.004, 0.0], [0.002, 0.003]]))
    color = Autoregression(np.array([[0.0], [0.8]]), np.array([1.0, 0.6]))
    noise = PowerNoise(((color, white_noise(1.0)),), mix)
    drawn = noise.draw(np.random.default_rng(7), 1, [40000])[0]
    found = estimate(drawn, np.ones(drawn.shape, dtype=bool), [slice(0, 40000)])
    covariance = np.linalg.inv(mix) @ np.linalg.inv(mix).T
    assert np.cov(drawn) == pytest.approx(covariance, rel=0.1)
    assert found.pair(0)[0].coefficients[-1, 0] == pytest.approx(0.8, abs=0.03)


def test_a_recurrence_is_undone_by_its_own_whitening():
    color = Autoregression(
        np.array([[0.0, 0.0], [0.6, 0.0], [0.9, -0.3]]), np.array([1.5, 1.2, 1.0])
    )
    shocks = np.random.default_rng(0).standard_normal((3, 50))
    made = color.color_shocks(shocks)
    assert made[:, 0] == pytest.approx(shocks[:, 0])
    assert color.whiten(made, np.ones(50, dtype=bool))[:, 2:] == pytest.approx(shocks[:, 2:])


def test_a_load_that_wanders_is_seen_before_the_events_and_steady_noise_is_not():
    rng = np.random.default_rng(8)
    calm = lambda: [rng.normal(size=(2, 250)) for _ in range(3)]  # noqa: E731
    spoken = sum(find(calm(), 0.002, steady(250)) is not None for _ in range(150))
    # half a chi-square of one degree beyond 2, less what fast noise takes: 6 %
    assert 0.03 < spoken / 150 < 0.1
    walks = [
        w + np.cumsum(rng.normal(size=(2, 250)) * np.array([[0.05], [0.0]]), axis=1) for w in calm()
    ]
    found = find(walks, 0.002, steady(250))
    assert 1.0 < found.intensity[0] / (0.05**2 / 0.002) < 2.0  # the larger end of its interval
    assert found.intensity[1] < found.intensity[0] / 2


def test_heavy_tails_are_drawn_beyond_what_the_quiet_samples_showed():
    """Quantiles of the law stand for few samples of Student's t; normal and quantised samples stand
    for themselves.
    """
    rng = np.random.default_rng(8)
    whole = slice(0, 400)
    drawn = lambda rows: estimate(rows, np.ones((2, 400), dtype=bool), [whole]).shocks  # noqa: E731
    heavy = drawn(rng.standard_t(4, (2, 400)))
    assert all(len(channel) > 400 and 8 < channel.max() < 30 for channel in heavy)
    assert all(channel.std() == pytest.approx(1.0) for channel in heavy)
    for rows in (rng.normal(size=(2, 400)), np.round(2 * rng.normal(size=(2, 400)))):
        assert all(len(channel) <= 400 for channel in drawn(rows))


@pytest.mark.parametrize(("shape", "p"), [(0.0, 0.01), (0.3, 0.01), (0.3, 0.001)])
def test_the_largest_of_many_has_the_tail_of_its_own_law(shape, p):
    """Draws from SciPy's extreme value distributions, light and heavy tails: the p of a known
    quantile comes out.
    """
    from scipy.stats import genextreme

    law = genextreme(-shape, 2.0, 3.0)
    rng = np.random.default_rng(5)
    unit = Scale(np.zeros(1), np.ones(1))
    found = [
        tail(law.rvs((199, 1), random_state=rng), np.array([law.isf(p)]), unit) for _ in range(40)
    ]
    assert np.median(found) == pytest.approx(p, rel=0.3)


def test_noise_of_a_wandering_load_is_white_once_whitened():
    """Draws that wander come out of the whitening with unit variance, also in their slow sums."""
    power = np.stack([np.where(np.arange(600) < 300, 1.0, 0.5), np.zeros(600)])
    wander = RandomWalk(np.array([2.0, 0.0]), 0.002, Load(power, np.array([[1.0, 0.0]])))
    noise = PowerNoise(PowerNoise.white(1.0, 1.0).pairs, random_walk=wander)
    drive = SimpleNamespace(
        events=1, samples=600, part=lambda e: slice(0, 600), parts=[slice(0, 600)]
    )
    drawn = noise.draw(np.random.default_rng(9), 400, [600])
    rows = noise.whiten(drawn, drive, np.ones((2, 600), dtype=bool)).reshape(400, 2, 600)
    slow = np.cos(np.pi * (np.arange(600) + 0.5) / 600) * np.sqrt(2 / 600)
    assert np.var(drawn[:, 0] @ slow) > 50
    assert np.var(rows[:, 0] @ slow) == pytest.approx(1.0, abs=0.2)
    assert rows.var() == pytest.approx(1.0, abs=0.02)


def test_noise_drawn_white_has_the_law_of_noise_that_is_whitened():
    """Colored, mixed, wandering noise with heavy tails and a gap: variance in all directions, tails
    and gap alike.
    """
    n, rng = 600, np.random.default_rng(9)
    color = Autoregression(np.array([[0.0], [0.8]]), np.array([1.0, 0.6]))
    wander = RandomWalk(
        np.array([2.0, 0.0]), 0.002, Load(np.tile([[1.0], [0.0]], n), np.array([[1.0, 0.0]]))
    )
    heavy = rng.standard_t(5, (2, 4000))
    shocks = tuple(heavy / heavy.std(axis=1, keepdims=True))
    noise = PowerNoise(
        ((color, white_noise(1.0)),), np.array([[1.0, 0.0], [-0.5, 1.0]]), shocks, wander
    )
    drive = SimpleNamespace(events=1, samples=n, part=lambda e: slice(0, n), parts=[slice(0, n)])
    valid = np.ones((2, n), dtype=bool)
    valid[1, 250:300] = False
    whitened = noise.whiten(noise.draw(rng, 1000, [n]), drive, valid).reshape(1000, 2, n)
    white = noise.draw_white(rng, 1000, drive, valid).reshape(1000, 2, n)
    assert noise.draw_white(rng, 0, drive, valid).shape == (0, 2 * n)
    directions = np.cos(np.pi * np.outer(np.arange(40), np.arange(n) + 0.5) / n) * np.sqrt(2 / n)
    for rows in (whitened, white):
        assert not rows[:, :, 250:300].any()
        assert rows[:, :, 400:].var(axis=(0, 2)) == pytest.approx(1.0, abs=0.03)
        assert (rows @ directions.T).var(axis=0)[:, 1:] == pytest.approx((n - 50) / n, abs=0.25)
    kurtosis = [(rows[:, :, 400:] ** 4).mean(axis=(0, 2)) for rows in (whitened, white)]
    assert kurtosis[0] == pytest.approx(kurtosis[1], rel=0.2)
    assert kurtosis[1].min() > 4


def test_a_fit_in_the_stiff_part_of_the_box_asks_for_the_steps_of_the_whole_box(monkeypatch):
    monkeypatch.setattr(kernels, "LONGEST_SEARCH_STEP", 1.0)
    made = bench(base(), events(recorder=FAST))
    own, at = made.kernels, made.coordinates
    usual = own.bare.space.from_unit(at.null[at.base])[None]
    fast = usual.copy()
    fast[0, own.bare.space.names.index("T_prime")] = 0.006
    fast[0, own.bare.space.names.index("M")] = 0.001
    assert own.substeps < own.box_substeps
    assert own.substeps < own.bare.steps_at(fast)
    assert own.too_coarse(np.concatenate([usual, fast]))
    assert not own.too_coarse(usual)


def test_an_investigation_starts_anew_with_shorter_steps_where_its_fits_ask_for_them(monkeypatch):
    monkeypatch.setattr(kernels, "LONGEST_SEARCH_STEP", 1.0)
    monkeypatch.setattr(Problem, "steps_at", lambda own, values: 256)
    said: list[str] = []
    found = investigate(base(), events(recorder=FAST), only=FEW, tell=said.append)
    own = found.context.kernels
    assert said.count("the fits lie where the motor is fast: again with shorter steps") == 1
    assert (
        own.substeps
        == own.box_substeps
        > own.bare.with_steps_of(kernels.STEP_SHARE).step.substeps.max()
    )


def test_what_the_reactive_power_of_customers_does_after_a_dip_follows_their_active_power():
    """P and Q of one load wander together: where it takes thrice the reactive power, that wanders
    thrice as much.
    """
    rng, n, count = np.random.default_rng(3), 600, 200
    clean = np.stack([np.ones(n), np.where(np.arange(n) < 300, 0.4, 1.2)])
    walk = np.cumsum(rng.normal(size=(count, 1, n)) * 0.01, axis=2)
    walk -= walk.mean(axis=2, keepdims=True)  # a load that is larger throughout is P0 and Q0
    recorded = clean * walk + 0.05 * rng.normal(size=(count, 2, n))
    load = Load.from_powers(clean, np.array([[1.0, 0.4]]), np.array([0, n]))
    # in which what goes together in P and Q before the dip is P's alone
    mix = np.array([[20.0, 0.0], [-8.0, 20.0]])
    noise = PowerNoise(
        PowerNoise.white(1.0, 1.1).pairs,
        mix,
        random_walk=RandomWalk(np.array([20.0, 0.0]), 0.002, load),
    )
    drive = SimpleNamespace(events=1, samples=n, part=lambda e: slice(0, n), parts=[slice(0, n)])
    rows = noise.whiten(recorded, drive, np.ones((2, n), dtype=bool)).reshape(count, 2, n)
    slow = (np.arange(n) >= 300) / np.sqrt(300)
    assert np.var((mix @ recorded)[:, 1] @ slow) > 20
    assert np.var(rows[:, 1] @ slow) < 2


def test_a_load_that_seems_steady_before_the_events_may_wander_within_them():
    """What is left of the events adds evidence, as long as the stretches before do not speak
    against it.
    """
    rng = np.random.default_rng(11)
    white = lambda n: rng.normal(size=(2, n))  # noqa: E731
    walk = lambda n: np.cumsum(rng.normal(size=(2, n)) * np.array([[0.03], [0.0]]), axis=1)  # noqa: E731
    columns = rng.normal(size=(3, 2, 1000))
    rest = lambda left: Rest(left, columns, np.ones(1000))  # noqa: E731
    calm = [white(250) for _ in range(3)]
    assert find(calm, 0.002, steady(1000)) is None
    assert find(calm, 0.002, steady(1000), [rest(white(1000)) for _ in range(3)]) is None
    assert (
        find(calm, 0.002, steady(1000), [rest(white(1000) + walk(1000)) for _ in range(3)])
        is not None
    )
    explained = [rest(white(1000) + 5 * columns[0]) for _ in range(3)]
    assert find(calm, 0.002, steady(1000), explained) is None


def test_noise_of_the_voltage_is_taken_out_where_it_is_smooth():
    clean, noisy = (events(noise=Noise(0.002, voltage=v), count=1)[0] for v in (0.0, 0.002))
    untouched = smooth_voltage(clean)
    assert untouched.event is clean
    assert not len(untouched.errors)
    made = smooth_voltage(noisy)
    off = made.event.record.U - clean.record.U
    quiet = slice(0, clean.start - 20)
    assert off[quiet].std() < 0.3 * (noisy.record.U - clean.record.U)[quiet].std()
    # at the edge as it was recorded
    assert made.event.record.U[clean.start] == noisy.record.U[clean.start]


def test_smoothing_stops_beside_an_edge(monkeypatch):
    """A sample that is taken for an edge by chance does not take those beside it along, and they
    theirs.
    """
    rng, time = np.random.default_rng(12), np.arange(1000) * 0.002
    U = np.where(abs(time - 0.6) < 0.1, 0.6, 1.0)

    def as_recorded():
        """How many samples are left as recorded in all but one event of twenty."""
        made = [
            smooth_voltage(_event(time, U + rng.normal(0, 0.005, 1000))).errors for _ in range(60)
        ]
        return np.quantile([(np.count_nonzero(errors, axis=1) == 1).sum() for errors in made], 0.95)

    assert as_recorded() < 200
    monkeypatch.setattr("tractexp.noise.voltage.BESIDE", 2.0)
    assert as_recorded() > 300


def _event(t, U):
    return detect(Record("event", t, U, U, U, source="made").check())


def test_what_smoothing_leaves_of_the_voltages_noise_is_as_large_as_said():
    """In the directions of its errors what is left has unit variance; outside of them there is
    hardly anything.
    """
    clean = events(noise=Noise(0.002), count=1)[0]
    rng = np.random.default_rng(3)
    sizes, outside = [], []
    for _ in range(30):
        U = clean.record.U + 0.002 * rng.standard_normal(clean.record.samples)
        made = smooth_voltage(replace(clean, record=replace(clean.record, U=U)))
        off = made.event.record.U - clean.record.U
        _, values, basis = np.linalg.svd(made.errors, full_matrices=False)
        along = basis @ off
        sizes.append(np.mean((along / values) ** 2))
        outside.append(np.sum((off - along @ basis) ** 2) / 0.002**2)
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.25)
    assert np.median(outside) < 1  # standard deviations, squared, over a thousand samples


def test_the_voltages_noise_is_part_of_the_noise_of_the_power():
    """Draws that hold what errors of the voltage do are white once whitened, and nothing is refused
    or named.
    """
    model, made = base(), events(noise=Noise(0.002, voltage=0.005))
    made = bench(model, made)
    noise = QuietNoise.from_context(made, made.coordinates.null).of_fit(made.coordinates.null)
    drive = made.drive
    drawn = noise.draw(np.random.default_rng(4), 200, np.diff(drive.first).tolist())
    rows = made.whiten(noise, drawn)
    # also where errors of the voltage are most of it
    ratio = drawn.std(axis=0) / noise.deviation(drive)
    assert ratio.mean(axis=1) == pytest.approx([1.0, 1.0], abs=0.02)
    assert noise.loudest_input_mode > BLURRED
    # the edges of the dips
    loud = drawn.var(axis=0) > 4 * np.median(drawn.var(axis=0), axis=1, keepdims=True)
    assert loud.sum() > 20
    assert ratio[loud].mean() == pytest.approx(1.0, abs=0.02)
    assert rows.var() == pytest.approx(1.0, abs=0.02)
    assert rows.reshape(drawn.shape)[:, loud].var() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("looked_for", "shape"),
    [
        (
            "an oscillation",
            lambda t, event: 0.8 * np.sin(2 * np.pi * 31.0 * t) * (t >= event.t_start),
        ),
        (
            "a step or a pulse",
            lambda t, event: 1.5 * (t >= event.t_end + 0.37) * (event.record.name == "event1"),
        ),
        ("a step or a pulse", lambda t, event: 3.0 * (np.abs(t - event.t_end - 0.3) < 0.006)),
        (
            "an oscillation",
            lambda t, event: (
                1.5 * np.sin(97.0 * (t - event.t_end)) * (np.abs(t - event.t_end - 0.4) < 0.1)
            ),
        ),
        (
            "the loudest window",
            lambda t, event: (
                4.0 * (np.abs(t - event.t_start - 0.02) < 0.01) * (-1.0) ** (t // 0.004)
            ),
        ),
    ],
)
def test_what_no_effect_explains_is_found_by_the_test_that_looks_for_it(silent, looked_for, shape):
    """Planted into what the base model leaves, in standard deviations of the noise; without it
    nothing is found.
    """
    first, at = silent.first, silent.context
    assert first.p_left > 0.01
    planted = first.tangent.residual.copy()
    for e, event in enumerate(at.events):
        planted[0, at.drive.part(e)] += 0.002 * shape(event.record.t, event)
    found = first.chance.surprises(
        first.projection.replace_residuals(at.whiten(first.noise, planted[None])), at
    )
    assert min(found, key=found.get) == looked_for
    assert found[looked_for] < 1e-5


def test_the_largest_of_many_comes_about_by_chance_as_often_as_it_says():
    """With thousands of columns a draw must not have a part in the mean and the spread that it is
    measured by.
    """
    rng = np.random.default_rng(12)
    p = []
    for _ in range(6):
        draws, fresh = rng.normal(size=(199, 3000)) ** 2, rng.normal(size=(100, 3000)) ** 2
        p += [tail(draws, row[None]) for row in fresh]
    assert 0.05 < np.mean(np.array(p) < 0.1) < 0.15
    assert np.mean(np.array(p) < 0.01) < 0.03
    assert 0.4 < np.mean(np.array(p) < 0.5) < 0.6


def test_a_rare_value_of_many_is_judged_alike_by_any_draws_once_the_scales_are_exact():
    """Exponential columns: the largest of 3000 exceeds x with 1 - (1 - exp(-x))^3000 exactly."""
    rng = np.random.default_rng(13)
    x = -np.log(1 - (1 - 1e-3) ** (1 / 3000))
    value, exact = np.zeros((1, 3000)), Scale(np.ones(3000), np.ones(3000))
    value[0, 1234] = x
    draws = [rng.exponential(size=(199, 3000)) for _ in range(40)]
    alike = np.array([tail(few, value, exact) for few in draws]) / 1e-3
    own = np.array([tail(few, value) for few in draws]) / 1e-3
    assert 0.8 < np.exp(np.log(alike).mean()) < 1.25
    assert np.log(alike).std() < 0.7 * np.log(own).std()
    assert np.all((alike > 0.25) & (alike < 4))
    assert not np.all((own > 0.25) & (own < 4))


def test_only_a_decision_that_is_open_asks_for_exact_scales(silent):
    """p of the six tests together is moved to either side of what draws leave open."""
    first, level = silent.first, silent.context.criteria.adequate_p
    bare = replace(first, chance=replace(first.chance, scales={}))
    for p, open_ in [
        (level / 30, False),
        (level / 10, True),
        (level * 10, True),
        (level * 30, False),
    ]:
        moved = replace(bare)
        moved.__dict__["goodness_of_fit"] = GoodnessOfFit({"one of six": p})
        assert moved.is_undecided == open_
    exact = replace(
        bare,
        chance=replace(bare.chance, scales=scales(first.tangent, first.projection, first.noise, 3)),
    )
    exact.__dict__["goodness_of_fit"] = GoodnessOfFit({"one of six": level})
    assert not exact.is_undecided
    drawn = bare.chance.left
    for name, scale in exact.chance.scales.items():
        assert np.median(np.abs(scale.mean / drawn[name].mean(axis=0) - 1)) < 0.1
        assert np.median(np.abs(scale.spread / drawn[name].std(axis=0) - 1)) < 0.15
    assert set(exact.chance.scales) == {
        name for name, values in drawn.items() if values[0].size > 1
    }


@pytest.mark.parametrize(("events", "asked"), [(1, False), (2, True)])
def test_parameters_of_each_event_are_asked_for_where_there_are_two(events, asked, monkeypatch):
    monkeypatch.setattr(residual_statistics, "statistics", lambda channels, problem: {})
    projection = SimpleNamespace(
        variance_component=lambda: np.zeros(1),
        least_p=np.ones(1),
        channels=lambda layout: None,
        r=np.zeros((1, 3)),
        split=np.ones((1, 3)),
    )
    made = ScoreTest.statistics(projection, SimpleNamespace(events=("a dip",) * events))
    assert ("parameters of each event" in made) == asked


@pytest.mark.long
def test_an_effect_outside_the_catalogue_is_unexplained_and_what_is_left_is_written(tmp_path):
    found = investigate(base(), events("load_step", size=2.0, count=3)[:2], (), {}, {}, only=FEW)
    assert found.verdict.word == "unexplained"
    assert found.names == ()
    assert found.nearest is not None
    near = content(found)["nearest"]
    assert near["effects"]
    assert 0 < near["gap"]["train"]["closed"] < 1
    assert (
        near["gap"]["train"]["after"]["chi2_per_sample"]
        < near["gap"]["train"]["before"]["chi2_per_sample"]
    )
    assert near["gap"]["validate"] is None
    rows = np.genfromtxt(
        write_left(found, tmp_path / "left.csv"),
        delimiter=",",
        names=True,
        dtype=None,
        encoding=None,
    )
    assert len(rows) == sum(e.record.samples for e in found.context.events)
    assert np.abs(rows["P"]).max() > 5 * 0.002  # the step stands out of the noise


@pytest.mark.parametrize("beside", ["stator_resistance", "feeder_impedance", PUSHES])
def test_a_sets_own_kernel_gives_what_those_with_more_beside_it_give(beside):
    made = bench(base(), events(), only=())
    at = made.coordinates
    unit = at.null.copy()
    unit[at.sizes(["stator_resistance"])] = at.to_unit("R_s", 0.02)
    own, wider = (made.residuals(unit[None], ("stator_resistance",), more) for more in ("", beside))
    assert own == pytest.approx(wider, abs=1e-10)


def test_what_changes_nothing_is_exactly_zero():
    """Of two kernels the difference would be rounding, and a direction of its own once it is scaled
    to length one.
    """
    made = bench(base(), events(), only=())
    at = made.coordinates
    unit, names = at.null.copy(), ("stator_resistance", "feeder_impedance", PUSHES)
    unit[at.sizes(["stator_resistance"])] = at.to_unit("R_s", 0.02)
    assert not made.changes(unit, np.array([unit] * 3), ("stator_resistance",), names).any()
    moved = at.place_values(unit, {"X_f": 0.02})
    assert made.changes(unit, moved[None], ("stator_resistance",), ("feeder_impedance",)).any()


def test_coordinates_that_act_on_different_rows_share_one_difference():
    """The normal equations are those of one difference for each coordinate, from fewer
    simulations.
    """
    rng = np.random.default_rng(10)
    J = rng.normal(size=(40, 3))
    J[20:, 1], J[:20, 2] = 0, 0
    calls = []

    def rows(x, lanes):
        calls.append(len(x))
        return np.sin(x @ J.T)

    unit, lanes = np.full((2, 3), 0.4), np.arange(2)
    apart = SeparableColumns(np.array([[1], [2]]), (np.arange(20), np.arange(20, 40)))
    alone = normal(rows, unit, rows(unit, lanes), lanes)
    together = normal(rows, unit, rows(unit, lanes), lanes, apart)
    for one, other in (alone[0], together[0]), (dense_normal(alone[1]), dense_normal(together[1])):
        assert other == pytest.approx(one, rel=1e-9)
    assert calls == [2, 6, 2, 4]


def test_a_name_takes_held_out_events_that_show_it(planted):
    """A true explanation gains about what both curves are apart; of little distance it is neither
    shown nor denied.
    """
    shown = planted.validate
    assert abs(shown.gain - shown.expected) < 6 * np.sqrt(shown.expected)
    assert shown.outcome == "shown"
    cases = (
        (-1.0, 100.0, False),
        (5.0, 100.0, False),
        (5.0, 12.0, True),
        (-1.0, 6.0, True),
        (-np.inf, np.inf, False),
    )
    for gain, expected, open_ in cases:
        there = replace(shown, gain=gain, expected=expected)
        assert there.outcome == ("mild" if open_ else "denied")


def test_a_small_effect_that_the_held_out_dip_is_too_mild_to_show_is_a_candidate():
    made = events("stator_resistance", size=0.12, count=3)
    told = investigate(base(), [made[0], made[2]], [made[1]], {}, {}, only=FEW)
    assert (told.verdict.word, told.names) == ("candidate", ("stator_resistance",))
    assert told.reason.endswith("the held-out events are too mild to show it")
    assert "hold it out" in recommendation(told) or recommendation(told).startswith(
        "hold out event"
    )
    assert not told.proposed.why


def test_all_events_together_confirm_only_what_the_held_out_ones_show(planted):
    """An event with the effect adds to the evidence of the fitted ones, one without it takes from
    it.
    """
    trained, alone, criteria = planted.context, planted.extended_fit, Criteria()
    known = planted.evidence
    both = lambda made: AllEvents(trained, made, known.noise, known.faults, known.base.fit)  # noqa: E731
    fit = lambda made: both(made).fit_jointly([alone], seed=0)  # noqa: E731
    (confirmed,) = fit(events("stator_resistance", size=2.0, count=3)[2:])
    assert confirmed.louder > 0
    assert confirmed.p_left >= criteria.adequate_p
    assert confirmed.fit.names == ("stator_resistance",)
    assert confirmed.fit.unit.shape == alone.unit.shape
    R_s = [trained.coordinates.value("R_s", unit) for unit in (confirmed.fit.unit, alone.unit)]
    assert R_s[0] == pytest.approx(R_s[1], rel=0.2)
    (denied,) = fit(events(None, count=3)[2:])
    assert denied.louder < 0
    assert denied.p_left < criteria.adequate_p


def test_what_has_no_steady_state_on_a_held_out_event_is_denied_there():
    """A motor that would not run before it: nothing of it can be compared, and the noise is another
    fit's.
    """
    made = bench(base(), events(count=3)[:2])
    at = made.coordinates
    runs = Refit((), at.null.copy(), 0.0, 0)
    stalls = Refit(("stator_resistance",), at.null.copy(), 0.0, 1)
    stalls.unit[at.column["T_m"]] = stalls.unit[at.column["C"]] = 1.0
    stalls.unit[at.parameters(stalls.names)] = 1.0
    held = events(count=3)[2:]
    other, units, noise = carry_fits(made, held, [runs, stalls])
    assert not np.isfinite(other.residuals(units[1][None], stalls.names)).any()
    assert np.isfinite(noise.levels).all()
    judged = compare_on(made, held, runs, [runs, stalls])
    assert judged[stalls.names].outcome != "shown"
    assert judged[stalls.names].gain == -np.inf


def test_an_effect_that_closes_little_of_the_held_out_gap_must_leave_nothing_in_a_fit_to_all_events(
    planted,
):
    """A step of the load after the held-out dip is seen beside the effect; without it nobody asks
    for that fit.
    """

    criteria = planted.context.criteria

    def judged_on(made):
        known = planted.evidence
        both = AllEvents(planted.context, made, known.noise, known.faults, known.base.fit)
        (row,) = assess(both, planted.verdict.kept, seed=0)
        assert row.names == ("stator_resistance",)
        assert not row.is_fitted_to_all
        return row

    (clean,) = events("stator_resistance", size=2.0, count=3)[2:]
    assert not needs_all_events([judged_on([clean])], criteria)
    assert holds(judged_on([clean]), criteria)
    record = clean.record
    later = record.t > record.t[clean.end] + 0.2
    stepped = judged_on(
        [replace(clean, record=replace(record, P=record.P + 0.05 * clean.P0 * later))]
    )
    assert stepped.gap.outcome == "shown"
    assert needs_all_events([stepped], criteria)
    assert not holds(stepped, criteria)


def test_an_effect_is_looked_for_from_all_over_the_base_model_s_box(monkeypatch):
    """A large capacitor draws the base fit to another leakage and dispersion, where none of any
    size would help.
    """
    only = ("shunt_capacitor", "low_frequency_oscillation")
    found = investigate(
        base(),
        events("shunt_capacitor", size=0.5 / 0.3, seed=2048740674, count=3),
        (),
        {},
        {},
        only=only,
    )
    first, single = found.first, found.explanations.refits["shunt_capacitor",]
    assert beneath(first, single).fit.deviance > first.fit.deviance + 1000
    assert single.deviance < first.fit.deviance - 1000
    assert found.names == ("shunt_capacitor",)
    monkeypatch.setattr(explanations, "in_the_box", lambda context, fit: [(fit.names, fit.unit)])
    from_base = search_effect_sets([first], {(): first.fit}, 1, lambda line: None)
    assert (
        min(f.deviance for f in from_base if f.names == ("shunt_capacitor",))
        > first.fit.deviance - 1
    )


@pytest.mark.long
def test_a_relay_is_found_though_the_base_model_alone_fits_in_a_wrong_valley():
    """There it left a deviance of 2550 of 2000 values, a member of its family was named, or nothing
    at all.
    """
    made = events("undervoltage_trip", size=2.0, seed=5)
    found = investigate(base(), made, (), {}, {}, only=("stator_resistance", "undervoltage_trip"))
    assert found.names == ("undervoltage_trip",)
    assert found.explanations.chosen.deviance < 2000


@pytest.mark.long
def test_a_name_that_suffices_from_the_wrong_valley_does_not_hide_what_explains_more_from_another():
    """There a compensator leaves nothing of a capacitor; the capacitor explains more by a single
    parameter.
    """
    made = events("shunt_capacitor", size=0.5 / 0.3, seed=716855646, count=4, noise=LOUD)
    found = investigate(
        base(), made[:3], made[3:], {}, {}, only=("shunt_capacitor", "static_var_compensator")
    )
    first, refits = found.first, found.explanations.refits
    assert found.explanations.chosen.names == ("shunt_capacitor",)
    from_base = refit(found.context, first.noise, [(("shunt_capacitor",), first.fit.unit)])[0]
    assert from_base.deviance > first.fit.deviance - 1
    assert refits["shunt_capacitor",].deviance < refits["static_var_compensator",].deviance - 10
    assert ("shunt_capacitor",) in found.verdict.sets


def test_an_effect_that_a_larger_set_does_not_need_is_left_out_again(planted):
    """A pair may lead to the better place of one of its members: then that one alone is the
    explanation.
    """
    (name,), first = planted.names, planted.first
    other = next(n for n in FEW if n != name)
    pair = refit(planted.context, first.noise, [((name, other), planted.verdict.chosen.fit.unit)])[
        0
    ]
    tests = examine_fit(planted.base.quiet, pair, first.noise, 0)
    astray = replace(planted.explanations.refits[name,], deviance=first.fit.deviance)
    refits = {**planted.explanations.refits, (name,): astray}
    fewer = without_needless(planted.base, tests, refits, 0)
    assert fewer.fit.names == (name,)
    assert refits[name,].deviance < first.fit.deviance - 100
    # p = 4e-8 of one parameter
    needed = replace(tests, fit=replace(tests.fit, deviance=tests.fit.deviance - 30.0))
    assert without_needless(planted.base, needed, refits, 0) is needed


def test_candidates_at_their_null_leave_the_base_model(silent):
    """All kernels by which they are tested, every one at its null, give the base
    model's residuals.
    """
    made = bench(base(), events(), only=())
    alone, null = made.kernels.bare, made.coordinates.null
    values = alone.space.from_unit(null[made.coordinates.base])
    response = alone.model.simulate(alone.drive, alone.full(values), made.problem.step.substeps)
    for beside in ("stator_resistance", "feeder_impedance", PUSHES):
        rows = made.residuals(null[None], (), beside)[0]
        assert rows[0] == pytest.approx(response.P[0] - alone.drive.measurements[0], abs=1e-10)


def test_what_only_a_parameter_beyond_its_bounds_explains_is_left(silent):
    """The best fit lies on a wall; a projection that lets the parameter leave the box would find
    nothing.
    """
    T = silent.context.coordinates.value("T_prime", silent.first.fit.unit)
    made = bench(base(), events(), bounds={"T_prime": [1.05 * T, 2 * T]})
    first = disagreement(base_fit(made), seed=0)
    assert first.fit.unit[made.coordinates.column["T_prime"]] == 0.0
    assert "T_prime" in first.parameters_at_bound
    assert silent.first.parameters_at_bound == []
    assert first.fit.deviance > silent.first.fit.deviance + 50
    assert silent.first.adequate
    assert first.p_left < 1e-6


def test_nuisance_columns_are_orthogonal_to_the_projected_residual(silent):
    projection = tangent(silent.context, silent.first.fit, silent.first.noise).build_score_test(
        silent.first.noise
    )
    assert np.abs(projection.r @ projection.Q).max() < 1e-8
    for block in projection.blocks:
        assert np.abs(block @ projection.Q).max() < 1e-6 * max(np.abs(block).max(), 1.0)


def test_events_that_do_not_belong_together_are_refused():
    one, two = events()
    with pytest.raises(UserError, match=r"made 1 is both in data\.train and in data\.validate"):
        check_events([one, two], [one])
    with_f = detect(
        Record(
            "f",
            one.record.t,
            one.record.U,
            one.record.P,
            one.record.Q,
            f=np.full(len(one.record.t), 50.0),
        )
    )
    with pytest.raises(UserError, match="has the channel f and made 1 has not"):
        check_events([one, with_f], [])


def test_an_effect_that_does_not_exist_is_refused_with_the_nearest_name():
    with pytest.raises(
        UserError,
        match=r"'stator_resistence', which is no effect; did you mean 'stator_resistance'\?",
    ):
        investigate(base(), events(), (), {}, {}, only=("stator_resistence",))


def test_the_command_tells_the_story_and_its_extended_model_runs_at_once(tmp_path):
    case = Case("stator_resistance", 2.0, events=2, noise=QUIET)
    write(case, 3, tmp_path)
    only = "task.effects=[stator_resistance,speed_dependent_torque]"
    data = [
        "data=csv",
        "data.train=[event1.csv]",
        "data.validate=[event2.csv]",
        "tracking.enabled=false",
    ]
    run = ("task=discrepancy", only, *data, "hydra.run.dir=run")
    done = run_command(*run, cwd=tmp_path, COLUMNS=str(WIDTH))
    assert done.returncode == 0, done.stderr
    rows = count_rows(done.stdout, WIDTH)
    assert len(rows) <= LINES - 1, done.stdout
    told = " ".join(done.stdout.split())
    for part in (
        "verdict: NAMED stator_resistance",
        "usable: the extended model describes this load",
        "where:",
        "held out",
        "next: use the extended model: tractexp model=run/conf/model/extended.yaml ",
        "discrepancy.html",
    ):
        assert part in told, part
    made = json.loads((tmp_path / "run" / "discrepancy.json").read_text())
    assert made["effects"] == ["stator_resistance"]
    page = (tmp_path / "run" / "discrepancy.html").read_text()
    for heading in (
        "Measured, before",
        "How much smaller",
        "Candidates by",
        "Parameters before",
        "Is there a",
        "Noise",
    ):
        assert f">{heading}" in page
    assert made["extended"] == "conf/model/extended.yaml"
    assert done.stdout.startswith("verdict: NAMED stator_resistance\n")
    assert "stator_resistance explains the disagreement, and none of the 4 other" in told
    assert re.search(r"^  R_s = 0\.0", done.stdout, re.MULTILINE)
    assert not list((tmp_path / "run").glob("*.svg"))
    quick = ["optimizer=multistart_least_squares", "optimizer.starts=2", "hydra.run.dir=again"]
    done = run_command(
        "--config-dir", str(Path("run") / "conf"), "model=extended", *data, *quick, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "R_s" in json.loads((tmp_path / "again" / "result.json").read_text())["parameters"]


@pytest.mark.long
@pytest.mark.usefixtures("no_proposal")
def test_on_a_real_record_it_says_that_it_does_not_know(shared_data, tmp_path):
    """Two dips of a fault recorder: the base model does not fit, an effect helps on both dips and
    is not adequate.
    """
    record = shared_data / "dfr220kv-shandong" / "xtz.cfg"
    data = [
        "data=comtrade",
        f"data.path={record}",
        "data.voltages=[4,5,6]",
        "data.currents=[8,9,10]",
        "data.train=[1]",
        "data.validate=[2]",
        "tracking.enabled=false",
    ]
    only = "task.effects=[exponential_recovery]"
    done = run_command("task=discrepancy", only, *data, "hydra.run.dir=run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    made = json.loads((tmp_path / "run" / "discrepancy.json").read_text())
    assert made["verdict"] == "unexplained"
    assert made["effects"] == []
    assert made["gap"]["train"]["before"]["chi2_per_sample"] > 10
    near = made["nearest"]["gap"]
    assert 0.2 < near["train"]["closed"] < 1
    assert (
        near["validate"]["after"]["model_error"]["value"]
        > near["validate"]["before"]["model_error"]["value"] / 2.25
    )
    assert all(len(at["interval"]) == 2 for at in made["nearest"]["parameters"].values())
    assert made["extended"] is None
    assert not (tmp_path / "run" / "conf").exists()
    assert "extended model:" not in done.stdout
    assert "measured less calculated" in (tmp_path / "run" / "discrepancy.html").read_text()
    assert (tmp_path / "run" / "unexplained.csv").read_text().startswith("event,t,P,Q")


def test_fits_and_what_they_spend_do_not_depend_on_the_number_of_cores(planted, monkeypatch):
    """Products of matrices round by how many rows they have: the same descents go together on any
    machine.
    """
    from tractexp.inference import cores, fitting

    bench = planted.context
    wander = RandomWalk(np.array([1.0, 0.3]), 0.002, bench.problem.power)
    noise = replace(planted.last.noise, mix=np.eye(2), random_walk=wander)
    moved = np.clip(planted.first.fit.unit + np.linspace(-0.02, 0.02, 9)[:, None], 0.0, 1.0)
    monkeypatch.setattr(fitting.store, "key", lambda *_: "")  # nothing is taken from the store
    found = []
    for number in (1, 3):
        monkeypatch.setattr(cores, "cores", lambda number=number: number)
        before = bench.effort.total
        fits = refit(bench, noise, [(("stator_resistance",), unit) for unit in moved])
        found.append((fits[0].unit, fits[0].deviance, bench.effort.total - before))
    np.testing.assert_array_equal(found[0][0], found[1][0])
    assert found[0][1:] == found[1][1:]
    assert found[0][2] > 9
