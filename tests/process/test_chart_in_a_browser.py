"""Charts in a browser: drawn without a network, at every width, on paper; zoomed in and out."""

import json
import re

import numpy as np
import pytest
from browser import BROWSER, Worked, drawn

from tractexp.blocks import Report, plotly
from tractexp.blocks.block import Markup
from tractexp.blocks.chart import Chart
from tractexp.blocks.chart_script import build_script

BLUE = "#0072B2"


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed here")
@pytest.mark.parametrize("opened", [False, True])
def test_a_folded_chart_is_drawn_when_it_is_opened(tmp_path, opened):
    page, chart = Report("charts"), Chart("x", ["y"]).line("one", np.arange(3), np.arange(3), BLUE)
    page.chart(chart, "shown")
    with page.fold_blocks("more"):
        page.chart(chart, "folded")
    if opened:
        page.add(
            Markup(
                "<script>setTimeout(() => document.querySelector('details').open = true,"
                " 500)</script>"
            )
        )
    dom, complaints = drawn(page, tmp_path)
    assert complaints == []
    assert dom.count('class="chart js-plotly-plot"') == 1 + opened


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed here")
@pytest.mark.parametrize("width", [500, 1280])  # a headless browser is no narrower than 500
def test_a_browser_draws_every_kind_and_complains_of_nothing(tmp_path, width):
    x = np.linspace(0, 1, 50)
    chart = Chart("t [s]", ["U", "P"]).line("U", x, x, BLUE).band("noise", x, x - 1, x + 1, BLUE, 1)
    chart.shade(0.2, 0.3, BLUE, name="dip").edge(0.2).level(0.5, "half").limits(None, 0, 1)
    bars = Chart("gain", [""]).bars("gain", ["a", "b"], [2, 1], BLUE, hover=["two", "one"])
    forest = Chart("value", [""]).points(
        "est", [0.3], ["C"], BLUE, spans=np.array([[0.1, 0.4]]), hover=["C"]
    )
    fitness = (
        Chart("n", ["f"], log_x=True, log_y=True)
        .line("f", x + 1, x + 1, BLUE, step=True)
        .level(1.5, "floor")
    )
    page = Report("charts").chart(chart, "one").charts([bars, forest, fitness], "three")
    dom, complaints = drawn(page, tmp_path, f"--window-size={width},900")
    assert complaints == []
    assert dom.count('class="chart js-plotly-plot"') == 4
    widths = [float(w) for w in re.findall(r'class="main-svg"[^>]*?width="([\d.]+)"', dom)]
    assert widths
    assert max(widths) <= width


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_a_chart_is_drawn_by_the_parts_of_the_library_as_by_the_whole(tmp_path, monkeypatch):
    x = np.linspace(0, 1, 50)
    chart = (
        Chart("t [s]", ["U", "P"])
        .line("U", x, x**2, BLUE)
        .band("noise", x, x - 1, x + 1, BLUE, 1)
        .edge(0.2)
    )
    bars = Chart("gain", [""]).bars("gain", ["a", "b"], [2, 1], BLUE)
    page, drawings = Report("charts").charts([chart, bars], "two"), []
    whole = plotly.find_library().read_text(encoding="utf-8")
    for code in (plotly.read_code(), whole):
        monkeypatch.setattr(plotly, "read_code", lambda code=code: code)
        monkeypatch.setattr(plotly, "compute_digest", lambda code=code: f"{len(code)} letters")
        build_script.cache_clear()
        dom, complaints = drawn(page, tmp_path)
        assert complaints == []
        drawings.append(re.findall(r' d="([^"]+)"', re.sub(r"(?s)<script>.*?</script>", "", dom)))
    build_script.cache_clear()
    assert len(drawings[0]) > 20
    assert drawings[0] == drawings[1]


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_a_browser_that_cannot_unpack_the_library_says_so(tmp_path):
    page = Report("charts").add(Markup("<script>delete self.DecompressionStream</script>"))
    page.chart(Chart("x", ["y"]).line("one", np.arange(3), np.arange(3), BLUE), "one")
    dom, complaints = drawn(page, tmp_path)
    assert complaints == []
    # in the script and in the chart
    assert dom.count("Browsers older than 2023 do not draw this chart.") == 2


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_zoomed_in_every_sample_is_drawn_and_zoomed_out_no_spike_is_lost(tmp_path):
    y = np.sin(np.arange(100_000) / 50)
    y[[77_777, 20_000]] = 9, -9
    chart = Chart("t", ["y"]).samples("y", 0.0, 1e-3, y, BLUE)
    script = """
    const told = [], tell = () => {
      const {x, y} = charts[0].data[0];
      told.push([x.length, Math.max(...y), Math.min(...y), \
x.filter(v => v >= 50 && v <= 50.5).length, x[0], x.at(-1)]);
    };
    tell();
    Plotly.relayout(charts[0], {"xaxis.range": [50, 50.5]}).then(() => { tell();
      Plotly.relayout(charts[0], {"xaxis.autorange": true}).then(() => { tell();
        document.getElementById("told").textContent = JSON.stringify(told); }); });
    """
    dom, complaints = drawn(Worked(Report("zoom").chart(chart, "one"), script), tmp_path)
    assert complaints == []
    whole, near, again = json.loads(re.search(r'id="told">(.*?)</p>', dom)[1])
    assert whole[0] < 2200
    assert whole[1:3] == pytest.approx([9, -9], abs=1e-3)
    assert near[3] == 501
    assert near[0] < 520
    assert near[4:] == [0, pytest.approx(99.999)]  # both ends keep the axis of the whole
    assert again == whole


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_the_cursor_reads_every_curve_and_turns_the_phasors(tmp_path):
    """A quarter of a cycle later voltage and current have turned alike: their angles stay, values
    do not.
    """
    t = np.arange(4000) / 4000
    u, i = (
        np.sqrt(2) * 10 * np.cos(2 * np.pi * 50 * t),
        np.sqrt(2) * np.cos(2 * np.pi * 50 * t - np.pi / 6),
    )
    chart = Chart("t [s]", ["u [kV]", "i [kA]", "status"])
    chart.samples("a", 0.0, 1 / 4000, u, BLUE, label="a (<b>U1)").samples(
        "a", 0.0, 1 / 4000, i, BLUE, 1, label="a (I1)"
    )
    turn = np.exp(2j * np.pi * 50 * t)[::4]
    chart.phasors("a", 0.0, 1e-3, 10 * turn, BLUE, 0).phasors(
        "a", 0.0, 1e-3, np.exp(-1j * np.pi / 6) * turn, BLUE, 1
    )
    chart.states([("trip", np.array([0.0, 0.3, 1.0]), np.array([0, 1, 1]))], 2, BLUE)
    chart.cursor(0.2).edge(0.3, text="trigger")
    script = """
    const told = [], box = charts[0].previousElementSibling;
    const texts = () => [...box.querySelectorAll("tr")].map(row => row.textContent);
    const tell = () => told.push(texts(), box.querySelectorAll("line").length);
    tell();
    charts[0].emit("plotly_hover", {xvals: [0.405], points: []}); tell();
    document.getElementById("told").textContent = JSON.stringify(told);"""
    dom, complaints = drawn(Worked(Report("waves").chart(chart, "waves"), script), tmp_path)
    assert complaints == []
    first, arrows, later, _ = json.loads(
        re.search(r"<p id=.told.>(.*?)</p>", dom)[1].replace("&lt;", "<").replace("&gt;", ">")
    )
    assert arrows == 2
    phasors = ["phasors of u [kV]a 10 ∠ 0.0°", "phasors of i [kA]a 1 ∠ -30.0°"]
    assert first[:2] == ["t [s] 0.2000", "u [kV]a (<b>U1) 14.142"]
    assert first[3:] == ["status", *phasors]  # not tripped
    assert later[1].startswith("u [kV]a (<b>U1) ")
    assert abs(float(later[1].split()[-1])) < 1e-3
    assert later[3:] == ["statustrip ", *phasors]


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_a_button_goes_from_megawatts_to_per_unit_and_back(tmp_path):
    x = np.linspace(0, 1, 50)
    y = np.where(x > 0.9, np.nan, x)
    chart = Chart("t [s]", ["U [pu]", "P [pu]"]).line("U", x, y, BLUE)
    chart.band("noise", x, x - 1, x + 1, BLUE, 1).line("rival", x, 2 * x, BLUE, 1, hidden=True)
    chart.units(["U [kV]", "P [MW]"], [27.5, 40.0])
    script = """
    const told = [], [chart] = charts, button = document.querySelector("button.units");
    const tell = () => told.push([button.textContent, chart.layout.yaxis.title.text,
      chart.layout.yaxis2.title.text, chart.data[0].y[10], chart.data[2].y[49],
      Number.isNaN(chart.data[0].y[49]), chart.data[3].visible]);
    tell(); button.click(); tell(); button.click(); tell();
    document.getElementById("told").textContent = JSON.stringify(told);"""
    dom, complaints = drawn(Worked(Report("units").chart(chart, "one"), script), tmp_path)
    assert complaints == []
    megawatts, per_unit, again = json.loads(re.search(r'id="told">(.*?)</p>', dom)[1])
    assert megawatts == again
    assert megawatts[:3] == ["in pu", "U [kV]", "P [MW]"]
    assert per_unit[:3] == ["in physical units", "U [pu]", "P [pu]"]
    assert per_unit[3:5] == pytest.approx([10 / 49, 2], abs=1e-4)
    assert megawatts[3:5] == pytest.approx([27.5 * 10 / 49, 80], abs=1e-2)
    assert megawatts[5:] == per_unit[5:] == [True, "legendonly"]


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_currents_go_from_amperes_to_per_unit_and_back_with_all_their_samples(tmp_path):
    i = np.sin(np.arange(5000) / 50)
    chart = Chart("t [s]", ["i [pu]"]).samples("i", 0.0, 1e-3, i, BLUE)
    chart.units(["i [A]"], [250.0]).limits(None, 1.0, 2.0)
    powers = Chart("t [s]", ["P [pu]"]).line("P", np.arange(3), np.arange(3), BLUE)
    script = """
    const told = [], [button] = document.querySelectorAll("button.units"), [chart] = charts;
    const tell = () => told.push([chart.layout.yaxis.title.text, chart.data[0].y.length,
      Math.max(...chart.data[0].y), charts[1].data[0].y[2]]);
    tell(); button.click(); tell(); button.click(); tell();
    Plotly.relayout(chart, {"xaxis.range": [0, 4.999]}).then(() => { button.click(); tell();
      document.getElementById("told").textContent = JSON.stringify(told); });"""
    page = Report("units").chart(chart, "i").chart(powers.units(["P [MW]"], [40.0]), "P")
    dom, complaints = drawn(Worked(page, script), tmp_path)
    assert complaints == []
    amperes, per_unit, again, whole = json.loads(re.search(r'id="told">(.*?)</p>', dom)[1])
    assert amperes == again == ["i [A]", 1003, pytest.approx(250, abs=0.1), pytest.approx(80)]
    assert per_unit == ["i [pu]", 1003, pytest.approx(1, abs=1e-3), pytest.approx(2)]
    assert whole == ["i [pu]", 2000, pytest.approx(1, abs=1e-3), pytest.approx(2)]


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_a_click_is_answered_below_the_chart(tmp_path):
    x = np.linspace(0, 1, 50)
    chart = Chart("t [s]", ["P [pu]"]).line("P", x, x, BLUE)
    chart.answers([(0.0, 0.5, "P: <b>early</b>"), (0.4, 1.0, "Q: late")])
    script = """
    const told = [], box = document.querySelector(".answer");
    [0.2, 0.45, 0.9, 3].forEach(x => {
      charts[0].emit("plotly_click", {points: [{x}]}); told.push(box.textContent); });
    document.getElementById("told").textContent = JSON.stringify(told);"""
    dom, complaints = drawn(Worked(Report("clicks").chart(chart, "one"), script), tmp_path)
    assert complaints == []
    told = json.loads(
        re.search(r'id="told">(.*?)</p>', dom)[1].replace("&lt;", "<").replace("&gt;", ">")
    )
    early, late = "P: <b>early</b>", "Q: late"
    assert told == [early, early + late, late, ""]
