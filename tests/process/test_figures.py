"""The figures of a run: what they show, what they leave out, and that they can be trusted to be the
same again.
"""

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from tractexp.blocks import style
from tractexp.errors import UserError
from tractexp.report import figures


def event(samples: int = 1000) -> tuple[np.ndarray, np.ndarray, figures.Power, figures.Power]:
    """A dip to half the voltage, and a load that answers with squares and cubes of it, seen with
    noise.
    """
    t = np.linspace(0.0, 1.0, samples)
    U = np.where((t > 0.2) & (t < 0.4), 0.5, 1.0)
    noise = 0.004 * np.random.default_rng(0).standard_normal((2, samples))
    P, Q = 0.8 * U**2, 0.4 * U**3
    return t, U, (P + noise[0], Q + noise[1]), (P, Q)


def draw_fit(path: Path, samples: int = 1000, **more) -> Path:
    keywords = {"title": "tibet_50pct, issa", "epsilon": (0.0123, 0.0045)} | more
    return figures.fit(path, *event(samples), **keywords)


def texts(path: Path) -> list[str]:
    return [
        "".join(node.itertext())
        for node in ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}text")
    ]


def test_fit_names_its_axes_units_and_errors(tmp_path):
    found = texts(
        draw_fit(tmp_path / "fit.svg", notes=["Synthetic stand-in for an unpublished record."])
    )
    for expected in (
        "tibet_50pct, issa",
        "Synthetic stand-in for an unpublished record.",
        "U [pu]",
        "P [pu]",
        "Q [pu]",
        "residual [pu]",
        "t [s]",
        "P measured",
        "P calculated (epsilon_p = 1.23 %)",
        "Q measured",
        "Q calculated (epsilon_q = 0.45 %)",
    ):
        assert expected in found


def test_the_same_figure_gives_the_same_bytes(tmp_path):
    assert draw_fit(tmp_path / "a.svg").read_bytes() == draw_fit(tmp_path / "b.svg").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.svg", "b.svg"]


@pytest.mark.parametrize("samples", [2, 1000, 60_000])
def test_files_stay_small_however_long_the_record(tmp_path, samples):
    assert draw_fit(tmp_path / "fit.svg", samples).stat().st_size < 200_000


def test_thinning_keeps_a_dip_of_one_sample_and_the_gap_beside_it():
    x = np.arange(60_000.0)
    y = np.sin(x / 9000)
    y[31_234], y[40_000:40_500] = -7.0, np.nan
    shown_x, shown_y = style.thin(x, y)
    assert len(shown_x) <= 1.01 * style.MOST_POINTS_A_LINE + 2
    assert shown_y[shown_x == 31_234] == -7.0
    assert np.isnan(shown_y[(shown_x >= 40_000) & (shown_x < 40_500)]).all()
    assert np.isnan(shown_y).any()
    assert (shown_x[0], shown_x[-1]) == (0, 59_999)
    np.testing.assert_array_equal(shown_y, y[shown_x.astype(int)])


def test_thinning_leaves_a_short_line_alone():
    x, y = np.arange(10.0), np.arange(10.0) ** 2
    assert style.thin(x, y) == (x, y)


def test_a_gap_in_the_measured_power_is_a_gap_in_the_line(tmp_path):
    t, U, (P, Q), calculated = event(100)
    P[40:60] = np.nan

    def strokes(path: Path) -> int:
        """How often the pen is set down for the measured lines."""
        lines = re.findall(r'<path d="([^"]*)"[^>]*stroke: #9a9a9a', path.read_text())
        return sum(line.count("M") for line in lines if line.count("L") > 20)

    whole = figures.fit(tmp_path / "a.svg", *event(100), title="", epsilon=(0, 0))
    broken = figures.fit(tmp_path / "b.svg", t, U, (P, Q), calculated, title="", epsilon=(0, 0))
    assert (strokes(whole), strokes(broken)) == (2, 3)


def test_columns_that_cannot_be_drawn_are_refused_by_name(tmp_path):
    t, U, measured, calculated = event(20)

    def draw(t=t, U=U, measured=measured, calculated=calculated):
        figures.fit(tmp_path / "fit.svg", t, U, measured, calculated, title="", epsilon=(0, 0))

    with pytest.raises(UserError, match="at least 2 samples, there are 0"):
        draw(t=t[:0])
    with pytest.raises(UserError, match="t has 20 samples and U has 19"):
        draw(U=U[:-1])
    with pytest.raises(UserError, match="calculated_Q has no finite value"):
        draw(calculated=(calculated[0], np.full(20, np.nan)))


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "taken").write_text("a file where a folder should be")
    with pytest.raises(UserError, match=r"taken.fit\.svg cannot be written"):
        draw_fit(tmp_path / "taken" / "fit.svg")


def test_matplotlib_waits_for_the_first_figure_and_pyplot_is_never_needed(tmp_path):
    script = """
import sys, pathlib, numpy as np
from tractexp.report import figures
assert "matplotlib" not in sys.modules
x = np.arange(5.0)
figures.fit(pathlib.Path(sys.argv[1]), x, x, (x, x), (x, x), title="", epsilon=(0, 0))
assert "matplotlib.pyplot" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "fit.svg")], check=True)
