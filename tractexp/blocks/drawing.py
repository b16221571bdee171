"""A chart as a picture for what runs no script: the same data as on a page, drawn by matplotlib."""

import base64
import io
import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.blocks import style
from tractexp.blocks.chart import Chart
from tractexp.blocks.packing import GREATEST_CODE
from tractexp.text.quoting import unescape_html

WIDTH, PANEL_HEIGHT = 7.0, 1.25  # inches
EQUATION_DPI = 200  # of one as PNG
DASHES = {"solid": "-", "dash": "--", "dot": ":"}


def draw_chart(chart: Chart, path: Path) -> Path:
    """Write the chart as SVG or PNG, by the suffix; what is drawn at a click is left out.

    Raises `UserError` where it cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    plain = chart.plain()
    layout, units = plain["layout"], plain.get("units", {})
    axes = sorted((key for key in layout if key.startswith("yaxis")), key=_number_panel)
    shares = [np.ptp(layout[key]["domain"]) for key in axes]
    size = (WIDTH, max(0.9 + PANEL_HEIGHT * len(axes), layout["height"] / 150))
    with rc_context(style.SETTINGS):
        figure = Figure(figsize=size, layout="constrained")
        panels = np.atleast_1d(
            figure.subplots(len(axes), 1, sharex=True, height_ratios=shares)  # type: ignore[arg-type]
        )
        for k, (key, panel) in enumerate(zip(axes, panels, strict=True)):
            label = units["labels"][k] if units else layout[key]["title"]["text"]
            panel.set_ylabel(unescape_html(label))
            _scale(panel, layout[key], layout["xaxis"])
        factors = units.get("factors", [1.0] * len(axes))
        for trace in plain["data"]:
            if trace.get("visible") != "legendonly" and "phasor" not in trace:
                k = _number_panel(trace["yaxis"].replace("y", "yaxis"))
                _draw_trace(panels[k], trace, factors[k])
        panels[-1].set_xlabel(unescape_html(layout["xaxis"]["title"]["text"]))
        _add_legend(figure, panels)
        return style.save(figure, path)


def _number_panel(axis: str) -> int:
    """The panel of an axis, from the top."""
    return int(axis.removeprefix("yaxis") or 1) - 1


def _scale(panel: Any, vertical: dict[str, Any], horizontal: dict[str, Any]) -> None:
    """Logarithmic axes, those that begin at the top, and the words on ticks."""
    if vertical.get("type") == "log":
        panel.set_yscale("log")
    if horizontal.get("type") == "log":
        panel.set_xscale("log")
    if vertical.get("autorange") == "reversed" or np.diff(vertical.get("range", [0, 1]))[0] < 0:
        panel.invert_yaxis()
    if "ticktext" in vertical:
        panel.set_yticks(vertical["tickvals"], map(unescape_html, vertical["ticktext"]))
    if "ticktext" in horizontal:
        panel.set_xticks(horizontal["tickvals"], map(unescape_html, horizontal["ticktext"]))


def _draw_trace(panel: Any, trace: dict[str, Any], factor: float) -> None:
    """A curve, a band, marks or bars."""
    if "samples" in trace:
        x, y = _read_samples(trace["samples"])
    else:
        x, y = _unpack_values(trace["x"]), _unpack_values(trace["y"])
    label = unescape_html(trace["name"]) if trace["showlegend"] else "_"
    line, marker = trace.get("line", {}), trace.get("marker", {})
    if trace["type"] == "bar":
        panel.barh([unescape_html(str(name)) for name in y], x, color=marker["color"], label=label)
    elif trace.get("mode") == "markers":
        panel.plot(x, y, "o", color=marker["color"], markersize=4, label=label)
    elif line.get("width") == 0:
        _draw_band(panel, trace, x, factor * np.asarray(y, dtype=float), label)
    else:
        look = {"linewidth": 0.8 * line["width"], "linestyle": DASHES.get(line.get("dash"), "-")}
        step = {"drawstyle": "steps-post"} if line.get("shape") == "hv" else {}
        values = factor * np.asarray(y, dtype=float)
        if len(values) == len(x):
            panel.plot(*style.thin(x, values), color=line["color"], label=label, **look, **step)


def _draw_band(panel: Any, trace: dict[str, Any], x: Any, y: np.ndarray, label: str) -> None:
    """The upper end of a band fills what lies above the lower one, which is kept at the panel."""
    if trace.get("fill") != "tonexty":
        panel.lower_end = y
        return
    every = slice(None, None, max(1, len(y) // style.MOST_POINTS_A_LINE))
    low = panel.lower_end
    panel.fill_between(
        x[every], low[every], y[every], color=style.FAINT, alpha=0.2, lw=0, label=label
    )


def _unpack_values(packed: Any) -> Any:
    """The numbers of an array as charts pack them; a list as it is."""
    if isinstance(packed, dict):
        return np.frombuffer(base64.b64decode(packed["bdata"]), f"<{packed['dtype']}").astype(float)
    return [np.nan if value is None else value for value in packed]


def _read_samples(packed: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Times and values (n,) of a curve that is kept in 16 bits; nan is a gap."""
    raw = np.frombuffer(base64.b64decode(packed["bdata"]), "<i2").astype(float)
    values = np.where(raw < -GREATEST_CODE, np.nan, packed["offset"] + packed["scale"] * raw)
    return packed["start"] + packed["step"] * np.arange(len(raw)), values


def _add_legend(figure: Any, panels: Any) -> None:
    """Each name once, above the panels."""
    known = {}
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        known |= dict(zip(labels, handles, strict=True))
    if known:
        figure.legend(known.values(), known.keys(), loc="outside upper left", ncols=3)


def draw_equation(latex: str, kind: str = "svg") -> bytes:
    """A displayed equation as SVG or PNG, of no bytes where mathtext refuses the LaTeX."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import MathTextParser

    latex = _enlarge_fractions(latex)
    settings: Any = {"svg.fonttype": "path", "mathtext.fontset": "cm", "svg.hashsalt": "tractexp"}
    with rc_context(settings):
        font = FontProperties(size=13)
        try:
            width, height, depth, *_ = MathTextParser("path").parse(f"${latex}$", dpi=72, prop=font)
        except ValueError:
            return b""
        figure = Figure(figsize=((width + 4) / 72, (height + 4) / 72))
        figure.text(2 / (width + 4), (depth + 2) / (height + 4), f"${latex}$", fontproperties=font)
        drawn = io.BytesIO()
        metadata = {"Date": None} if kind == "svg" else {}
        figure.savefig(drawn, format=kind, transparent=True, metadata=metadata, dpi=EQUATION_DPI)
    return drawn.getvalue()


def _enlarge_fractions(latex: str) -> str:
    """Fractions that are inside nothing else in their full size, as LaTeX has them in a displayed
    equation.
    """
    depth = itertools.accumulate((c == "{") - (c == "}") for c in latex)
    outside = {m.start() for m in re.finditer(r"\\frac", latex)} & {
        i for i, d in enumerate(depth) if d == 0
    }
    return "".join(r"\d" if i in outside else c for i, c in enumerate(latex))
