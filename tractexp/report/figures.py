"""The figures of a run: the fit of a recorded event, or its response. Arrays in, a file out.

Matplotlib is used through its objects and imported when the first figure is drawn. Labels avoid
mathematical typesetting, whose parser costs more than a figure.
"""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import style
from tractexp.errors import UserError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Power = tuple[np.ndarray, np.ndarray]  # P, Q [pu], each (N,)


def fit(
    path: Path,
    t: np.ndarray,
    U: np.ndarray,
    measured: Power,
    calculated: Power,
    *,
    title: str,
    epsilon: tuple[float, float],
    notes: Sequence[str] = (),
) -> Path:
    """Draw voltage, measured against calculated P and Q, and their residuals over time [s]; all in
    pu, shape (N,).

    `epsilon` is (epsilon_p, epsilon_q) of Eq. (20), fractions. `notes` are set under the title: say
    there when the data are synthetic. nan in the power is a gap. Raises `UserError` when there is
    nothing to draw.
    """
    _check_lengths(
        path,
        t=t,
        U=U,
        P=measured[0],
        Q=measured[1],
        calculated_P=calculated[0],
        calculated_Q=calculated[1],
    )
    from matplotlib import rc_context

    with rc_context(style.SETTINGS):
        figure, top = _open_figure(8.0, 7.8, title, notes)
        panels = figure.subplots(4, 1, sharex=True, height_ratios=(1.0, 1.7, 1.7, 1.1))
        figure.subplots_adjust(left=0.1, right=0.975, bottom=0.06, top=top, hspace=0.13)
        panels[0].plot(*style.thin(t, U), color=style.VOLTAGE, label="voltage")
        for panel, name, color, seen, output, error in zip(
            panels[1:3],
            "PQ",
            (style.ACTIVE, style.REACTIVE),
            measured,
            calculated,
            epsilon,
            strict=True,
        ):
            label = f"{name} calculated (epsilon_{name.lower()} = {100 * error:.3g} %)"
            panel.plot(
                *style.thin(t, seen), color=style.MEASURED, linewidth=2.6, label=f"{name} measured"
            )
            panel.plot(*style.thin(t, output), color=color, label=label)
            panels[3].plot(
                *style.thin(t, seen - output), color=color, linewidth=0.8, alpha=0.75, label=name
            )
        panels[3].axhline(0.0, color=style.FAINT, linewidth=0.7, zorder=0.5)
        for panel, label in zip(
            panels, ("U [pu]", "P [pu]", "Q [pu]", "residual [pu]"), strict=True
        ):
            _label_axis(panel, label, -0.085)
            _put_legend_above(panel)
        panels[3].set_xlabel("t [s]")
        return style.save(figure, path)


def draw_response(
    path: Path,
    t: np.ndarray,
    U: np.ndarray,
    calculated: Power,
    *,
    title: str,
    notes: Sequence[str] = (),
    band: tuple[float, float] | None = None,
) -> Path:
    """Draw voltage and calculated P and Q (N,) [pu] over time [s], of a simulation that no
    measurement stands beside; `band` has half the height [pu] of a shaded band about P and about Q.
    """
    _check_lengths(path, t=t, U=U, P=calculated[0], Q=calculated[1])
    from matplotlib import rc_context

    with rc_context(style.SETTINGS):
        figure, top = _open_figure(8.0, 5.2, title, notes)
        panels = figure.subplots(3, 1, sharex=True, height_ratios=(1.0, 1.5, 1.5))
        figure.subplots_adjust(left=0.1, right=0.975, bottom=0.09, top=top, hspace=0.13)
        colors = (style.VOLTAGE, style.ACTIVE, style.REACTIVE)
        for panel, name, color, values in zip(panels, "UPQ", colors, (U, *calculated), strict=True):
            panel.plot(*style.thin(t, values), color=color)
            _label_axis(panel, f"{name} [pu]", -0.085)
        if band is not None:
            for panel, values, half in zip(panels[1:], calculated, band, strict=True):
                times, middle = style.thin(t, values)
                panel.fill_between(times, middle - half, middle + half, color=style.FAINT)
        panels[2].set_xlabel("t [s]")
        return style.save(figure, path)


def _check_lengths(path: Path, **columns: np.ndarray) -> None:
    """Raise `UserError` for columns of other lengths than the times."""
    samples = len(columns["t"])
    if samples < 2:
        raise UserError(f"{path}: a figure needs at least 2 samples, there are {samples}")
    for name, values in columns.items():
        if len(values) != samples:
            raise UserError(
                f"{path}: t has {samples} samples and {name} has {len(values)}; they must be as"
                " many"
            )
        if not np.isfinite(values).any():
            raise UserError(f"{path}: {name} has no finite value to draw")


def _open_figure(
    width: float, height: float, title: str, notes: Sequence[str]
) -> "tuple[Figure, float]":
    """An empty figure [inch] with its heading, and how far up the panels may reach (a share of the
    height).
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    lines = [line for note in notes for line in textwrap.wrap(note, 118)]
    # a record's name is no formula, whatever stands in it
    written: Any = {"va": "top", "parse_math": False}
    figure.text(0.015, 1 - 0.1 / height, title, fontsize=11, fontweight="bold", **written)
    figure.text(
        0.015,
        1 - 0.31 / height,
        "\n".join(lines),
        color=style.FAINT,
        fontsize=8,
        linespacing=1.25,
        **written,
    )
    return figure, 1 - (0.52 + 0.14 * len(lines)) / height


def _put_legend_above(panel: "Axes") -> None:
    """Put a panel's legend above it."""
    panel.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.97),
        ncols=3,
        borderpad=0,
        borderaxespad=0,
        handlelength=1.6,
    )


def _label_axis(panel: "Axes", label: str, x: float) -> None:
    """Set the label of the vertical axis at a fixed place, where it lines up with
    its neighbors'.
    """
    panel.set_ylabel(label)
    panel.yaxis.set_label_coords(x, 0.5)
