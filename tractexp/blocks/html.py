"""A report as a page in one file: readable offline and on paper.

Everything given as text is escaped. Charts carry their data and the library that draws them,
figures are inline SVG, equations are typeset into SVG; nothing is loaded from elsewhere.
"""

import functools
import itertools
import re
from collections.abc import Iterable, Sequence

from tractexp.blocks import Report, Table
from tractexp.blocks import block as blocks
from tractexp.blocks.chart_script import build_script
from tractexp.blocks.drawing import draw_equation
from tractexp.cache import store
from tractexp.storage import files
from tractexp.text import quoting

LONGEST_UNBROKEN_WORD = 14  # letters of a word that never needs a second line
# of equations: a letter's outline in one of them, and where it is drawn
OUTLINE = re.compile(r'<path id="f\d+-(Cm\w+-[0-9a-f]+)"( d="[^"]*"[^>]*/>)')
DRAWN = re.compile(r'href="#f\d+-(Cm\w+-[0-9a-f]+)"')


def render_page(report: Report) -> str:
    """A whole page that needs nothing else."""
    figures = itertools.count(1)
    title = quoting.html(report.title)
    lead = quoting.html(report.lead)
    head = (
        '<meta charset="utf-8"><meta name="viewport"'
        f' content="width=device-width"><title>{title}</title>'
    )
    if report.reload is not None:
        head += f'<meta http-equiv="refresh" content="{report.reload}">'
    style = files.read_packaged_text("blocks/page.css")
    top = f"<h1>{title}</h1>" + (f'<p class="lead">{lead}</p>' if lead else "")
    draws = f"<script>{build_script()}</script>" if any(map(_holds_chart, report.blocks)) else ""
    elements = "\n".join(_write_element(block, figures) for block in report.blocks)
    body = "\n".join([top, _share_outlines(elements), draws])
    return (
        "<!DOCTYPE html>\n<html"
        f' lang="en"><head>{head}<style>{style}</style></head>\n<body>\n{body}\n</body></html>\n'
    )


def _share_outlines(elements: str) -> str:
    """Elements whose equations hold the outline of each letter once: a page of forty is half as
    long.
    """
    known = set[str]()

    def keep_first(outline: re.Match[str]) -> str:
        name, rest = outline.groups()
        if name in known:
            return ""
        known.add(name)
        return f'<path id="{name}"{rest}'

    return DRAWN.sub(r'href="#\1"', OUTLINE.sub(keep_first, elements))


def render_frame(report: Report) -> str:
    """The page within another one."""
    return (
        f'<iframe srcdoc="{quoting.html(render_page(report))}"'
        ' style="width:100%;height:40rem;border:0"></iframe>'
    )


def render_fragment(report: Report) -> str:
    """The blocks that a terminal shows, and equations, as elements of a notebook's page.

    The notebook typesets what stands between dollars: equations only, whatever a name holds.
    """
    parts = []
    if report.title:
        parts.append(_keep_dollars(f"<p><b>{quoting.html(report.title)}</b></p>"))
    if report.lead:
        parts.append(_keep_dollars(f"<p>{quoting.html(report.lead)}</p>"))
    for block in report.blocks:
        if isinstance(block, Table):
            parts.append(_keep_dollars(_write_table(block.brief)))
        elif isinstance(block, blocks.Equation):
            parts.append(f"<p>$${quoting.html(block.latex)}$$</p>")
        elif not isinstance(
            block, blocks.ChartBlock | blocks.Charts | blocks.Figure | blocks.Markup | blocks.Fold
        ):
            parts.append(_keep_dollars(_write_element(block, itertools.count(1))))
    return "\n".join(parts)


def _keep_dollars(element: str) -> str:
    """An element whose dollar signs a notebook does not take for mathematics."""
    return (
        f'<div class="mathjax_ignore tex2jax_ignore">{element}</div>' if "$" in element else element
    )


def _holds_chart(block: blocks.Block) -> bool:
    """Whether a block holds a chart."""
    return isinstance(block, blocks.ChartBlock | blocks.Charts) or (
        isinstance(block, blocks.Fold) and any(map(_holds_chart, block.blocks))
    )


def _write_element(block: blocks.Block, figures: "itertools.count[int]") -> str:
    """A block as HTML; `figures` counts the drawings of a page, whose ids differ by it."""
    match block:
        case blocks.Heading(text, level):
            return f"<h{level}>{quoting.html(text)}</h{level}>"
        case blocks.Paragraphs(texts):
            return "\n".join(f"<p>{quoting.html(text)}</p>" for text in texts)
        case blocks.VerdictBlock(texts, kind):
            return (
                '<div class="verdict'
                f' {kind}">\n{_write_element(blocks.Paragraphs(texts), figures)}\n</div>'
            )
        case blocks.Items(texts):
            return "\n".join(
                ["<ul>", *(f"<li>{quoting.html(text)}</li>" for text in texts), "</ul>"]
            )
        case blocks.CodeBlock(text):
            return f"<pre>{quoting.html(text)}</pre>"  # a click selects it whole
        case blocks.Equation(latex):
            drawing = _typeset(latex)
            inside = (
                _inline_drawing(drawing, f"f{next(figures)}-", latex)
                if drawing
                else f"<code>{quoting.html(latex)}</code>"
            )
            return f'<div class="equation">{inside}</div>'
        case Table():
            return _write_table(block)
        case blocks.ChartBlock(chart, caption):
            return f"<figure>{chart.element(caption)}{_render_caption(caption)}</figure>"
        case blocks.Charts(charts):
            return "\n".join(
                [
                    '<div class="charts">',
                    *(_write_element(chart, figures) for chart in charts),
                    "</div>",
                ]
            )
        case blocks.Figure(svg, caption):
            return (
                f"<figure>{_inline_drawing(svg, f'f{next(figures)}-', caption)}"
                f"{_render_caption(caption)}</figure>"
            )
        case blocks.Markup(markup):
            return markup
        case blocks.Fold(summary, parts):
            inside = (_write_element(inner, figures) for inner in parts)
            return "\n".join(
                [f"<details><summary>{quoting.html(summary)}</summary>", *inside, "</details>"]
            )


def _render_caption(caption: str) -> str:
    """A caption below its figure; "" without one."""
    return f"<figcaption>{quoting.html(caption)}</figcaption>" if caption else ""


def _write_table(table: Table) -> str:
    """A table; the first column is to the left, the others are figures but for those that hold
    words.
    """
    kinds = {i: _describe_words(row[i] for row in table.cells) for i in table.words}
    marks = [
        f'<{{0}} class="{kinds[i]}">' if i in kinds else "<{0}>" for i in range(len(table.columns))
    ]

    def line(cells: Sequence[str], tag: str) -> str:
        marked = zip(marks, cells, strict=True)
        return (
            f"<tr>{''.join(f'{m.format(tag)}{quoting.html(str(c))}</{tag}>' for m, c in marked)}"
            "</tr>"
        )

    body = "\n".join(line(row, "td") for row in table.cells)
    head = f"<thead>{line(table.columns, 'th')}</thead>" if table.columns else ""
    above = f"<caption>{quoting.html(table.title)}</caption>" if table.title else ""
    grid = f'<div class="wide"><table>{above}{head}<tbody>\n{body}\n</tbody></table></div>'
    # the caption stays where a table scrolls
    return f'<figure class="table">{grid}{_render_caption(table.caption)}</figure>'


def _describe_words(cells: Iterable[str]) -> str:
    """The class of a column of words: "words" of long ones, which may break, or "short"."""
    return "words" if any(len(cell) > LONGEST_UNBROKEN_WORD for cell in cells) else "short"


def _inline_drawing(drawing: str, prefix: str, label: str) -> str:
    """An SVG document as an element of a page: without header and metadata, its ids unlike any
    other figure's.
    """
    drawing = drawing[drawing.index("<svg") :].strip()
    drawing = re.sub(r"<metadata>.*?</metadata>", "", drawing, flags=re.DOTALL)
    drawing = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", drawing).replace("xlink:href=", "href=")
    drawing = re.sub(r'(\sid="|url\(#|href="#)', rf"\g<1>{prefix}", drawing)
    return drawing.replace("<svg", f'<svg role="img" aria-label="{quoting.html(label)}"', 1)


@functools.cache
def _typeset(latex: str) -> str:
    """SVG of an equation, from the store or drawn; "" for LaTeX beyond mathtext."""
    key = store.compute_key(store.read_version("matplotlib"), latex)
    return store.DRAWINGS.get(key, lambda: draw_equation(latex)).decode()
