"""The page of what `investigate` found: what one sees first, what explains it, and no sentence
against another.
"""

import html
import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import no_term_is_searched
from made_dips import FEW, events, investigate
from pages import charts, read, unpacked

from tractexp.report import candidates, overlay
from tractexp.report.candidate_rows import (
    CHOSEN,
    describe_untestable_beside,
    explain_other_than_steepest,
    find_chance_level,
    list_candidates,
)
from tractexp.report.events import BAND_DEVIATIONS
from tractexp.text.wording import join_words

TWO = FEW[:2]


@pytest.fixture
def named(planted):
    return planted


@pytest.fixture(scope="module")
def silent():
    made = events(count=2)
    return investigate(made[:1], made[1:])


@pytest.fixture(scope="module")
def unexplained():
    made = events("load_step", size=2.0, count=3)
    with no_term_is_searched():
        return investigate(made[:2], made[2:], TWO)


def page(found, folder):
    """The words of the page, and what its charts draw."""
    path = found.report().save(folder / "discrepancy.html")
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
    loudest = named.steps.places[0]
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
    (event, other), _ = named.question.train, named.question.validate
    assert (event.record.name, other.record.name) == ("event1", "event2")
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
    response = named.predict(event)  # of the model that is graded
    calculated = response.P, response.Q
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
    here = [place for place in named.content["where"] if place["event"] == "event1"]
    # in the power's panel and in that below it
    assert shaded == sorted(2 * [(place["start"], place["end"]) for place in here])
    assert bars["data"][0]["type"] == "bar"


def test_the_noise_band_holds_what_the_extended_model_leaves(named):
    overlays = named.steps.overlays
    shown = overlays[0]
    off = (shown.measurements - shown.after) / shown.deviation
    assert 0.93 < np.mean(np.abs(off) < BAND_DEVIATIONS) < 0.98
    assert [o.held_out for o in overlays] == [False, False, True]


def test_many_events_are_folded_and_none_is_left_out(named, tmp_path):
    from tractexp.blocks import Report

    many = named.steps.overlays[:2] * 3
    path = overlay.add_overlays(Report("many"), many).save(tmp_path / "many.html")
    words = words_of(path)
    assert len(re.findall(r"event[12], fitted event[12]: dip of", words)) == 6
    assert "2 more events, fitted" in words
    text = path.read_text(encoding="utf-8")
    assert (
        text.index("<details>")
        > [m.start() for m in re.finditer('class="chart"', text)][overlay.MOST_OPEN_OVERLAYS - 1]
    )


def test_candidates_are_sorted_by_evidence_the_chosen_first(named, tmp_path):
    steps = named.steps
    rows = list_candidates(steps)
    assert rows[0].names == ("stator_resistance",)
    assert rows[0].status == CHOSEN
    assert rows[0].drop == pytest.approx(steps.evidence.rows[0].lowered)
    (size,) = rows[0].sizes
    assert size.parameter.name == "R_s"
    assert size.error == pytest.approx(
        next(e for e in steps.final_estimates if e.parameter.name == "R_s").error
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
    assert charts[-1]["layout"]["shapes"][0]["x0"] == find_chance_level(steps)
    assert describe_untestable_beside(steps) in words


def promising(steps, score):
    """The investigation with another score first."""
    first = replace(steps.first)
    vars(first)["scores"] = [score, *steps.first.scores]
    base = replace(steps.evidence.base, tests=first)
    return replace(steps, evidence=replace(steps.evidence, base=base))


def test_where_a_linear_step_favours_another_effect_one_sentence_says_why(named):
    steps = named.steps
    assert explain_other_than_steepest(steps) == ""
    other = next(s for s in steps.first.scores if s.name == "speed_dependent_torque")
    favoured = replace(other, drop=1e6, p=0.0)
    told = explain_other_than_steepest(promising(steps, favoured))
    assert told.startswith(
        "speed_dependent_torque promises most in one linear step from the base model"
    )
    assert "yet the verdict is stator_resistance, which lowers the deviance by" in told
    assert "speed_dependent_torque" in told
    assert explain_other_than_steepest(promising(steps, replace(favoured, drop=1.0))) == ""


def test_parameters_stand_before_and_after_with_meaning_unit_interval_and_verdict(named, tmp_path):
    words, _ = page(named, tmp_path)
    assert "parameter meaning unit before after 95 % interval verdict" in words
    assert "R_s stator resistance on the record's base pu not in it" in words
    graded = named.steps.base_grade.parameters, named.steps.graded_parameters
    before, after = ({e.parameter.name: e for e in group} for group in graded)
    assert before.keys() == after.keys() - {"R_s"}
    for e in after.values():
        low, high = e.interval
        assert low < e.value < high
        assert e.verdict.split()[0].rstrip(":") in ("identified", "weakly", "not")
        assert f"{low:.4g} to {high:.4g}" in words
    told = named.content["parameters"]
    assert told == {n: {"value": e.value, "standard_error": e.error} for n, e in after.items()}


def test_what_is_drawn_and_told_is_of_the_graded_model(named):
    """The fits by which effects are ranked weigh otherwise: their curves and parameters are near,
    and not the same.
    """
    steps = named.steps
    known = steps.final_grade.uncertainty
    values = dict(zip(known.names, known.values, strict=True))
    assert {
        e.parameter.name: e.value for e in steps.graded_parameters
    } == values | steps.undetermined_values
    for ranked, graded in zip(steps.overlays, steps.graded_overlays, strict=True):
        (fit,) = (
            one
            for one in steps.final_grade.fits
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
        grade = found.content["adequacy"]
        told = f"{whose}{grade['grade'].replace('_', ' ')}: {grade['sentence']}"
        assert words.index(told) < words.index("; the next dip of 40 %") < words.index("Next: ")
    assert named.fit.grade == "adequate" != unexplained.fit.grade


def test_what_is_not_extended_is_not_called_so(silent, unexplained, tmp_path):
    for found, word in ((silent, "none"), (unexplained, "unexplained")):
        assert found.verdict == word
        words, charts = page(found, tmp_path)
        assert "extended" not in words.lower()
        assert "Parameters of the base model" in words
        assert "before after" not in words
        assert all("extended model" not in names(chart) for chart in charts)
        shown = [names(chart) for chart in charts if "measured" in names(chart)]
        assert len(shown) == len([*found.question.train, *found.question.validate])
        assert all("base model" in of_event for of_event in shown)
        assert found.content["extended"] is None


def test_what_is_left_is_told_with_channel_start_and_size(unexplained, tmp_path):
    words, _ = page(unexplained, tmp_path)
    remainder = unexplained.content["remainder"]
    assert ("P", "step") in {(shape["channel"], shape["kind"]) for shape in remainder["of_base"]}
    headline = remainder["sentence"]
    assert headline.startswith(
        ("the base model misses this: ", "the nearest candidates miss this: ")
    )
    assert headline[1:] in words[: words.index("Measured and calculated")]
    assert "Missed by the base model" in words


def test_what_is_left_is_written_sample_by_sample(unexplained, tmp_path):
    unexplained.write_results(tmp_path)
    path = tmp_path / "unexplained.csv"
    rows = np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding=None)
    assert len(rows) == sum(event.record.samples for event in unexplained.question.train)
    assert np.abs(rows["P"]).max() > 5 * 0.002  # the step stands out of the noise


def test_an_unexplained_verdict_does_not_contradict_itself(unexplained, tmp_path):
    """It says what was tested, not what the catalogue holds, and numbers that can be pictured."""
    reason = unexplained.reason
    tested = len(TWO) + 3  # and what may be wrong with the measurement
    assert f"none of the {tested} effects tested" in reason
    assert "catalogue" not in reason
    assert not re.search(r"e-\d\d", reason)
    near, row_of = unexplained.content["nearest"], unexplained.steps.evidence.row_of
    told = re.search(
        r"the nearest, miss(?:es)? (\S+) % of the response there,"
        r" where the base model misses (\S+) %",
        reason,
    )
    errors = [row_of(tuple(names)).prediction.error for names in (near["effects"], ())]
    assert [*map(float, told.groups())] == pytest.approx(
        [100 * error for error in errors], rel=0.05
    )
    assert join_words(near["effects"]) in reason, (
        "the sentence and what is told of the nearest name the same effects"
    )
    assert {"value", "standard_error", "interval"} == next(iter(near["parameters"].values())).keys()
    words, _ = page(unexplained, tmp_path)
    assert not re.search(r"\d\.\d+e-\d\d\d", words)
