"""CITATION.cff is what the Citation File Format 1.2.0 asks for, and says what the project says of
itself.
"""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def cited():
    return yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_it_has_what_the_format_requires(cited):
    assert cited["cff-version"] == "1.2.0"
    assert isinstance(cited["message"], str)
    assert isinstance(cited["title"], str)
    assert cited["type"] in ("software", "dataset")
    known = {
        "abstract",
        "authors",
        "cff-version",
        "commit",
        "contact",
        "date-released",
        "doi",
        "identifiers",
        "keywords",
        "license",
        "license-url",
        "message",
        "preferred-citation",
        "references",
        "repository",
        "repository-artifact",
        "repository-code",
        "title",
        "type",
        "url",
        "version",
    }
    assert cited.keys() <= known
    for people in (cited["authors"], *(reference["authors"] for reference in cited["references"])):
        assert people
        for one in people:
            assert one.keys() <= {"name"} or one.keys() <= {"family-names", "given-names", "orcid"}


def test_version_licence_and_keywords_are_the_projects(cited):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert str(cited["version"]) == project["version"]
    assert cited["license"] == project["license"]
    assert cited["keywords"] == project["keywords"]


def test_it_refers_to_the_paper_that_the_readme_names(cited):
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    (paper,) = cited["references"]
    assert {"type", "title", "authors"} <= paper.keys()
    assert re.fullmatch(r"10\.\d{4,}/\S+", paper["doi"])
    assert f'"{paper["title"]}", {paper["journal"]} {paper["year"]}' in readme
    assert f"{paper['volume']}({paper['issue']}), {paper['start']}" in readme
