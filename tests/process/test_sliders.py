"""The sliders of a page, in a browser: at the estimate they show the fit's own errors, and moved
they show others.
"""

import re

import pytest
from browser import BROWSER, Worked, drawn

import tractexp
from tractexp.blocks import Report
from tractexp.report.sheet import build_sheet
from tractexp.report.sliders import add_sliders

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no browser is installed")
MOVE = """
const told = [], say = () => told.push(document.querySelector(".sliders p").textContent);
const slider = document.querySelector(".sliders input");
say();
slider.value = slider.max; slider.dispatchEvent(new Event("input")); say();
document.querySelector(".sliders button").click(); say();
document.querySelector("#told").textContent = told.join("|");
"""


@pytest.fixture(scope="module")
def fit():
    search = {"name": "multistart_least_squares", "starts": 2}
    return tractexp.identify("tibet_50pct", optimizer=search, check_intervals=False, progress=False)


def test_at_the_estimate_they_show_the_errors_of_the_fit(fit, tmp_path):
    page = Report("moved")
    add_sliders(page, fit)
    elements, complaints = drawn(Worked(page, MOVE), tmp_path)
    assert complaints == []
    (told,) = re.findall(r'id="told"[^>]*>([^<]*)<', elements)
    at_first, moved, back = told.split("|")
    assert at_first == back != moved
    errors = [float(x) for x in re.findall(r"epsilon_[pq] ([\d.e-]+) %", at_first)]
    (event,) = fit.result.events
    expected = [100 * event["epsilon_p"], 100 * event["epsilon_q"]]
    assert errors == pytest.approx(expected, rel=1e-4)


def test_the_sheet_is_small_and_whole(fit, tmp_path):
    elements, complaints = drawn(build_sheet(fit), tmp_path)
    assert complaints == []
    assert (tmp_path / "page.html").stat().st_size < 1e6
    for part in ("DOUBTFUL", "The motor on its own rating", "How this sheet was made"):
        assert part in elements
    assert "main-svg" in elements  # what Plotly draws
