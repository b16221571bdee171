"""Charts that let one look: zoomed by dragging, told by hovering, saved as SVG from their corner,
printed as drawn.

A `Chart` is data and layout for Plotly.js (MIT), which the package plotly carries and a page that
has a chart takes along; `chart.js` draws it. Nothing is drawn here and that package is not
imported, so that a page costs milliseconds.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tractexp.blocks import style
from tractexp.blocks.packing import encode_curve, list_values, pack_numbers, share_arrays
from tractexp.text import quoting

# points of a line that are kept: beyond, each stretch keeps its lowest and highest
MOST_LINE_POINTS = 20_000
FONT = 'system-ui, "Segoe UI", "Liberation Sans", sans-serif'
# pixels: a legend on a phone, one of its entries without the name, a letter
PHONE, ENTRY, LETTER = 240, 45, 7
PANEL_GAP = 0.045  # of the height, between panels
HOVER = "%{y:.5g}"
DECADE = 20  # an axis that spans less has its ticks between powers of ten
MOST_LOG_TICKS = 6  # of a vertical axis, where digits between powers of ten would overlap
TICK = 28  # letters of a trace's name beside its axis


class Chart:
    """Panels above each other that share the axis x. Colors are those of `style`; names may hold
    any character.

    `panels` are the labels of the vertical axes from the top, `heights` their shares. `log_x` and
    `log_y` make axes logarithmic. `pixels` is the height of the whole. Without a `legend` names are
    told by hovering only; where many curves are drawn, `hover` "closest" tells of one.
    """

    def __init__(
        self,
        x: str,
        panels: Sequence[str],
        *,
        heights: Sequence[float] = (),
        log_x: bool = False,
        log_y: bool = False,
        pixels: int | None = None,
        title: str = "",
        legend: bool = True,
        hover: str = "x unified",
    ):
        self._data: list[dict[str, Any]] = []
        self._shapes: list[dict[str, Any]] = []
        self._notes: list[dict[str, Any]] = []
        self._in_legend: set[str] = set()
        self._panels, self._cursor = panels, None
        self._units: dict[str, Any] | None = None
        self._answers: list[dict[str, Any]] = []
        self._axes = self._laid_out(panels, heights or [1.0] * len(panels), log_y)
        self._x: dict[str, Any] = {
            "title": {"text": quoting.html(x)},
            "anchor": _name_axis("y", len(panels) - 1),
        }
        self._x |= {
            "showgrid": True,
            "gridcolor": "#E4E4E4",
            "zeroline": False,
            "ticks": "outside",
            "automargin": True,
        }
        if log_x:
            self._x |= {"type": "log", "dtick": 1, "exponentformat": "power"}
        self._title, self._legend, self._hover = title, legend, hover
        self._pixels = pixels or 130 + 170 * len(panels)

    @staticmethod
    def _laid_out(
        labels: Sequence[str], heights: Sequence[float], log: bool
    ) -> dict[str, dict[str, Any]]:
        """The vertical axes of panels of these heights, from top to bottom."""
        room = (1 - PANEL_GAP * (len(labels) - 1)) / sum(heights)
        top, axes = 1.0, {}
        for k, (label, share) in enumerate(zip(labels, heights, strict=True)):
            low = max(top - share * room, 0.0)
            axis: dict[str, Any] = {
                "title": {"text": quoting.html(label)},
                "domain": [low, top],
                "ticks": "outside",
            }
            axis |= {
                "gridcolor": "#E4E4E4",
                "zeroline": False,
                "automargin": True,
                "linecolor": "#444",
            }
            if log:
                axis |= {"type": "log", "exponentformat": "power", "nticks": MOST_LOG_TICKS}
            axes[_name_axis("yaxis", k)] = axis
            top = low - PANEL_GAP
        return axes

    def line(
        self,
        name: str,
        x: np.ndarray,
        y: np.ndarray,
        color: str,
        panel: int = 0,
        *,
        width: float = 1.6,
        dash: str = "solid",
        step: bool = False,
        legend: bool = True,
        hidden: bool = False,
    ) -> "Chart":
        """A curve; equal names are one entry of the legend. nan is a gap; `step` holds each value
        until the next.

        Without `legend` it is named where it is pointed at only; `hidden` it is drawn when its name
        is clicked.
        """
        x, y = style.thin(np.asarray(x, dtype=float), np.asarray(y, dtype=float), MOST_LINE_POINTS)
        shape = {"shape": "hv"} if step else {}
        line = {"color": color, "width": width, "dash": dash, **shape}
        packed: dict[str, Any] = {"x": pack_numbers(x, "f8"), "y": pack_numbers(y, "f4")}
        if hidden:
            packed["visible"] = "legendonly"
        return self._add(name, panel, mode="lines", line=line, silent=not legend, **packed)

    def samples(
        self,
        name: str,
        start: float,
        step: float,
        y: np.ndarray,
        color: str,
        panel: int = 0,
        *,
        width: float = 1.2,
        dash: str = "solid",
        label: str = "",
    ) -> "Chart":
        """A curve (n,) sampled every `step` from `start` on, all of it kept, in 16 bits; nan is a
        gap.

        Of what is shown each stretch has its lowest and highest sample, and zoomed in every sample
        is drawn. At the cursor it is named `label`.
        """
        line = {"color": color, "width": width, "dash": dash}
        reading: dict[str, Any] = {"panel": self._panels[panel], "label": label or name}
        return self._add(
            name, panel, mode="lines", line=line, samples=encode_curve(start, step, y), **reading
        )

    def phasors(
        self,
        name: str,
        start: float,
        step: float,
        y: NDArray[np.complex128],
        color: str,
        panel: int,
    ) -> "Chart":
        """Complex values (n,), every `step` from `start` on, that are seen at the cursor only, as
        arrows.
        """
        coded = {"re": encode_curve(start, step, y.real), "im": encode_curve(start, step, y.imag)}
        return self._add(
            name,
            panel,
            mode="lines",
            line={"color": color},
            silent=True,
            x=[None],
            y=[None],
            phasor=coded,
            panel=self._panels[panel],
        )

    def states(
        self, courses: Sequence[tuple[str, np.ndarray, np.ndarray]], panel: int, color: str
    ) -> "Chart":
        """States 0 and 1 as (name, times, states), each a trace below the other: the state from
        each time on.
        """
        for row, (name, t, states) in enumerate(courses):
            course = {"at": t.tolist(), "states": states.tolist()}
            line = {"color": color, "width": 1.6, "shape": "hv"}
            self._add(
                name,
                panel,
                mode="lines",
                line=line,
                silent=True,
                x=t.tolist(),
                y=(0.7 * states - row).tolist(),
                course=course,
                panel=self._panels[panel],
                label=name,
            )
        # the traces' names stand there
        self._axes[_name_axis("yaxis", panel)]["title"] = {"text": ""}
        self.ticks(
            panel,
            [0.35 - row for row in range(len(courses))],
            [_shorten_name(name) for name, *_ in courses],
        )
        return self.limits(panel, 0.3 - len(courses), 1.0)

    def units(self, labels: Sequence[str], factors: Sequence[float]) -> "Chart":
        """What the panels are shown in at first, with their labels, and how much of that one of
        their own units is; a button goes to and fro for all charts of a page.
        """
        self._units = {"labels": [*map(quoting.html, labels)], "factors": [*map(float, factors)]}
        return self

    def answers(self, answers: Sequence[tuple[float, float, str]]) -> "Chart":
        """What is said below the chart when it is clicked at an x from the first to the second of
        two numbers.
        """
        self._answers = [{"start": a, "end": b, "text": text} for a, b, text in answers]
        return self

    def cursor(self, x: float) -> "Chart":
        """Values of all curves beside each other where the cursor is, instead of labels; at first
        those at `x`.
        """
        self._cursor = x
        self._x |= {
            "showspikes": True,
            "spikemode": "across",
            "spikesnap": "cursor",
            "spikethickness": 1,
        }
        self._x |= {"spikecolor": style.FAINT, "spikedash": "solid"}
        return self

    def points(
        self,
        name: str,
        x: Sequence[Any] | np.ndarray,
        y: Sequence[Any] | np.ndarray,
        color: str,
        panel: int = 0,
        *,
        size: float = 7,
        symbol: str = "circle",
        hover: Sequence[str] = (),
        spans: np.ndarray | None = None,
    ) -> "Chart":
        """Marks; `hover` is what each says when pointed at, `spans` (n, 2) are the ends of
        intervals along x.
        """
        trace: dict[str, Any] = {"marker": {"color": color, "size": size, "symbol": symbol}}
        if spans is not None:
            middle = np.asarray(x, dtype=float)
            trace["error_x"] = {
                "type": "data",
                "symmetric": False,
                "color": color,
                "thickness": 2,
                "width": 5,
                "array": (spans[:, 1] - middle).tolist(),
                "arrayminus": (middle - spans[:, 0]).tolist(),
            }
        if hover:
            trace |= {
                "text": [quoting.html(t) for t in hover],
                "hovertemplate": "%{text}<extra></extra>",
            }
        return self._add(name, panel, mode="markers", x=list_values(x), y=list_values(y), **trace)

    def bars(
        self,
        name: str,
        labels: Sequence[str],
        values: Sequence[float],
        color: str | Sequence[str],
        panel: int = 0,
        *,
        hover: Sequence[str] = (),
    ) -> "Chart":
        """Horizontal bars, the first label on top."""
        self._axes[_name_axis("yaxis", panel)] |= {"autorange": "reversed", "type": "category"}
        trace: dict[str, Any] = (
            {"text": [quoting.html(t) for t in hover], "textposition": "auto"} if hover else {}
        )
        return self._add(
            name,
            panel,
            kind="bar",
            orientation="h",
            x=list_values(values),
            y=list_values(labels),
            marker={"color": color if isinstance(color, str) else list(color)},
            hovertemplate="%{y}: %{x:.4g}<extra></extra>",
            **trace,
        )

    def band(
        self,
        name: str,
        x: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        color: str,
        panel: int = 0,
        *,
        step: bool = False,
    ) -> "Chart":
        """Add the area between two curves (n,), lightly filled."""
        line = {"width": 0, "color": color, **({"shape": "hv"} if step else {})}
        quiet: dict[str, Any] = {"mode": "lines", "line": line, "hoverinfo": "skip"}
        quiet["x"] = pack_numbers(np.asarray(x, dtype=float), "f8")
        self._add(name, panel, y=pack_numbers(lower, "f4"), silent=True, **quiet)
        return self._add(
            name,
            panel,
            y=pack_numbers(upper, "f4"),
            fill="tonexty",
            fillcolor=_lighten_color(color),
            **quiet,
        )

    def shade(
        self,
        start: float,
        end: float,
        color: str,
        panel: int | None = None,
        name: str = "",
        opacity: float = 0.3,
        text: str = "",
    ) -> "Chart":
        """A stretch of the axis x, in one panel or in all; `name` stands in the legend once, `text`
        at its top.
        """
        self._shapes.append(
            {
                "type": "rect",
                "xref": "x",
                "x0": start,
                "x1": end,
                **_span_height(panel),
                "fillcolor": color,
                "opacity": opacity,
                "line": {"width": 0},
                "layer": "below",
            }
        )
        self._note(text, _span_height(panel)["yref"], x=start, y=1, bgcolor="#ffffffcc")
        if name and name not in self._in_legend:
            square = {
                "color": color,
                "size": 11,
                "symbol": "square",
                "opacity": min(1.0, 2 * opacity),
            }
            self._add(
                name,
                panel or 0,
                mode="markers",
                x=[None],
                y=[None],
                marker=square,
                hoverinfo="skip",
            )
        return self

    def edge(
        self,
        x: float,
        color: str = style.FAINT,
        dash: str = "dot",
        panel: int | None = None,
        text: str = "",
    ) -> "Chart":
        """A vertical line, in one panel or through all, with a `text` below the panel
        (the first).
        """
        self._note(text, _span_height(panel or 0)["yref"], color, x=x, y=0)
        line = {"color": color, "width": 1, "dash": dash}
        self._shapes.append(
            {"type": "line", "xref": "x", "x0": x, "x1": x, **_span_height(panel), "line": line}
        )
        return self

    def level(
        self, y: float, text: str = "", panel: int = 0, color: str = style.FAINT, dash: str = "dash"
    ) -> "Chart":
        """A horizontal line across a panel, with a word at its right end."""
        axis, line = _name_axis("y", panel), {"color": color, "width": 1, "dash": dash}
        self._shapes.append(
            {
                "type": "line",
                "xref": "x domain",
                "x0": 0,
                "x1": 1,
                "yref": axis,
                "y0": y,
                "y1": y,
                "line": line,
            }
        )
        log = self._axes[_name_axis("yaxis", panel)].get("type") == "log"
        at = float(np.log10(y)) if log else y
        self._note(text, axis, color, x=1, y=at, xref="x domain", xanchor="right", yanchor="bottom")
        return self

    def _note(self, text: str, yref: str, color: str = "", **more: Any) -> None:
        """Words at a place, beside what they belong to; none where there is no text."""
        if text:
            font = {"size": 11, **({"color": color} if color else {})}
            note = {
                "text": quoting.html(text),
                "xref": "x",
                "xanchor": "left",
                "yref": yref,
                "yanchor": "top",
            }
            self._notes.append({**note, "showarrow": False, "font": font, **more})

    def limits(self, panel: int | None, low: float, high: float) -> "Chart":
        """Set what an axis shows at first: of a panel, or of x where `panel` is None."""
        axis = self._x if panel is None else self._axes[_name_axis("yaxis", panel)]
        axis["range"] = np.log10([low, high]).tolist() if axis.get("type") == "log" else [low, high]
        if axis.get("type") == "log" and high < DECADE * low:
            axis.pop("dtick", None)  # powers of ten alone would leave the axis bare
        return self

    def ticks(
        self,
        panel: int | None,
        at: Sequence[float],
        labels: Sequence[str] = (),
        turned: bool = False,
    ) -> "Chart":
        """Where an axis is marked, and with which words instead of numbers: of a panel, or of x
        where it is None.
        """
        axis = self._x if panel is None else self._axes[_name_axis("yaxis", panel)]
        words = [quoting.html(label) for label in labels] or [f"{v:g}" for v in at]
        axis |= {"tickmode": "array", "tickvals": list(at), "ticktext": words}
        if labels:
            axis |= {
                "tickfont": {"size": 9 if turned else 11},
                **({"tickangle": -90} if turned else {}),
            }
        return self

    def plain(self) -> dict[str, Any]:
        """Data and layout as Plotly reads them."""
        names = (
            [trace["name"] for trace in self._data if trace["showlegend"]] if self._legend else []
        )
        # pixels; a narrow legend has three rows
        above = 30 if not names else 66 if len(names) <= 6 else 86
        layout = {
            "height": self._pixels,
            "font": {"family": FONT, "size": 13, "color": "#1d1d1f"},
            "hovermode": self._hover,
            "hoversubplots": "axis",
            "paper_bgcolor": "#fff",
            "plot_bgcolor": "#fff",
            "bargap": 0.25,
            "margin": {"l": 60, "r": 12, "t": above + 20 * bool(self._title), "b": 48},
            "showlegend": self._legend,
            "legend": {
                "orientation": "h",
                "x": 0,
                "y": 1.0,
                "yanchor": "bottom",
                "yref": "paper",
                **_leave_room_above(names),
            },
            "shapes": self._shapes,
            "annotations": self._notes,
            "xaxis": self._x,
            **self._axes,
        }
        kinds = {trace["type"] for trace in self._data} | {
            trace.get("mode", "") for trace in self._data
        }
        if "lines" not in kinds:
            layout |= {"hovermode": "closest"}
        if self._title:
            layout["title"] = {
                "text": quoting.html(self._title),
                "x": 0,
                "xref": "paper",
                "font": {"size": 14},
            }
            if not self._legend:  # just above the panels, below the buttons
                layout["title"] |= {"yref": "paper", "y": 1, "yanchor": "bottom", "pad": {"b": 8}}
        told = {"units": self._units, "answers": self._answers, "cursor": self._cursor}
        plain = {"data": [self._label_hover(trace) for trace in self._data], "layout": layout}
        plain |= {key: value for key, value in told.items() if value not in (None, [])}
        if self._cursor is not None:  # read out beside it
            quiet: dict[str, Any] = {"hoverinfo": "none", "hovertemplate": None}
            plain["data"] = [{**trace, **quiet} for trace in self._data]
        return plain

    def element(self, label: str) -> str:
        """The chart as HTML, told to screen readers as `label`."""
        data = quoting.script(share_arrays(self.plain()))
        kind = "readout arrows" if any("phasor" in trace for trace in self._data) else "readout"
        above = "" if self._cursor is None else f'<div class="{kind}"></div>'
        return (
            f'{above}<div class="chart" role="img" aria-label="{quoting.html(label)}"'
            f' style="height:{self._pixels}px">'
            "</div>"
            f'<script type="application/json">{data}</script>'
        )

    def _label_hover(self, trace: dict[str, Any]) -> dict[str, Any]:
        """A trace whose label says which quantity it is, where the chart has several panels; the
        unit stands at the axis, where a button may change it.
        """
        if trace["hovertemplate"] != HOVER or len(self._axes) < 2:
            return trace
        title = self._axes[trace["yaxis"].replace("y", "yaxis")]["title"]["text"]
        return trace | {"hovertemplate": f"{title.partition(' [')[0]} {HOVER}"}

    def _add(
        self, name: str, at: int, /, kind: str = "scatter", silent: bool = False, **more: Any
    ) -> "Chart":
        """Add a trace to a panel; each name is once in the legend."""
        shown = bool(name) and name not in self._in_legend and not silent
        if shown:
            self._in_legend.add(name)
        trace = {
            "type": kind,
            "name": quoting.html(name),
            "legendgroup": name,
            "showlegend": shown,
            "xaxis": "x",
            "yaxis": _name_axis("y", at),
            "hovertemplate": HOVER,
        }
        self._data.append(trace | more)
        return self


def _shorten_name(name: str) -> str:
    """A name that fits a tick."""
    return name if len(name) <= TICK else f"{name[: TICK - 1]}…"


def _leave_room_above(names: Sequence[str]) -> dict[str, Any]:
    """An empty line over a legend that takes several on a phone: the buttons stand there."""
    several = sum(ENTRY + LETTER * len(name) for name in names) > PHONE
    return {"title": {"text": "\u00a0", "side": "top"}} if several else {}


def _name_axis(letter: str, panel: int) -> str:
    """Plotly's name of a panel's axis: x, x2, ..."""
    return letter + (str(panel + 1) if panel else "")


def _span_height(panel: int | None) -> dict[str, Any]:
    """All of a panel, or of the chart."""
    return {
        "yref": "paper" if panel is None else f"{_name_axis('y', panel)} domain",
        "y0": 0,
        "y1": 1,
    }


def _lighten_color(color: str) -> str:
    """A color that bands are filled with."""
    red, green, blue = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.18)"
