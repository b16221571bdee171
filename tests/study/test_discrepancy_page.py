"""The page of what `investigate` found: what one sees first, what explains it, and no sentence
against another.
"""

import html
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_dips import FEW, base, events
from pages import charts, read, unpacked

from tractexp.discrepancy.discrepancy_json import content
from tractexp.discrepancy.evidence import Evidence, SetEvidence
from tractexp.discrepancy.explain import explain_rest
from tractexp.discrepancy.investigate import investigate
from tractexp.discrepancy.proposal.propose import ProposalResult
from tractexp.inference.model_error import in_percent
from tractexp.record.identity import Identity
from tractexp.report import candidates, discrepancy, overlay
from tractexp.report.candidate_rows import (
    CHOSEN,
    chance_level,
    describe_untestable_beside,
    explain_other_than_steepest,
    list_candidates,
)
from tractexp.report.events import BAND_DEVIATIONS
from tractexp.text.wording import join_words


@pytest.fixture
def named(planted):
    return planted.steps


@pytest.fixture(scope="module")
def silent():
    return investigate(base(), events(count=2)[:1], events(count=2)[1:], {}, {}, only=FEW)


@pytest.fixture(scope="module")
def unexplained():
    made = events("load_step", size=2.0, count=3)
    none = ProposalResult(why="none is searched here: that takes as long as all else")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tractexp.discrepancy.investigate.propose", lambda *_: none)
        return investigate(base(), made[:2], made[2:], {}, {}, only=FEW)


def page(found, folder):
    """The words of the page, and what its charts draw."""
    path = discrepancy.report(
        found, content(found), [Identity.from_record(e.record) for e in found.context.events]
    ).save(folder / "discrepancy.html")
    return words_of(path), charts(path.read_text(encoding="utf-8"))


def words_of(path):
    """The words of a page that is valid and whole, one space between them."""
    read(path)
    bare = re.sub(
        r"<(script|style)[^>]*>.*?</\1>", "", path.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", bare)).split())


def curve(chart, name, axis):
    """One curve of a chart."""
    (trace,) = (
        t
        for t in chart["data"]
        if (t["name"], t["yaxis"]) == (name, axis) and t.get("mode") == "lines"
    )
    return unpacked(trace["y"])


def names(chart):
    return {trace["name"] for trace in chart["data"]}


def test_a_click_tells_that_the_planted_effect_explains_what_is_left(named, tmp_path):
    _, drawn = page(named, tmp_path)
    first, _, held, _ = drawn
    assert "answers" not in held  # nothing was fitted there
    loudest = named.places[0]
    (told,) = (
        a["text"]
        for a in first["answers"]
        if a["text"].startswith(f"{loudest.channel} from")
        and a["start"] <= (loudest.start + loudest.end) / 2 <= a["end"]
    )
    base_model, *beside = map(float, re.findall(r"([\d.e+]+) times", told))
    assert base_model > 2 * min(beside)
    assert re.search(r"with (\w+)", told)[1] in " ".join(named.names)


def test_measured_before_and_after_of_every_event_come_first(named, tmp_path):
    words, charts = page(named, tmp_path)
    assert [e.record.name for e in named.context.events] == ["event1", "event2"]
    assert (
        words.index("Measured, before, after")
        < words.index("event1, fitted")
        < words.index("event3, held out")
    )
    assert words.index("event3, held out") < words.index("How much smaller the gap is")
    first, _, held, bars = charts
    band = "± 2 σ of the noise"
    assert names(first) == {
        "measured",
        "base model",
        "extended model",
        "more than chance leaves",
        band,
    }
    assert names(held) == {"measured", "base model", "extended model", band}
    event = named.context.records.recorded[0]
    calculated = named.graded_overlays[0].after  # of the model that is graded
    for c, (channel, axis, below) in enumerate((("P", "y2", "y3"), ("Q", "y4", "y5"))):
        measured = getattr(event.record, channel)
        for name, panel, expected in (
            ("measured", axis, measured),
            ("extended model", axis, calculated[c]),
            ("extended model", below, measured - calculated[c]),
        ):  # in 16 bits
            drawn, step = curve(first, name, panel), np.ptp(expected) / 65_000
            np.testing.assert_allclose(drawn, expected, rtol=0, atol=step)
        assert np.std(curve(first, "base model", below)) > 1.5 * np.std(
            curve(first, "extended model", below)
        )
    edges = [s["x0"] for s in first["layout"]["shapes"] if s["type"] == "line"]
    assert edges == [event.t_start, event.t_end]
    shaded = sorted((s["x0"], s["x1"]) for s in first["layout"]["shapes"] if s["type"] == "rect")
    here = [p for p in named.places if p.event == "event1"]
    # in the power's panel and in that below it
    assert shaded == sorted(2 * [(p.start, p.end) for p in here])
    assert bars["data"][0]["type"] == "bar"


def test_the_noise_band_holds_what_the_extended_model_leaves(named):
    shown = named.overlays[0]
    off = (shown.measurements - shown.after) / shown.deviation
    assert 0.93 < np.mean(np.abs(off) < BAND_DEVIATIONS) < 0.98
    assert [o.held_out for o in named.overlays] == [False, False, True]


def test_many_events_are_folded_and_none_is_left_out(named, tmp_path):
    from tractexp.blocks import Report

    many = named.overlays[:2] * 3
    path = overlay.overlaid(Report("many"), many).save(tmp_path / "many.html")
    words = words_of(path)
    assert len(re.findall(r"event[12], fitted event[12]: dip of", words)) == 6
    assert "2 more events, fitted" in words
    text = path.read_text(encoding="utf-8")
    assert (
        text.index("<details>")
        > [m.start() for m in re.finditer('class="chart"', text)][overlay.MOST_OPEN_OVERLAYS - 1]
    )


def test_candidates_are_sorted_by_evidence_the_chosen_first(named, tmp_path):
    rows = list_candidates(named)
    assert rows[0].names == ("stator_resistance",)
    assert rows[0].status == CHOSEN
    assert rows[0].drop == pytest.approx(named.evidence.rows[0].lowered)
    (size,) = rows[0].sizes
    assert size.parameter.name == "R_s"
    assert size.error == pytest.approx(
        next(e for e in named.final_estimates if e.parameter.name == "R_s").error
    )
    drops = [row.drop for row in rows[1:] if np.isfinite(row.drop)]
    assert drops == sorted(drops, reverse=True)
    assert {row.names[0] for row in rows} >= {
        *FEW,
        "time_skew",
        "measurement_window",
        "load_change",
    }
    words, charts = page(named, tmp_path)
    bars = charts[-1]["data"][0]
    assert bars["y"] == [row.names[0] for row in rows if np.isfinite(row.drop)]
    assert bars["marker"]["color"][0] == candidates.COLORS[CHOSEN]
    assert charts[-1]["layout"]["shapes"][0]["x0"] == chance_level(named)
    assert describe_untestable_beside(named) in words


def promising(named, score):
    """The investigation with another score first."""
    first = replace(named.first)
    vars(first)["scores"] = [score, *named.first.scores]
    base = replace(named.evidence.base, tests=first)
    return replace(named, evidence=replace(named.evidence, base=base))


def test_where_a_linear_step_favours_another_effect_one_sentence_says_why(named):
    assert explain_other_than_steepest(named) == ""
    other = next(s for s in named.first.scores if s.name == "speed_dependent_torque")
    favoured = replace(other, drop=1e6, p=0.0)
    told = explain_other_than_steepest(promising(named, favoured))
    assert told.startswith(
        "speed_dependent_torque promises most in one linear step from the base model"
    )
    assert "yet the verdict is stator_resistance, which lowers the deviance by" in told
    assert "speed_dependent_torque" in told
    assert explain_other_than_steepest(promising(named, replace(favoured, drop=1.0))) == ""


def test_parameters_stand_before_and_after_with_meaning_unit_interval_and_verdict(named, tmp_path):
    words, _ = page(named, tmp_path)
    assert "parameter meaning unit before after 95 % interval verdict" in words
    assert "R_s stator resistance on the record's base pu not in it" in words
    graded = named.base_grade.parameters, named.graded_parameters
    before, after = ({e.parameter.name: e for e in group} for group in graded)
    assert before.keys() == after.keys() - {"R_s"}
    for e in after.values():
        low, high = e.interval
        assert low < e.value < high
        assert e.verdict.split()[0].rstrip(":") in ("identified", "weakly", "not")
        assert f"{low:.4g} to {high:.4g}" in words
    told = content(named)["parameters"]
    assert told == {n: {"value": e.value, "standard_error": e.error} for n, e in after.items()}


def test_what_is_drawn_and_told_is_of_the_graded_model(named):
    """The fits by which effects are ranked weigh otherwise: their curves and parameters are near,
    and not the same.
    """
    known = named.final_grade.uncertainty
    values = dict(zip(known.names, known.values, strict=True))
    assert {
        e.parameter.name: e.value for e in named.graded_parameters
    } == values | named.undetermined_values
    for ranked, graded in zip(named.overlays, named.graded_overlays, strict=True):
        (fit,) = (
            one
            for one in named.final_grade.fits
            if one.event.record.name == graded.event.record.name
        )
        assert np.array_equal(graded.after, np.stack([fit.P, fit.Q]))
        assert 0 < np.abs(graded.after - ranked.after).max() < 3 * ranked.deviation.max()


def test_the_model_recommended_is_graded_in_the_verdict(named, unexplained, tmp_path):
    for found, whose in (
        (named, "The extended model is graded "),
        (unexplained, "The base model is graded "),
    ):
        words, _ = page(found, tmp_path)
        grade = found.final_grade.adequacy
        told = f"{whose}{grade.grade.replace('_', ' ')}: {grade.sentence}"
        assert words.index(told) < words.index("; the next dip of 40 %") < words.index("Next: ")
    assert named.final_grade.adequacy.grade == "adequate" != unexplained.final_grade.adequacy.grade


def test_what_is_not_extended_is_not_called_so(silent, unexplained, tmp_path):
    for found, word in ((silent, "none"), (unexplained, "unexplained")):
        assert found.verdict.word == word
        words, charts = page(found, tmp_path)
        assert "extended" not in words.lower()
        assert "Parameters of the base model" in words
        assert "before after" not in words
        assert [o.held_out for o in found.overlays].count(True) == 1
        assert all("extended model" not in names(chart) for chart in charts)
        shown = [names(chart) for chart in charts if "measured" in names(chart)]
        assert len(shown) == len(found.overlays)
        assert all("base model" in of_event for of_event in shown)
        assert content(found)["extended"] is None


def test_what_is_left_is_told_with_channel_start_and_size(unexplained, tmp_path):
    words, _ = page(unexplained, tmp_path)
    shapes = unexplained.rest.of_base
    assert {(s.channel, s.kind) for s in shapes} >= {("P", "step")}
    assert unexplained.headline.startswith(
        ("the base model misses this: ", "the nearest candidates miss this: ")
    )
    assert unexplained.headline[1:] in words[: words.index("Measured and calculated")]
    assert "Missed by the base model" in words
    made = content(unexplained)
    assert made["remainder"]["of_base"][0]["channel"] in "PQ"
    assert made["remainder"]["sentence"] == unexplained.headline


@pytest.mark.parametrize(
    ("names", "faults", "told"),
    [
        (
            ("dc_link_lag", "inrush"),
            ("load_change",),
            "dc_link_lag and inrush beside load_change, the nearest, close 66% of the gap",
        ),
        (
            ("dc_link_lag",),
            ("load_change",),
            "dc_link_lag beside load_change, the nearest, closes 66%",
        ),
        ((), ("load_change", "time_skew"), "load_change and time_skew, the nearest, close 66%"),
        (("dc_link_lag",), (), "dc_link_lag, the nearest, closes 66%"),
    ],
)
def test_faults_of_the_measurement_are_not_counted_among_the_effects_together(names, faults, told):
    catalogue = SimpleNamespace(label_effect=lambda name: name, candidates=range(19))
    context = SimpleNamespace(catalogue=catalogue)
    tests = SimpleNamespace(loudest="pushes into the balances")
    best = SetEvidence(SimpleNamespace(names=names), names, names, p_left=0.001, tests=tests)
    evidence = Evidence(None, (best,), faults=faults)
    assert told in explain_rest(evidence, SimpleNamespace(closed_shares=(0.66, 0.5)), context)
    assert "nan" not in explain_rest(
        evidence, SimpleNamespace(closed_shares=(np.nan, np.nan)), context
    )


def test_an_unexplained_verdict_does_not_contradict_itself(unexplained, tmp_path):
    """It says what was tested, not what the catalogue holds, and numbers that can be pictured."""
    reason = unexplained.reason
    tested = len(unexplained.catalogue.candidates)
    assert tested == len(FEW) + 3
    assert f"none of the {tested} effects tested" in reason
    assert "catalogue" not in reason
    assert not re.search(r"e-\d\d", reason)
    near = unexplained.nearest
    assert near is not None
    before, after = (
        in_percent(unexplained.evidence.row_of(names).prediction.error)
        for names in ((), near.names)
    )
    assert re.search(
        rf"the nearest, miss(es)? {after} of the response there, where the base model misses"
        rf" {before}",
        reason,
    )
    assert join_words(near.names) in reason, (
        "the sentence and what is told of the nearest name the same effects"
    )
    told = content(unexplained)["nearest"]["parameters"]
    assert {"value", "standard_error", "interval"} == next(iter(told.values())).keys()
    words, _ = page(unexplained, tmp_path)
    assert not re.search(r"\d\.\d+e-\d\d\d", words)
