"""How figures look: sizes, colors, the settings that make them small, alike on every machine and
reproducible.
"""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.storage import files

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito 2008, "Color universal design": told apart by color-blind readers.
MEASURED = "#9A9A9A"
ACTIVE, REACTIVE, VOLTAGE = "#D55E00", "#0072B2", "#000000"
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
PHASES = ("#E69F00", "#009E73", "#56B4E9")  # a, b, c: none of them is a model's, nor P's or Q's
FAINT = "#666666"
BEHIND = "#CFCFCF"  # what is there to compare with, behind what is shown

MOST_POINTS_A_LINE = 800  # a line has at most about this many: a page is narrower than that
SETTINGS: Any = {
    "svg.fonttype": "none",  # text stays text: searchable, readable by machines, no fonts to embed
    "svg.hashsalt": "tractexp",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "axes.edgecolor": "#444444",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.direction": "out",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.3,
    "axes.xmargin": 0.01,
}


def thin(
    x: np.ndarray, y: np.ndarray, points: int = MOST_POINTS_A_LINE
) -> tuple[np.ndarray, np.ndarray]:
    """Thin a curve for drawing, so that no dip or spike is lost, however short.

    Parameters
    ----------
    x, y : (n,)
        The curve; nan in y is a gap and stays one.
    points : int
        At most about so many are kept: the lowest and highest of each of half as many stretches.

    Returns
    -------
    two (m,) arrays
        x and y of the points kept; all of them where there are few.
    """
    if len(y) <= points:
        return x, y
    parts = points // 2
    rows = np.full((parts, -(-len(y) // parts)), np.nan)
    rows.ravel()[: len(y)] = y
    missing = np.isnan(rows)
    low, high = (
        np.where(missing, np.inf, rows).argmin(1),
        np.where(missing, -np.inf, rows).argmax(1),
    )
    gap = np.where(missing.any(1), missing.argmax(1), low)
    chosen = np.concatenate(
        [np.arange(parts) * rows.shape[1] + column for column in (low, high, gap)]
        + [[0, len(y) - 1]]
    )
    index = np.unique(chosen[chosen < len(y)])
    return x[index], y[index]


def save(figure: "Figure", path: Path) -> Path:
    """Write a figure as SVG or PNG, by the suffix; the same figure gives the same bytes. Raises
    `UserError`.
    """
    path = Path(path)
    metadata = (
        {"Date": None, "Creator": "tractexp"} if path.suffix == ".svg" else {"Software": "tractexp"}
    )
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix[1:], metadata=metadata, dpi=150)
    return files.write(path, drawn.getvalue())
