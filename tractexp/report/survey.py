"""The page of a survey: its table with small pictures, sorted and filtered where it is read, for thousands of rows."""

from collections.abc import Mapping
from typing import Any

from tractexp import quoting
from tractexp.blocks import Report, Table
from tractexp.blocks.block import Markup
from tractexp.blocks.style import ACTIVE, VOLTAGE

UNREAD, QUIET = "not read", "nothing"  # what stands as the kind of a file without events
MOST = 10  # files that cannot be read, each with the reason
AT_ONCE = 200  # rows that are drawn; more where they are asked for
LOOKS = """
.sieve { display: flex; flex-wrap: wrap; gap: .5rem .9rem; align-items: end; margin: 1rem 0 .5rem; font-size: .9rem; }
.sieve label { display: grid; gap: .15rem; color: var(--faint); font-size: .8rem; }
.sieve input, .sieve select, button { font: inherit; font-size: .9rem; padding: .25rem .4rem; color: var(--ink);
  border: 1px solid var(--line); border-radius: 3px; background: #fff; max-width: 100%; }
.sieve label.check { display: flex; align-items: center; gap: .35rem; padding-bottom: .35rem; }
body { max-width: 84rem; } th[data-key] { cursor: pointer; user-select: none; } th[data-key]:hover { color: #0058a0; }
th[aria-sort=ascending]::after { content: " \\25B2"; } th[aria-sort=descending]::after { content: " \\25BC"; }
td svg { display: block; width: 84px; height: 26px; } td.words { min-width: 6rem; overflow-wrap: anywhere; }
td.words:last-child { min-width: 22rem; font-size: .8rem; }
tr.worth td:first-child { box-shadow: inset 3px 0 var(--good); }
td.name { white-space: normal; overflow-wrap: anywhere; min-width: 11rem; max-width: 18rem; }
td.name span { display: block; color: var(--faint); font-size: .72rem; } td details { margin: .1rem 0; }
td code { display: block; margin-top: .2rem; font-size: .72rem; white-space: pre-wrap; overflow-wrap: anywhere;
  user-select: all; color: var(--faint); }
@page { size: landscape; margin: 10mm; }
@media print { .sieve, button, td details { display: none; } table { font-size: 6pt; width: 100%; }
  th, td { padding: .12rem .25rem; } td.words, td.words:last-child, td.name { min-width: 0; font-size: 6pt; }
  td.name span { font-size: 5pt; } td svg { width: 56px; height: 18px; } }
"""
COLUMNS = (  # key, heading, kind of cell, digits
    ("event", "event", "name", 0), ("U_picture", "U", "picture", 0), ("P_picture", "P", "picture", 0),
    ("kind", "kind", "words", 0), ("depth", "depth [%]", "share", 1), ("duration", "lasts [ms]", "milli", 0),
    ("worth", "fit", "yes", 0), ("P", "P [MW]", "pair", 4), ("Q", "Q [Mvar]", "pair", 4),
    ("U2", "U2 [%]", "share", 1), ("jump", "jump [deg]", "number", 1), ("noise", "noise [% of P]", "share", 2),
    ("load", "load", "words", 0), ("start", "starts [s]", "number", 3), ("when", "when", "time", 0),
    ("rate", "rate [Hz]", "figure", 5), ("why", "why", "why", 0),
)  # fmt: skip
FURTHER = (
    "file",
    "station",
    "P_before",
    "P_after",
    "Q_before",
    "Q_after",
    "unit",
    "command",
)  # of a row, beside the columns
WORK = """
const {columns, rows, atOnce, colors} = JSON.parse(document.getElementById("rows").textContent);
const $ = id => document.getElementById(id);
let shown = rows, key = null, down = false, most = atOnce;
const marks = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"};
const safe = text => String(text).replace(/[&<>"]/g, mark => marks[mark]);
const picture = (values, color) => {
  if (!values || values.length < 2) return "";
  const known = values.filter(v => v !== null), low = Math.min(0, ...known), high = Math.max(0.01, ...known);
  let line = "", pen = "M";
  values.forEach((v, k) => {
    if (v === null) { pen = "M"; return; }
    line += pen + (1 + 82 * k / (values.length - 1)).toFixed(1) + " " + (1 + 24 * (high - v) / (high - low)).toFixed(1);
    pen = "L";
  });
  const path = `<path d="${line}" fill="none" stroke="${color}" stroke-width="1.2"/>`;
  return `<svg viewBox="0 0 84 26" aria-hidden="true">${path}</svg>`;
};
const cell = (row, [name, , kind, digits]) => {
  const value = row[name];
  if (kind === "picture") return `<td>${picture(value, colors[name])}</td>`;
  if (kind === "name") {
    const whole = value || row.file, cut = whole.lastIndexOf("/") + 1;
    return `<td class="name"><span>${safe(whole.slice(0, cut))}</span>${safe(whole.slice(cut))}</td>`;
  }
  if (kind === "why") {
    const command = row.command ? `<details><summary>command</summary><code>${safe(row.command)}</code></details>` : "";
    return `<td class="words">${safe(row.why || "")}${command}</td>`;
  }
  if (kind === "yes") return `<td>${value ? "yes" : row.event ? "no" : ""}</td>`;
  if (kind === "pair") {
    const figure = v => v === null ? "?" : v && Math.abs(v) < 1e-3 ? v.toExponential(1) : Number(v.toPrecision(digits));
    const [before, after] = [row[`${name}_before`], row[`${name}_after`]];
    const unit = row.unit === "pu" ? " pu" : "";
    return `<td>${before === null && after === null ? "" : `${figure(before)} \u2192 ${figure(after)}${unit}`}</td>`;
  }
  if (kind === "words") return `<td class="words">${safe(value ?? "")}</td>`;
  if (value === null || value === undefined) return "<td></td>";
  if (kind === "time") return `<td>${safe(value.replace("T", " ").slice(0, 19))}</td>`;
  if (kind === "figure") return `<td>${Number(value.toPrecision(digits))}</td>`;
  const text = (value * (kind === "share" ? 100 : kind === "milli" ? 1000 : 1)).toFixed(digits);
  return `<td>${Number(text) === 0 ? text.replace("-", "") : text}</td>`;
};
const draw = () => {
  $("body").innerHTML = shown.slice(0, most)
    .map(row => `<tr${row.worth ? ' class="worth"' : ""}>${columns.map(c => cell(row, c)).join("")}</tr>`).join("");
  const rest = shown.length > most ? `, the first ${most} drawn` : "";
  $("count").textContent = `${shown.length} of ${rows.length} rows${rest}`;
  $("more").hidden = shown.length <= most;
};
const order = (a, b) => {
  const [x, y] = [a[key], b[key]], gone = v => v === null || v === undefined || v === "";
  if (gone(x) || gone(y)) return gone(x) - gone(y);  // what is not known comes last, either way
  const ahead = typeof x === "number" ? x - y : String(x).localeCompare(String(y), undefined, {numeric: true});
  return down ? -ahead : ahead;
};
const sift = () => {
  const words = $("text").value.toLowerCase().split(/\\s+/).filter(Boolean), kind = $("kind").value;
  const least = $("depth").value === "" ? null : Number($("depth").value) / 100, worth = $("worth").checked;
  const deep = row => least === null || (row.depth !== null && Math.abs(row.depth) >= least);
  shown = rows.filter(row => (!kind || row.kind === kind) && (!worth || row.worth) && deep(row)
    && words.every(word => row.text.includes(word)));
  if (key) shown = [...shown].sort(order);
  most = atOnce;
  draw();
};
rows.forEach(row => {
  row.text = [row.event, row.file, row.load, row.station, row.kind, row.when, row.why].join(" ").toLowerCase();
});
[...new Set(rows.map(row => row.kind))].sort().forEach(kind => $("kind").add(new Option(kind, kind)));
["text", "depth"].forEach(id => $(id).addEventListener("input", sift));
["kind", "worth"].forEach(id => $(id).addEventListener("change", sift));
$("more").addEventListener("click", () => { most += 5 * atOnce; draw(); });
document.querySelectorAll("th[data-key]").forEach(head => head.addEventListener("click", () => {
  down = key === head.dataset.key ? !down : false;
  key = head.dataset.key;
  document.querySelectorAll("th[data-key]").forEach(other => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  sift();
}));
sift();
"""


def summary(content: Mapping[str, Any]) -> Report:
    """How many files, what is in them, what cannot be read, and the events that tell most where they were asked for."""
    rows = content["rows"]
    report = Report().text(f"{content['files']} files in {content['folder']}, {content['looked_at']} new or changed")
    report.add(kinds(content))
    unread = [row for row in rows if row["kind"] == UNREAD]
    named = [row["why"] if row["file"] in row["why"] else f"{row['file']}: {row['why']}" for row in unread]
    report.text(*(f"  not read: {sentence}" for sentence in named[:MOST]))
    report.text(*[f"  and {len(unread) - MOST} more, in the table"] * (len(unread) > MOST))
    return _best(report, content)


def kinds(content: Mapping[str, Any]) -> Table:
    """How often each kind of event is there."""
    rows = content["rows"]
    names = sorted({row["kind"] for row in rows}, key=lambda k: (k in (UNREAD, QUIET), k))
    counts = [
        [kind, sum(r["kind"] == kind for r in rows), len({r["file"] for r in rows if r["kind"] == kind}),
         sum(r["kind"] == kind and r["worth"] for r in rows)]
        for kind in names
    ]  # fmt: skip
    return Table(["what", "rows", "files", "worth fitting"], counts, f"survey of {content['folder']}")


def report(content: Mapping[str, Any]) -> Report:
    """The page."""
    keys = [key for key in (*(c[0] for c in COLUMNS), *FURTHER) if key not in ("P", "Q")]
    rows = [{key: row[key] for key in keys} for row in content["rows"]]
    data = {
        "columns": COLUMNS, "rows": rows, "atOnce": AT_ONCE, "colors": {"U_picture": VOLTAGE, "P_picture": ACTIVE},
    }  # fmt: skip
    packed = quoting.script(data)
    worth = sum(row["worth"] for row in rows)
    lead = f"{content['files']} files, {len(rows)} rows, {worth} events worth fitting."
    page = _best(Report(f"Survey of {content['folder']}", lead), content)
    return page.add(
        Markup(
            f'<style>{LOOKS}</style>{SIEVE}<div class="wide"><table><thead><tr>{_heads()}</tr></thead>'
            '<tbody id="body"></tbody></table></div><p><button id="more">more rows</button></p>'
            "<noscript><p>The table needs JavaScript; survey.csv holds the same rows.</p></noscript>"
            f'<script type="application/json" id="rows">{packed}</script><script>{WORK}</script>'
        )
    )


SIEVE = (
    '<div class="sieve"><label>words in any column<input id="text" type="search"></label>'
    '<label>kind<select id="kind"><option value="">all</option></select></label>'
    '<label>depth at least [%]<input id="depth" type="number" min="0" max="100" step="1"></label>'
    '<label class="check"><input id="worth" type="checkbox">worth fitting</label><span id="count"></span></div>'
)


def _heads() -> str:
    heads = []
    for key, label, kind, _ in COLUMNS:
        left = ' class="words"' if kind in ("name", "words", "why") else ""
        heads.append(f"<th{left}{'' if kind == 'picture' else f' data-key={key}'}>{quoting.html(label)}</th>")
    return "".join(heads)


def _best(report: Report, content: Mapping[str, Any]) -> Report:
    """The events that tell most, and the command that fits them; nothing where they were not asked for."""
    best = content["informative"]
    if not best:
        return report
    narrower = [f", which narrows the intervals by {each['gain']:.0%}" * bool(k) for k, each in enumerate(best)]
    report.verdict("most informative together, the best first:", kind="good")
    report.items([f"{each['event']}{more}" for each, more in zip(best, narrower, strict=True)])
    return report.text("to fit them together:").code(content["command"])
