"""SECURITY.md promises nothing that no test holds: each row names tests, and they are there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEST = re.compile(r"`([\w/]+\.py)::(\w+)`")


def promises() -> list[tuple[str, list[tuple[str, str]]]]:
    """(what is told, [(file, test)]) of the rows of the tables that have a column of tests."""
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    tables = re.findall(r"^\|.*\| tests \|\n\|[-|]+\|\n((?:\|.*\|\n)+)", text, re.MULTILINE)
    rows = [row for table in tables for row in table.splitlines()]
    return [
        (row.split("|")[1].strip(), TEST.findall(row.rstrip("|").rpartition("|")[2]))
        for row in rows
    ]


@pytest.mark.parametrize(("told", "tests"), promises(), ids=[told for told, _ in promises()])
def test_each_row_names_tests_that_are_there(told, tests):
    assert tests
    for file, name in tests:
        tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, (
            file,
            name,
        )


def test_all_rows_are_seen():
    assert len(promises()) > 15
