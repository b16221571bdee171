"""Charts: what goes in is what a browser draws, without a network, at every width, on paper."""

import base64
import itertools
import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from tractexp.report.chart import MOST, Chart
from tractexp.report.page import Page

BLUE = "#0072B2"
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def drawn(page, folder, *options):
    """What a browser that reaches no other computer makes of a page: its elements, and what it complains of."""
    path = page.write(folder / "page.html")
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        f"--user-data-dir={folder / 'browser'}", "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr",
        "--v=0", *options, "--dump-dom", path.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def unpacked(packed):
    return np.frombuffer(base64.b64decode(packed["bdata"]), dtype=f"<{packed['dtype']}")


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
    assert len(unpacked(trace["y"])) < 2 * MOST
    assert unpacked(trace["x"])[unpacked(trace["y"]).argmax()] == 654_321


def test_equal_names_are_one_entry_of_the_legend():
    chart = Chart("t", ["P", "Q"])
    for panel in (0, 1):
        chart.line("measured", np.arange(3), np.arange(3), BLUE, panel).shade(0, 1, BLUE, panel, "dip")
    shown = [trace["name"] for trace in chart.plain()["data"] if trace["showlegend"]]
    assert shown == ["measured", "dip"]


def test_panels_fill_the_height_without_overlap():
    layout = Chart("t", list("abc"), heights=(1, 2, 2)).plain()["layout"]
    spans = [layout[key]["domain"] for key in ("yaxis", "yaxis2", "yaxis3")]
    assert spans[0][1] == 1.0
    assert spans[-1][0] == pytest.approx(0.0, abs=1e-12)
    assert all(upper[0] > lower[1] for upper, lower in itertools.pairwise(spans))


def test_an_axis_takes_names_and_a_short_logarithmic_one_more_than_powers_of_ten():
    layout = Chart("x", [""], log_x=True).ticks(0, [0, 1], ["a<", "b"]).limits(None, 2e-5, 9e-5).plain()["layout"]
    assert (layout["yaxis"]["tickvals"], layout["yaxis"]["ticktext"]) == ([0, 1], ["a&lt;", "b"])
    assert "dtick" not in layout["xaxis"]
    assert Chart("x", [""], log_x=True).limits(None, 1, 1e4).plain()["layout"]["xaxis"]["dtick"] == 1
    assert Chart("", [""]).ticks(None, [0], ["a"], turned=True).plain()["layout"]["xaxis"]["tickangle"] == -90


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


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed here")
@pytest.mark.parametrize("opened", [False, True])
def test_a_folded_chart_is_drawn_when_it_is_opened(tmp_path, opened):
    page, chart = Page("charts"), Chart("x", ["y"]).line("one", np.arange(3), np.arange(3), BLUE)
    page.chart(chart, "shown")
    with page.folded("more"):
        page.chart(chart, "folded")
    if opened:
        page._add("<script>setTimeout(() => document.querySelector('details').open = true, 500)</script>")
    dom, complaints = drawn(page, tmp_path, "--virtual-time-budget=3000")
    assert complaints == []
    assert dom.count('class="chart js-plotly-plot"') == 1 + opened


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed here")
@pytest.mark.parametrize("width", [500, 1280])  # a headless browser is no narrower than 500
def test_a_browser_draws_every_kind_and_complains_of_nothing(tmp_path, width):
    x = np.linspace(0, 1, 50)
    chart = Chart("t [s]", ["U", "P"]).line("U", x, x, BLUE).band("noise", x, x - 1, x + 1, BLUE, 1)
    chart.shade(0.2, 0.3, BLUE, name="dip").edge(0.2).level(0.5, "half").limits(None, 0, 1)
    bars = Chart("gain", [""]).bars("gain", ["a", "b"], [2, 1], BLUE, told=["two", "one"])
    forest = Chart("value", [""]).points("est", [0.3], ["C"], BLUE, spans=np.array([[0.1, 0.4]]), told=["C"])
    fitness = Chart("n", ["f"], log_x=True, log_y=True).line("f", x + 1, x + 1, BLUE, step=True).level(1.5, "floor")
    page = Page("charts").chart(chart, "one").charts([bars, forest, fitness], "three")
    dom, complaints = drawn(page, tmp_path, f"--window-size={width},900")
    assert complaints == []
    assert dom.count('class="chart js-plotly-plot"') == 4
    widths = [float(w) for w in re.findall(r'class="main-svg"[^>]*?width="([\d.]+)"', dom)]
    assert widths
    assert max(widths) <= width


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


class Worked:
    """A page, and what a person does with it: a script that runs once the page is drawn."""

    def __init__(self, page, script):
        self.page, self.script = page, script

    def write(self, path):
        text = self.page.write(path).read_text(encoding="utf-8")
        path.write_text(text.replace("</body>", f"<p id=told></p><script>{self.script}</script></body>"))
        return path


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_zoomed_in_every_sample_is_drawn_and_zoomed_out_no_spike_is_lost(tmp_path):
    y = np.sin(np.arange(100_000) / 50)
    y[[77_777, 20_000]] = 9, -9
    chart = Chart("t", ["y"]).samples("y", 0.0, 1e-3, y, BLUE)
    script = """
    const told = [], tell = () => {
      const {x, y} = charts[0].data[0];
      told.push([x.length, Math.max(...y), Math.min(...y), x.filter(v => v >= 50 && v <= 50.5).length, x[0], x.at(-1)]);
    };
    tell();
    Plotly.relayout(charts[0], {"xaxis.range": [50, 50.5]}).then(() => { tell();
      Plotly.relayout(charts[0], {"xaxis.autorange": true}).then(() => { tell();
        document.getElementById("told").textContent = JSON.stringify(told); }); });
    """
    dom, complaints = drawn(Worked(Page("zoom").chart(chart, "one"), script), tmp_path, "--virtual-time-budget=5000")
    assert complaints == []
    whole, near, again = json.loads(re.search(r'id="told">(.*?)</p>', dom)[1])
    assert whole[0] < 2200
    assert whole[1:3] == pytest.approx([9, -9], abs=1e-3)
    assert near[3] == 501
    assert near[0] < 520
    assert near[4:] == [0, pytest.approx(99.999)]  # both ends keep the axis of the whole
    assert again == whole
