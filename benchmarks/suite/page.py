"""What the methods of the benchmark reached, as a table and a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import PALETTE

COLUMNS = [
    "method",
    "cases",
    "error of unused dips, median",
    "9 of 10 below",
    "no prediction",
    "band held",
    "named right",
    "named wrong",
    "silent, something hidden",
    "seconds, median",
]
CAPTION = (
    "Error: rms of calculated less measured S over the rms of the response, from the dip on. Band:"
    " the worst sample of P and of Q lies within it. Right: exactly what is hidden; wrong: anything"
    " else that is named; seconds: of processor, of a fit."
)


def write_page(rows: Sequence[dict[str, Any]], seed: int, path: Path) -> str:
    """Write the page, and return the table as it is printed."""
    methods = sorted({row["method"] for row in rows})
    table = [summarize([row for row in rows if row["method"] == one]) for one in methods]
    page = Report("The benchmark: dips that no method saw", f"cases 21 to 50 from seed {seed}.")
    page.table(COLUMNS, table, CAPTION)
    chart = Chart("error of an unused dip [%]", ["share of dips"], pixels=420)
    for k, method in enumerate(methods):
        errors = np.sort(collect_errors([row for row in rows if row["method"] == method]))
        shown = errors[np.isfinite(errors)]
        shares = np.arange(1, len(shown) + 1) / max(len(errors), 1)
        chart.line(method, 100 * shown, shares, PALETTE[k % len(PALETTE)], step=True)
    page.chart(chart, "Share of the unused dips that a method predicts to an error, or better.")
    failures = [
        [row["method"], row["case"], reason] for row in rows for reason in collect_failures(row)
    ]
    if failures:
        page.heading("What failed").table(["method", "case", "reason"], failures, words=(2,))
    path.write_text(page.html, encoding="utf-8")
    lines = [" | ".join(map(str, line)) for line in [COLUMNS, *table]]
    return "\n".join([*lines, str(path)])


def measure(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """What a method reached, as numbers; a share of nothing is nan."""
    errors = collect_errors(rows)
    held = [one for row in rows for dip in row.get("dips", ()) for one in dip["held"] or ()]
    known = [row for row in rows if row["truth"] is not None and row.get("named") is not None]
    is_right = [row["named"] == sorted(row["truth"]) for row in known]
    named = [bool(row["named"]) for row in known]
    seconds = [row["seconds"] for row in rows if "seconds" in row]
    return {
        "cases": len(rows),
        "error_median": float(np.quantile(errors, 0.5, method="higher")),
        "error_90": float(np.quantile(errors, 0.9, method="higher")),
        "unpredicted": int(np.isinf(errors).sum()),
        "dips": len(errors),
        "band_held": float(np.mean(held)) if held else np.nan,
        "in_bands": len(held),
        "could_name": len(known),
        "named_right": sum(a and b for a, b in zip(named, is_right, strict=True)),
        "named_wrong": sum(a and not b for a, b in zip(named, is_right, strict=True)),
        "silent": sum(not row["named"] and bool(row["truth"]) for row in known),
        "seconds": float(np.median(seconds)) if seconds else np.nan,
    }


def summarize(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The row of a method in the table."""
    told = measure(rows)
    names = [str(told[key]) for key in ("named_right", "named_wrong", "silent")]
    return [
        rows[0]["method"],
        str(told["cases"]),
        in_percent(told["error_median"]),
        in_percent(told["error_90"]),
        f"{told['unpredicted']} of {told['dips']}",
        f"{told['band_held']:.0%} of {told['in_bands']}" if told["in_bands"] else "",
        *(names if told["could_name"] else [""] * 3),
        f"{told['seconds']:.1f}" if np.isfinite(told["seconds"]) else "",
    ]


def collect_errors(rows: Sequence[dict[str, Any]]) -> np.ndarray:
    """The error of every unused dip, infinite where there is no prediction, (n,)."""
    errors = [dip["error"] for row in rows for dip in row.get("dips", ({"error": None},))]
    return np.array([np.inf if error is None else error for error in errors])


def collect_failures(row: dict[str, Any]) -> list[str]:
    """What a method raised in a case."""
    return [one["failed"] for one in (row, *row.get("dips", ())) if "failed" in one]


def in_percent(share: float) -> str:
    return f"{100 * share:.2g} %" if np.isfinite(share) else "none"
