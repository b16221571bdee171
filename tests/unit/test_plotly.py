"""The part of Plotly.js that pages carry."""

import base64
import gzip
import re

import numpy as np
import pytest

from tractexp.blocks import Report, plotly
from tractexp.blocks.chart import Chart
from tractexp.blocks.chart_script import build_script


@pytest.fixture(scope="module")
def whole():
    return plotly.find_library().read_text(encoding="utf-8")


def test_a_page_with_charts_is_small_and_one_without_carries_no_library(tmp_path):
    chart = Chart("t", ["y"]).line("y", np.arange(3), np.arange(3), "#0072B2")
    with_chart = Report("charts").chart(chart, "one").save(tmp_path / "charts.html")
    without = Report("words").text("none").save(tmp_path / "words.html")
    assert with_chart.stat().st_size < 6e5
    assert without.stat().st_size < 2e4


def test_the_part_keeps_its_license_its_lines_and_bars_and_no_map(whole):
    part = gzip.decompress(
        base64.b64decode(re.search(r'run\("([\w+/=]+)"\)', build_script())[1])
    ).decode()
    assert part.startswith(plotly.select_needed_modules(whole))
    assert part[:200] == whole[:200]
    assert "Licensed under the MIT license" in part[:200]
    assert plotly.TRACE in part
    assert 'name:"scatter"' in part
    assert 'name:"scattermap"' in whole
    assert 'name:"scattermap"' not in part


@pytest.mark.parametrize("text", ["", "var Plotly=(()=>{})();", "1"])
def test_a_library_that_is_made_otherwise_is_taken_whole(text):
    assert plotly.select_needed_modules(text) == text


def test_a_library_without_a_known_register_is_taken_whole(whole):
    other = whole.replace(".register([", ".enroll([")
    assert plotly.select_needed_modules(other) == other
