"""The figures of kernels that the docs print are those of the stored run."""

import json
from pathlib import Path

import kernel

ROOT = Path(__file__).parents[2]


STORED = json.loads(kernel.FILE.read_text(encoding="utf-8"))


def test_the_page_has_the_tables_of_the_stored_runs():
    page = (ROOT / "docs" / "model.md").read_text(encoding="utf-8")
    assert all(part in page for part in kernel.tables(STORED))


def test_vectors_of_both_widths_were_measured_with_every_model_and_number_of_candidates():
    assert [*STORED] == [kernel.WIDEST, kernel.NARROW]
    assert [r["model"] for r in STORED[kernel.WIDEST]["compiling"]] == [*kernel.COMPILED]
    for rows in STORED.values():
        assert [(r["model"], r["candidates"]) for r in rows["running"]] == [
            (name, n) for name in kernel.RUN for n in kernel.CANDIDATES
        ]
