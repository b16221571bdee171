"""The documentation holds together: links lead somewhere, every plugin that a person chooses is
described.
"""

import ast
import dataclasses
import re
from pathlib import Path

import hostile
import pytest

import tractexp
from tractexp.api.gap import Misfit
from tractexp.configuration.plugin import discover
from tractexp.exchange.operating_point import OperatingPoint

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_link_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        # those the site makes and checks
        if "://" not in target and not target.startswith("generated/"):
            assert (page.parent / target).exists(), target


def test_every_optimizer_effect_and_part_is_described():
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    for group in ("optimizer", "effect", "model/motor", "model/static", "format", "data"):
        for name, cls in discover().get(group, {}).items():
            # not what another test registered
            if cls.__module__.startswith(("tractexp.", "tractexp_plugins.")):
                assert f"`{name}`" in text or f"{group}={name}" in text, f"{group} {name}"


def test_the_pages_are_read_in_an_afternoon():
    """At most 30,000 words, the bars of tables counted: a fact that comes in pushes one out."""
    assert (
        sum(len(page.read_text(encoding="utf-8").split()) for page in (ROOT / "docs").glob("*.md"))
        <= 30_000
    )


@pytest.mark.parametrize("page", ["identification", "missing-effects"])
def test_a_page_of_method_is_read_at_one_sitting(page):
    """At most 900 words: what a method needs beyond that is a catalogue, a study or a docstring."""
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    assert len(text.split()) <= 900


def test_what_computes_a_number_is_where_the_page_says():
    page = (ROOT / "docs" / "numbers.md").read_text(encoding="utf-8")
    places = re.findall(r"`(tractexp/[\w/]+\.py)`((?: `\w+`(?:, `\w+`)*)?)", page)
    assert len(places) > 25
    for path, names in places:
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        defined = {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef)}
        assert {*re.findall(r"`(\w+)`", names)} <= defined, f"{path}: {names}"


# of what results hold, what is no number or was given
NO_NUMBERS = {
    *("status", "seed", "at_bound", "units", "bounds", "model", "shown_effects", "optimizer"),
    *("advice", "notes", "verdicts", "records", "own_base", "tractexp_version", "commit"),
}


def test_every_number_of_a_result_is_on_the_page_of_numbers(tmp_path):
    page = (ROOT / "docs" / "numbers.md").read_text(encoding="utf-8")
    told = {*re.findall(r"`(\w+)`", page)} - NO_NUMBERS
    path = tmp_path / "result.json"
    path.write_text(hostile.result())
    for held in (tractexp.load(path).result, OperatingPoint, Misfit):
        assert {field.name for field in dataclasses.fields(held)} - NO_NUMBERS <= told
