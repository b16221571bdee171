"""A page in one file: headings, text, tables, figures and equations, readable offline and on paper.

Everything given as text is escaped. Charts carry their data and the library that draws them, figures are inline SVG,
equations are typeset into SVG; nothing is loaded from elsewhere.
"""

import functools
import html
import io
import itertools
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.errors import UserError, check_choice
from tractexp.report.chart import Chart, script

STYLE = """
:root { --ink: #1d1d1f; --faint: #666; --line: #dcdcdc; --good: #00664a; --bad: #a33b00; }
* { box-sizing: border-box; }
body { margin: 2rem auto; max-width: 62rem; padding: 0 1.2rem; color: var(--ink); background: #fff;
  font: 16px/1.5 system-ui, "Segoe UI", "Liberation Sans", sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .4rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .5rem; border-bottom: 1px solid var(--line); padding-bottom: .2rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .3rem; }
h1, h2, h3 { break-after: avoid; }
p { margin: .5rem 0; max-width: 46rem; }
.lead { color: var(--faint); }
.verdict { border-left: 4px solid var(--faint); background: #f6f6f6; padding: .6rem 1rem; margin: 1rem 0; }
.verdict p { margin: .2rem 0; }
.good { border-color: var(--good); } .bad { border-color: var(--bad); }
.wide { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; font-size: .84rem; font-variant-numeric: tabular-nums; }
figure.table .wide { margin: 0; } figure.table figcaption { font-size: .84rem; padding-top: .35rem; }
th, td { padding: .22rem .6rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { vertical-align: bottom; white-space: normal; border-bottom-color: var(--faint); font-weight: 600; }
th:first-child, td:first-child, .words { text-align: left; }
td.words { white-space: normal; min-width: 8rem; } td.words:last-child { min-width: 14rem; }
figure { margin: 1rem 0; } figure, tr { break-inside: avoid; }
figure svg { max-width: 100%; height: auto; }
figcaption { color: var(--faint); font-size: .88rem; max-width: 46rem; }
.chart { width: 100%; } .charts { display: grid; gap: .4rem 1rem;
  grid-template-columns: repeat(auto-fit, minmax(min(17rem, 100%), 1fr)); }
.charts figure { margin: .3rem 0; min-width: 0; }
.equation { margin: .7rem 0 .7rem 1.5rem; overflow-x: auto; } .equation svg { vertical-align: middle; }
pre { margin: .5rem 0; padding: .5rem .7rem; background: #f6f6f6; font-size: .84rem; white-space: pre-wrap;
  overflow-wrap: anywhere; user-select: all; }
li { margin: .3rem 0; max-width: 46rem; }
details { margin: .8rem 0; } summary { cursor: pointer; color: #0058a0; }
@media print { body { margin: 0; max-width: none; font-size: 10.5pt; } .wide { overflow: visible; }
  .modebar-container { display: none !important; } .charts { grid-template-columns: 1fr 1fr; } }
"""
KINDS = ("plain", "good", "bad")


class Page:
    """Collects the parts of a page in order; every method returns the page, so that calls can be chained."""

    title: str
    lead: str

    def __init__(self, title: str, lead: str = ""):
        self.title, self.lead = title, lead
        self._parts: list[str] = []
        self._charts = False
        self._figures = itertools.count(1)

    def heading(self, text: str, level: int = 2) -> "Page":
        return self._add(f"<h{level}>{html.escape(text)}</h{level}>")

    def text(self, *paragraphs: str) -> "Page":
        return self._add(*(f"<p>{html.escape(text)}</p>" for text in paragraphs))

    def verdict(self, *paragraphs: str, kind: str = "plain") -> "Page":
        """What the reader should take away, in a box: "plain", "good" or "bad"."""
        check_choice("kind", kind, KINDS)
        return self._add(f'<div class="verdict {kind}">').text(*paragraphs)._add("</div>")

    def items(self, texts: Sequence[str]) -> "Page":
        return self._add("<ul>", *(f"<li>{html.escape(text)}</li>" for text in texts), "</ul>")

    def code(self, text: str) -> "Page":
        """A line to be copied: a click selects it whole."""
        return self._add(f"<pre>{html.escape(text)}</pre>")

    def table(
        self, columns: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "", words: Sequence[int] = ()
    ) -> "Page":
        """A table; the first column is to the left, the others are figures but for those counted in `words`."""
        marks = ['<{0} class="words">' if i in words else "<{0}>" for i in range(len(columns))]

        def line(cells: Sequence[str], tag: str) -> str:
            told = zip(marks, cells, strict=True)
            return f"<tr>{''.join(f'{m.format(tag)}{html.escape(str(c))}</{tag}>' for m, c in told)}</tr>"

        below = f"<figcaption>{html.escape(caption)}</figcaption>" if caption else ""
        body = "\n".join(line(row, "td") for row in rows)
        head = f"<thead>{line(columns, 'th')}</thead>"
        table = f'<div class="wide"><table>{head}<tbody>\n{body}\n</tbody></table></div>'
        return self._add(f'<figure class="table">{table}{below}</figure>')  # the caption stays where a table scrolls

    def figure(self, path: Path, caption: str = "") -> "Page":
        """An SVG file, drawn into the page. Raises `UserError` where it is not there or not SVG."""
        path = Path(path)
        try:
            drawing = path.read_text(encoding="utf-8")
        except OSError as error:
            raise UserError(f"the figure {path} cannot be read: {error.strerror}") from error
        if "<svg" not in drawing:
            raise UserError(f"the figure {path} is not SVG, the only kind a page can hold")
        inside = _inline(drawing, f"f{next(self._figures)}-", caption or path.stem)
        below = f"<figcaption>{html.escape(caption)}</figcaption>" if caption else ""
        return self._add(f"<figure>{inside}{below}</figure>")

    def chart(self, chart: Chart, caption: str = "") -> "Page":
        """A chart to look into; the caption says what it shows."""
        below = f"<figcaption>{html.escape(caption)}</figcaption>" if caption else ""
        self._charts = True
        return self._add(f"<figure>{chart.element(caption)}{below}</figure>")

    def charts(self, charts: Sequence[Chart], caption: str = "") -> "Page":
        """Small charts side by side, as many as there is room for."""
        self._add('<div class="charts">')
        for chart in charts:
            self.chart(chart)
        return self._add("</div>").text(*[caption] * bool(caption))

    def equation(self, latex: str) -> "Page":
        """A displayed equation. What Matplotlib's mathtext cannot set is shown as its LaTeX source."""
        drawing = _typeset(latex)
        if drawing is None:
            return self._add(f'<div class="equation"><code>{html.escape(latex)}</code></div>')
        return self._add(f'<div class="equation">{_inline(drawing, f"f{next(self._figures)}-", latex)}</div>')

    @contextmanager
    def folded(self, summary: str) -> Iterator[None]:
        """What is added inside is hidden until the reader opens it."""
        self._add(f"<details><summary>{html.escape(summary)}</summary>")
        yield
        self._add("</details>")

    def write(self, path: Path) -> Path:
        """Write the page in one move. Raises `UserError` where that is impossible."""
        title, lead = html.escape(self.title), html.escape(self.lead)
        head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title>'
        top = f"<h1>{title}</h1>" + (f'<p class="lead">{lead}</p>' if lead else "")
        draws = f"<script>{script()}</script>" if self._charts else ""
        body = "\n".join([top, *self._parts, draws])
        head = f"<head>{head}<style>{STYLE}</style></head>"
        whole = f'<!DOCTYPE html>\n<html lang="en">{head}\n<body>\n{body}\n</body></html>\n'
        return files.write(path, whole)

    def _add(self, *parts: str) -> "Page":
        self._parts += parts
        return self


def _inline(drawing: str, prefix: str, label: str) -> str:
    """An SVG document as an element of a page: without header and metadata, its ids unlike any other figure's."""
    drawing = drawing[drawing.index("<svg") :].strip()
    drawing = re.sub(r"<metadata>.*?</metadata>", "", drawing, flags=re.DOTALL)
    drawing = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", drawing).replace("xlink:href=", "href=")
    drawing = re.sub(r'(\sid="|url\(#|href="#)', rf"\g<1>{prefix}", drawing)
    return drawing.replace("<svg", f'<svg role="img" aria-label="{html.escape(label)}"', 1)


def _displayed(latex: str) -> str:
    """Fractions that are inside nothing else in their full size, as LaTeX has them in a displayed equation."""
    depth = itertools.accumulate((c == "{") - (c == "}") for c in latex)
    outside = {m.start() for m in re.finditer(r"\\frac", latex)} & {i for i, d in enumerate(depth) if d == 0}
    return "".join(r"\d" if i in outside else c for i, c in enumerate(latex))


@functools.cache
def _typeset(latex: str) -> str | None:
    """SVG of an equation, or None for LaTeX beyond mathtext."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import MathTextParser

    latex = _displayed(latex)
    settings: Any = {"svg.fonttype": "path", "mathtext.fontset": "cm", "svg.hashsalt": "tractexp"}
    with rc_context(settings):
        font = FontProperties(size=13)
        try:
            width, height, depth, *_ = MathTextParser("path").parse(f"${latex}$", dpi=72, prop=font)
        except ValueError:
            return None
        figure = Figure(figsize=((width + 4) / 72, (height + 4) / 72))
        figure.text(2 / (width + 4), (depth + 2) / (height + 4), f"${latex}$", fontproperties=font)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", transparent=True, metadata={"Date": None})
    return drawn.getvalue().decode()
