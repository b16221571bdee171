"""Charts: what goes in is what is handed to the browser; test_chart_in_a_browser.py draws them."""

import base64
import itertools
import json

import numpy as np
import pytest
from pages import charts, unpacked

from tractexp.blocks.chart import MOST_LINE_POINTS, Chart

BLUE = "#0072B2"


def test_a_curve_keeps_every_value_and_its_gaps():
    x, y = np.arange(0, 1, 0.001), np.sin(np.arange(1000.0))
    y[500:510] = np.nan
    (trace,) = Chart("t [s]", ["P [pu]"]).line("P", x, y, BLUE).plain()["data"]
    assert np.array_equal(unpacked(trace["x"]), x)
    np.testing.assert_array_equal(unpacked(trace["y"]), y.astype("f4"))


def test_a_long_curve_keeps_its_spike():
    y = np.zeros(1_000_000)
    y[654_321] = 1.0
    (trace,) = Chart("t", ["y"]).line("y", np.arange(1e6), y, BLUE).plain()["data"]
    assert len(unpacked(trace["y"])) < 2 * MOST_LINE_POINTS
    assert unpacked(trace["x"])[unpacked(trace["y"]).argmax()] == 654_321


def test_a_label_says_which_of_several_panels_it_is_of():
    chart = Chart("t", ["P [pu]", "ΔQ [pu]"])
    for panel in (0, 1):
        chart.line("estimate", np.arange(3), np.arange(3), BLUE, panel)
    said = [trace["hovertemplate"] for trace in chart.plain()["data"]]
    assert [words.split("%")[0] for words in said] == ["P ", "ΔQ "]
    (alone,) = Chart("t", ["P [pu]"]).line("P", np.arange(3), np.arange(3), BLUE).plain()["data"]
    assert alone["hovertemplate"].startswith("%")


def test_equal_names_are_one_entry_of_the_legend():
    chart = Chart("t", ["P", "Q"])
    for panel in (0, 1):
        chart.line("measured", np.arange(3), np.arange(3), BLUE, panel).shade(
            0, 1, BLUE, panel, "dip"
        )
    shown = [trace["name"] for trace in chart.plain()["data"] if trace["showlegend"]]
    assert shown == ["measured", "dip"]


def test_panels_fill_the_height_without_overlap():
    layout = Chart("t", list("abc"), heights=(1, 2, 2)).plain()["layout"]
    spans = [layout[key]["domain"] for key in ("yaxis", "yaxis2", "yaxis3")]
    assert spans[0][1] == 1.0
    assert spans[-1][0] == pytest.approx(0.0, abs=1e-12)
    assert all(upper[0] > lower[1] for upper, lower in itertools.pairwise(spans))


def test_an_axis_takes_names_and_a_short_logarithmic_one_more_than_powers_of_ten():
    layout = (
        Chart("x", [""], log_x=True)
        .ticks(0, [0, 1], ["a<", "b"])
        .limits(None, 2e-5, 9e-5)
        .plain()["layout"]
    )
    assert (layout["yaxis"]["tickvals"], layout["yaxis"]["ticktext"]) == ([0, 1], ["a&lt;", "b"])
    assert "dtick" not in layout["xaxis"]
    assert (
        Chart("x", [""], log_x=True).limits(None, 1, 1e4).plain()["layout"]["xaxis"]["dtick"] == 1
    )
    assert (
        Chart("", [""]).ticks(None, [0], ["a"], turned=True).plain()["layout"]["xaxis"]["tickangle"]
        == -90
    )


def test_a_curve_without_legend_is_named_where_it_is_pointed_at():
    chart = Chart("x", ["y"], hover="closest").line("one", np.arange(3), np.arange(3), BLUE)
    chart.line("other", np.arange(3), np.arange(3), BLUE, legend=False)
    told = chart.plain()
    assert [(t["name"], t["showlegend"]) for t in told["data"]] == [("one", True), ("other", False)]
    assert told["layout"]["hovermode"] == "closest"


def test_a_legend_that_takes_several_lines_on_a_phone_leaves_a_line_to_the_buttons():
    chart = Chart("x", ["y"])
    for name in ("pso", "issa"):
        chart.line(name, np.arange(3), np.arange(3), BLUE)
    assert "title" not in chart.plain()["layout"]["legend"]
    chart.line("multistart_least_squares", np.arange(3), np.arange(3), BLUE)
    assert chart.plain()["layout"]["legend"]["title"]["side"] == "top"


def test_a_sampled_line_keeps_every_sample_and_its_gaps():
    y = np.sin(np.arange(50_000) / 7)
    y[[3, 49_999]] = np.nan
    (trace,) = Chart("t", ["y"]).samples("y", 0.5, 1e-3, y, BLUE).plain()["data"]
    kept = trace["samples"]
    held = np.frombuffer(base64.b64decode(kept["bdata"]), "<i2").astype(float)
    held[held == -32768] = np.nan
    assert (kept["start"], kept["step"]) == (0.5, 1e-3)
    np.testing.assert_allclose(kept["offset"] + kept["scale"] * held, y, atol=2e-5)
    assert "x" not in trace, "the page makes the points that it draws"


def test_a_sampled_line_of_one_value_or_none_is_drawn():
    for y in (np.full(9, 3.0), np.full(9, np.nan)):
        (trace,) = Chart("t", ["y"]).samples("y", 0.0, 1.0, y, BLUE).plain()["data"]
        json.dumps(trace, allow_nan=False)
        held = np.frombuffer(base64.b64decode(trace["samples"]["bdata"]), "<i2").astype(float)
        held[held == -32768] = np.nan
        np.testing.assert_allclose(trace["samples"]["offset"] + trace["samples"]["scale"] * held, y)


def test_a_shade_may_have_a_word_at_its_top():
    layout = Chart("t", ["a", "b"]).shade(1.0, 2.0, BLUE, text="dip <1>").plain()["layout"]
    (note,) = layout["annotations"]
    assert (note["text"], note["x"], note["yref"]) == ("dip &lt;1&gt;", 1.0, "paper")


def test_curves_of_one_record_have_their_times_once():
    t = np.arange(0, 1, 0.001)
    chart = Chart("t [s]", ["P", "Q"]).line("P", t, t, BLUE).line("Q", t, 2 * t, BLUE, 1)
    element = chart.element("two")
    assert element.count('"count":1000') == 1
    first, second = charts(element)[0]["data"]
    for trace in (first, second):
        np.testing.assert_allclose(unpacked(trace["x"]), t, atol=1e-9)
    np.testing.assert_allclose(unpacked(second["y"]), 2 * t, atol=2 / 65_000)


def test_a_logarithmic_axis_keeps_its_small_values():
    y = np.geomspace(1e-12, 1, 50)
    chart = Chart("n", ["f"], log_y=True).line("f", np.sqrt(y), y, BLUE)
    (trace,) = charts(chart.element("one"))[0]["data"]
    np.testing.assert_allclose(unpacked(trace["y"]), y, rtol=1e-6)
    np.testing.assert_allclose(unpacked(trace["x"]), np.sqrt(y), rtol=1e-12)  # not even
