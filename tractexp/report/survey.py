"""The page of a survey: its table with small pictures, sorted and filtered where it is read, for
thousands of rows.
"""

from collections.abc import Mapping
from typing import Any

from tractexp.blocks import Report, Table
from tractexp.blocks.block import Markup
from tractexp.blocks.style import ACTIVE, VOLTAGE
from tractexp.storage.files import read_packaged_text
from tractexp.text import quoting

# what stands as the kind of a file without events
UNREAD, UNEXAMINED, QUIET = "not read", "not examined", "nothing"
MOST_UNREADABLE_FILES = 10  # files that cannot be read, each with the reason
AT_ONCE = 200  # rows that are drawn; more where they are asked for
COLUMNS = (  # key, heading, kind of cell, digits
    ("event", "event", "name", 0),
    ("U_picture", "U", "picture", 0),
    ("P_picture", "P", "picture", 0),
    ("kind", "kind", "words", 0),
    ("depth", "depth [%]", "share", 1),
    ("duration", "lasts [ms]", "milli", 0),
    ("worth", "fit", "yes", 0),
    ("P", "P [MW]", "pair", 4),
    ("Q", "Q [Mvar]", "pair", 4),
    ("U2", "U2 [%]", "share", 1),
    ("jump", "jump [deg]", "number", 1),
    ("noise", "noise [% of P]", "share", 2),
    ("load", "load", "words", 0),
    ("start", "starts [s]", "number", 3),
    ("when", "when", "time", 0),
    ("rate", "rate [Hz]", "figure", 5),
    ("why", "why", "why", 0),
)
# of a row, beside the columns
FURTHER = ("file", "station", "P_before", "P_after", "Q_before", "Q_after", "unit", "command")


def build_summary(content: Mapping[str, Any]) -> Report:
    """How many files, what is in them, what cannot be read, and the events that tell most where
    they were asked for.
    """
    rows = content["rows"]
    report = Report().text(
        f"{content['files']} files in {content['folder']}, {content['looked_at']} new or changed"
    )
    report.add(tabulate_kinds(content))
    unread = [row for row in rows if row["kind"] == UNREAD]
    named = [
        row["why"] if row["file"] in row["why"] else f"{row['file']}: {row['why']}"
        for row in unread
    ]
    report.text(*(f"  not read: {sentence}" for sentence in named[:MOST_UNREADABLE_FILES]))
    if len(unread) > MOST_UNREADABLE_FILES:
        report.text(f"  and {len(unread) - MOST_UNREADABLE_FILES} more, in the table")
    return _list_informative(report, content)


def tabulate_kinds(content: Mapping[str, Any]) -> Table:
    """How often each kind of event is there."""
    rows = content["rows"]
    names = sorted(
        {row["kind"] for row in rows}, key=lambda k: (k in (UNREAD, UNEXAMINED, QUIET), k)
    )
    counts = [
        [
            kind,
            sum(r["kind"] == kind for r in rows),
            len({r["file"] for r in rows if r["kind"] == kind}),
            sum(r["kind"] == kind and r["worth"] for r in rows),
        ]
        for kind in names
    ]
    return Table(
        ["what", "rows", "files", "worth fitting"], counts, f"survey of {content['folder']}"
    )


def report(content: Mapping[str, Any]) -> Report:
    """The page of a survey: a table that sorts and filters itself."""
    keys = [key for key in (*(c[0] for c in COLUMNS), *FURTHER) if key not in ("P", "Q")]
    rows = [{key: row[key] for key in keys} for row in content["rows"]]
    data = {
        "columns": COLUMNS,
        "rows": rows,
        "atOnce": AT_ONCE,
        "colors": {"U_picture": VOLTAGE, "P_picture": ACTIVE},
    }
    packed, looks, work = (
        quoting.script(data),
        read_packaged_text("report/survey.css"),
        read_packaged_text("report/survey.js"),
    )
    worth = sum(row["worth"] for row in rows)
    lead = f"{content['files']} files, {len(rows)} rows, {worth} events worth fitting."
    page = _list_informative(Report(f"Survey of {content['folder']}", lead), content)
    if content["command"]:
        page.text("to fit them together:").code(content["command"])
    return page.add(
        Markup(
            f"<style>{looks}</style>{SIEVE}<div"
            f' class="wide"><table><thead><tr>{_list_heads()}</tr></thead>'
            '<tbody id="body"></tbody></table></div><p><button id="more">more rows</button></p>'
            "<noscript><p>The table needs JavaScript; survey.csv holds the same"
            " rows.</p></noscript>"
            f'<script type="application/json" id="rows">{packed}</script><script>{work}</script>'
        )
    )


SIEVE = (
    '<div class="sieve"><label>words in any column<input id="text" type="search"></label>'
    '<label>kind<select id="kind"><option value="">all</option></select></label>'
    '<label>depth at least [%]<input id="depth" type="number" min="0" max="100" step="1"></label>'
    '<label class="check"><input id="worth" type="checkbox">worth fitting</label><span'
    ' id="count"></span></div>'
)


def _list_heads() -> str:
    """The table's heads."""
    heads = []
    for key, label, kind, _ in COLUMNS:
        css = ' class="words"' if kind in ("name", "words", "why") else ""
        heads.append(
            f"<th{css}{'' if kind == 'picture' else f' data-key={key}'}>{quoting.html(label)}</th>"
        )
    return "".join(heads)


def _list_informative(report: Report, content: Mapping[str, Any]) -> Report:
    """The events that tell most; nothing where they were not asked for."""
    best = content["informative"]
    if not best:
        return report
    first, *others = best
    narrower = [
        f"{each['event']}, which narrows the intervals by {each['gain']:.0%}" for each in others
    ]
    report.verdict("most informative together, the best first:", kind="good")
    return report.items([first["event"], *narrower])
