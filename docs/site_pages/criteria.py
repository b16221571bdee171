"""The page of the thresholds by which an investigation decides."""

import dataclasses
from pathlib import Path

from site_pages.markdown import plain, table
from tractexp.inference.criteria import Criteria
from tractexp.storage import files

HEAD = """# Criteria

Every threshold by which [an investigation](../missing-effects.md) decides. \
`task.criteria.NAME=VALUE` sets one.
*Derived* values follow from the false-alarm rate or a quantile; *chosen* ones were set on the \
development set, whose
seeds are not those of [the judgement set](../judgement.md).
"""
COLUMNS = ("criterion", "default", "meaning", "origin", "reason")


def write(folder: Path) -> Path:
    """Write the page into a folder and return its path."""
    rows = [
        [
            f"`{f.name}`",
            f"{f.default:g}",
            *(plain(f.metadata[key]) for key in ("about", "origin", "why")),
        ]
        for f in dataclasses.fields(Criteria)
    ]
    return files.write(folder / "criteria.md", f"{HEAD}\n{table(COLUMNS, rows)}")
