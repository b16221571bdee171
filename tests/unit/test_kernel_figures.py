"""The figures of kernels that the docs print are those of the stored run."""

import json
from pathlib import Path

import kernel

ROOT = Path(__file__).parents[2]


def test_the_page_has_the_tables_of_the_stored_run():
    rows = json.loads(kernel.FILE.read_text(encoding="utf-8"))
    page = (ROOT / "docs" / "model.md").read_text(encoding="utf-8")
    assert all(table in page for table in kernel.tables(rows).split("\n\n"))
    assert rows["processor"] in " ".join(page.split())


def test_every_model_and_number_of_candidates_is_in_the_stored_run():
    rows = json.loads(kernel.FILE.read_text(encoding="utf-8"))
    assert [r["model"] for r in rows["compiling"]] == [*kernel.COMPILED]
    assert [(r["model"], r["candidates"]) for r in rows["running"]] == [
        (name, n) for name in kernel.RUN for n in kernel.CANDIDATES
    ]
