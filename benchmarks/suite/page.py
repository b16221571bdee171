"""What the methods of the benchmark reached, as a table and a page.

    python benchmarks/suite/page.py [FOLDER]

makes the page of the rows in the folder of a sweep; without one it writes the tables of the stored
rows into README.md beside this file.
"""

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import PALETTE

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

import marked  # noqa: E402

STORED = HERE / "suite.jsonl"
MARK = "benchmarks/suite/page.py"
COLUMNS = [
    "method",
    "cases",
    "error",
    "error, 90 %",
    "none",
    "band held",
    "right",
    "among several",
    "wrong",
    "silent",
    "s",
    "s, 90 %",
]
CAPTION = (
    "Error: rms of calculated less measured S over the rms of the response, of unused dips from the"
    " dip on, the median and what nine of ten are below; none: dips without a prediction. Band"
    " held: the worst sample of P and of Q lies within it. Right: exactly what is hidden is named,"
    " alone or among several sets that are said to be alike; wrong: all else that is named; silent:"
    " something is hidden. s: seconds of processor, of a fit."
)
NO_USE = 1.0  # an error as large as the response, which a load that never changes has, too
# what is hidden in the cases of each column
GROUPS = {
    "nothing hidden": lambda row: row["truth"] == [] and not row["inexact"],
    "inexact to 1 %": lambda row: row["inexact"],
    "one effect hidden": lambda row: bool(row["truth"]),
    "unknown": lambda row: row["truth"] is None,
}
Rows = Sequence[dict[str, Any]]


def read_sweep(folder: Path) -> Rows:
    """The rows of the jobs of a sweep."""
    paths = sorted(folder.glob("*/suite.json"))
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def describe_seeds(rows: Rows) -> str:
    """Of which seeds the drawn cases are; "" without any."""
    seeds = sorted({row["seed"] for row in rows if row["seed"] is not None})
    return f"Cases 21 to 50 are of seed {', '.join(map(str, seeds))}." if seeds else ""


def write_page(rows: Rows, path: Path) -> str:
    """Write the page, and return the table as it is printed."""
    table = [summarize(own) for own in split_by_method(rows)]
    page = Report("The benchmark: dips that no method saw", describe_seeds(rows))
    page.table(COLUMNS, table, CAPTION)
    page.table(["method", *GROUPS], compare_groups(rows), "Median error of unused dips.")
    page.table(["method", *GROUPS], compare_bands(rows), "Worst samples that the band held.")
    chart = Chart("error of an unused dip [%]", ["share of dips"], pixels=420)
    for k, own in enumerate(split_by_method(rows)):
        errors = np.sort(collect_errors(own))
        shown = errors[errors < NO_USE]
        shares = np.arange(1, len(shown) + 1) / max(len(errors), 1)
        color = PALETTE[k % len(PALETTE)]
        chart.line(own[0]["method"], 100 * shown, shares, color, step=True)
    about = "Share of the unused dips that a method predicts to an error, or better"
    page.chart(chart, f"{about}; errors above {NO_USE:.0%} are not drawn.")
    failures = [
        [row["method"], row["case"], reason] for row in rows for reason in collect_failures(row)
    ]
    if failures:
        page.heading("What failed").table(["method", "case", "reason"], failures, words=(2,))
    path.write_text(page.html, encoding="utf-8")
    lines = [" | ".join(map(str, line)) for line in [COLUMNS, *table]]
    return "\n".join([*lines, str(path)])


def make_tables(rows: Rows) -> str:
    """The tables of stored rows, Markdown."""
    table = [summarize(own) for own in split_by_method(rows)]
    groups = marked.table(["median error of unused dips", *GROUPS], compare_groups(rows))
    bands = marked.table(["worst samples that the band held", *GROUPS], compare_bands(rows))
    parts = [describe_seeds(rows), marked.table(COLUMNS, table), groups, bands, CAPTION]
    return "\n\n".join(filter(None, parts))


def split_by_method(rows: Rows) -> list[Rows]:
    """The rows of each method, in order of names."""
    methods = sorted({row["method"] for row in rows})
    return [[row for row in rows if row["method"] == one] for one in methods]


def compare_groups(rows: Rows) -> list[list[str]]:
    """A row a method: the median error of unused dips in each group of cases."""
    table = []
    for own in split_by_method(rows):
        medians = (find_quantile(filter(is_there, own), 0.5) for is_there in GROUPS.values())
        table.append([own[0]["method"], *map(in_percent, medians)])
    return table


def compare_bands(rows: Rows) -> list[list[str]]:
    """A row a method that gives bands: how many worst samples these held in each group of cases."""
    table = []
    for own in split_by_method(rows):
        cells = [describe_held(filter(is_there, own)) for is_there in GROUPS.values()]
        if any(cells):
            table.append([own[0]["method"], *cells])
    return table


def describe_held(rows: Iterable[dict[str, Any]]) -> str:
    """The share of worst samples that bands held, and of how many; "" without bands."""
    held = collect_held(rows)
    return f"{np.mean(held):.0%} of {len(held)}" if held else ""


def collect_held(rows: Iterable[dict[str, Any]]) -> list[bool]:
    """Whether the band held the worst sample of P and of Q of each unused dip."""
    return [one for row in rows for dip in row.get("dips", ()) for one in dip["held"] or ()]


def measure(rows: Rows) -> dict[str, float]:
    """What a method reached, as numbers; a share of nothing is nan."""
    errors = collect_errors(rows)
    held = collect_held(rows)
    known = [row for row in rows if row["truth"] is not None and row.get("named") is not None]
    said = [row for row in known if row["named"]]
    right = [row for row in said if sorted(row["truth"]) in row["named"] and row["truth"]]
    alone = [row for row in right if len(row["named"]) == 1]
    seconds = [row["seconds"] for row in rows if "seconds" in row]
    return {
        "cases": len(rows),
        "error_median": find_quantile(rows, 0.5),
        "error_90": find_quantile(rows, 0.9),
        "unpredicted": int(np.isinf(errors).sum()),
        "dips": len(errors),
        "band_held": float(np.mean(held)) if held else np.nan,
        "in_bands": len(held),
        "could_name": len(known),
        "named_right": len(alone),
        "right_among_several": len(right) - len(alone),
        "named_wrong": len(said) - len(right),
        "silent": sum(not row["named"] and bool(row["truth"]) for row in known),
        "seconds": float(np.median(seconds)) if seconds else np.nan,
        "seconds_90": float(np.quantile(seconds, 0.9)) if seconds else np.nan,
    }


def summarize(rows: Rows) -> list[str]:
    """The row of a method in the table."""
    told = measure(rows)
    keys = ("named_right", "right_among_several", "named_wrong", "silent")
    names = [str(told[key]) for key in keys]
    seconds = [told["seconds"], told["seconds_90"]]
    return [
        rows[0]["method"],
        str(told["cases"]),
        in_percent(told["error_median"]),
        in_percent(told["error_90"]),
        f"{told['unpredicted']} of {told['dips']}",
        describe_held(rows),
        *(names if told["could_name"] else [""] * len(names)),
        *(f"{one:.1f}" if np.isfinite(one) else "" for one in seconds),
    ]


def find_quantile(rows: Iterable[dict[str, Any]], share: float) -> float:
    """The error that this share of unused dips does not exceed; nan without dips."""
    errors = collect_errors(rows)
    return float(np.quantile(errors, share, method="higher")) if len(errors) else np.nan


def collect_errors(rows: Iterable[dict[str, Any]]) -> np.ndarray:
    """The error of every unused dip, infinite where there is no prediction, (n,)."""
    errors = [dip["error"] for row in rows for dip in row.get("dips", ({"error": None},))]
    return np.array([np.inf if error is None else error for error in errors])


def collect_failures(row: dict[str, Any]) -> list[str]:
    """What a method raised in a case."""
    return [one["failed"] for one in (row, *row.get("dips", ())) if "failed" in one]


def in_percent(share: float) -> str:
    """To two digits; "" for no number."""
    if np.isnan(share):
        return ""
    return f"{100 * share:.2g} %" if share < NO_USE else f"over {NO_USE:.0%}"


if __name__ == "__main__":
    from run import read_rows

    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
        print(write_page(read_sweep(folder), folder / "suite.html"))
    else:
        marked.replace(HERE / "README.md", MARK, make_tables(read_rows(STORED)))
