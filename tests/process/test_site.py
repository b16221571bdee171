"""What the site generates, and what its pages say about the code; .ci/run builds it with warnings
as errors.
"""

import ast
import re
from pathlib import Path

import pytest

import tractexp
from site_pages import api, catalogue, commands, criteria, gallery, markdown, tasks
from tractexp import PUBLIC
from tractexp.configuration.plugin import discover, get
from tractexp.extend import Effect, Parameter, UserError
from tractexp.model.printed import list_changed_lines

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """{title: page} of the catalogues, without their pictures."""
    folder = tmp_path_factory.mktemp("generated")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(catalogue.pictures, "draw", lambda cls, path: "")
        return {path.stem: path.read_text(encoding="utf-8") for path in catalogue.write(folder)}


def section(page, name):
    return page.partition(f"## `{name}`")[2].partition("\n## `")[0]


def test_every_plugin_has_its_section_and_every_group_its_page(pages):
    assert {*discover()} - {"task"} == {*catalogue.GROUPS}
    for group, (title, _) in catalogue.GROUPS.items():
        page = pages[title.lower().replace(" ", "-")]
        assert re.findall(r"^## `(\w+)`", page, re.MULTILINE) == sorted(discover()[group])


def test_a_part_tells_its_parameters_their_bounds_and_its_source(pages):
    for group, stem in (
        ("model/motor", "motors"),
        ("model/static", "static-loads"),
        ("effect", "effects"),
    ):
        for name, cls in discover()[group].items():
            told = section(pages[stem], name)
            assert "**Source:**" in told, name
            assert "domains" in told
            for p in cls.parameters:
                assert f"| ${p.symbol}$ | `{p.name}` |" in told, f"{name} {p.name}"
                assert f"{p.bounds[0]:g} to {p.bounds[1]:g}" in told
                assert markdown.plain(p.source) in told


def test_an_effect_tells_where_it_acts_and_which_equations_change(pages):
    told = section(pages["effects"], "stator_resistance")
    assert "| acts on | stator impedance |" in told
    assert "| domains | phasors, waveforms |" in told
    assert r"Z' = R_s + j \, X' \quad \text{instead of} \quad Z' = j \, X'" in told
    assert "[`feeder_impedance`](#effect-feeder-impedance)" in told
    assert "| domains | waveforms |" in section(pages["effects"], "stuck_pole")


def test_settings_have_their_defaults_and_what_is_said_beside_them(pages):
    told = section(pages["optimizers"], "pso")
    assert "| `inertia` | `0.8` | omega |" in told
    assert "| `polish` | `false` |" in told
    assert "| `population` | `0` | 0: pycma's 4 + 3 ln d |" in section(pages["optimizers"], "cmaes")


def test_the_picture_of_an_effect_shows_both_loads(tmp_path):
    told = catalogue.pictures.draw(get("effect", "stator_resistance"), tmp_path / "drawn.svg")
    drawn = (tmp_path / "drawn.svg").read_text(encoding="utf-8")
    assert "Grey: `electromechanical` motor beside `exponential` static load." in told
    assert "`R_s` = 0.1" in told
    for color in ("#d55e00", "#0072b2", "#9a9a9a"):  # of Okabe and Ito, and what is behind
        assert color in drawn.lower()
    first = drawn
    catalogue.pictures.draw(get("effect", "stator_resistance"), tmp_path / "drawn.svg")
    assert (tmp_path / "drawn.svg").read_text(encoding="utf-8") == first


def test_a_docstring_becomes_markdown_that_shows_what_it_says():
    class Told:
        """Share of E* and [x] as `code*`.

            P = a * b

        Source: someone 2026, Eq. (1).
        Departures: none.
        """

    assert markdown.docstring(Told) == (
        "Share of E\\* and \\[x\\] as `code*`.\n\n```text\nP = a * b\n```\n\n"
        "**Source:** someone 2026, Eq. (1).\n\n**Departures:** none."
    )


def test_sections_of_numpydoc_become_lists_and_blocks():
    class Told:
        """A call.

        Parameters
        ----------
        a, b : (n,) [pu]
            Of `x`,
            and y.
        c

        Examples
        --------
        >>> 1 + 1
        2
        """

    assert markdown.docstring(Told) == (
        "A call.\n\n**Parameters**\n\n- **a, b : (n,) \\[pu\\]**: Of `x`, and y.\n- **c**: "
        "\n\n**Examples**\n\n```python\n>>> 1 + 1\n2\n```"
    )


def test_the_symbols_of_all_equations_have_one_index_and_one_exponent():
    """TeX refuses `t_b_1`; the equations of a page and of a notebook must be set."""
    from tractexp.testing import models

    for group in ("model/motor", "model/static", "effect"):
        for name, cls in discover()[group].items():
            for line in models.with_part(cls).latex():
                assert not re.search(r"_(\{[^{}]*\}|\\?\w+)_", line), f"{name}: {line}"


def test_changed_equations_are_those_that_differ_or_came_in():
    before, after = ["a = 1", "b = 2", "a|_0 = 1"], ["a = 1", "b = 3", "c = 4", "a|_0 = 2"]
    assert list_changed_lines(before, after) == [("b = 2", "b = 3"), (None, "c = 4")]


def test_every_task_has_a_page_with_its_settings_and_the_commands_that_pages_show(tmp_path):
    made = {path.stem: path.read_text(encoding="utf-8") for path in tasks.write(tmp_path)}
    assert made.keys() == {"index", *discover()["task"]}
    assert "| `task.within` | `0.05` |" in made["plan"]
    assert "with half of its 95 % interval `within` a share of the value" in " ".join(
        made["plan"].split()
    )
    assert "null: in single runs, not in sweeps" in made["identify"]
    assert "task=discrepancy data=contactors" in made["discrepancy"]
    assert "[How an effect is named: A worked example](" in made["discrepancy"]
    assert "](../../missing-effects.md#a-worked-example)" in made["discrepancy"]
    assert "## Shown in" in made["identify"]
    assert "tractexp look" not in made["identify"]


def test_every_public_call_and_every_base_is_on_the_page_of_calls(tmp_path):
    page = api.write(tmp_path).read_text(encoding="utf-8")
    for name in PUBLIC:
        assert f":: tractexp.{name}\n" in page
    for cls in (Effect, Parameter):
        assert f".. autoclass:: tractexp.extend.{cls.__name__}\n" in page


def test_every_criterion_is_on_its_page_with_its_origin(tmp_path):
    page = criteria.write(tmp_path).read_text(encoding="utf-8")
    with pytest.raises(UserError, match=r"criteria\.what: there is no such criterion") as refused:
        tractexp.investigate("tibet_50pct", criteria={"what": 1.0})
    names = str(refused.value).rpartition(": ")[2].split(", ")
    assert len(names) >= 5
    for name in names:
        assert re.search(rf"\| `{name}` \| [\d.e-]+ \|.*\| (chosen|derived) \|", page), name


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = {line for line in index.splitlines() if re.fullmatch(r"[\w/-]+", line)}
    assert {path.stem for path in DOCS.glob("*.md")} - {"index"} <= listed
    groups = {
        f"generated/catalogue/{title.lower().replace(' ', '-')}"
        for title, _ in catalogue.GROUPS.values()
    }
    assert {one for one in listed if "catalogue" in one} == groups


def test_commands_of_a_page_are_its_code_and_nothing_else(tmp_path):
    path = tmp_path / "page.md"
    path.write_text(
        "# One\n\n```sh\ntractexp look a.cfg   # so\n```\n\n```\nverdict: NAMED\n```\n\n## Two\n\n"
        "    tractexp -m seed=1,2 \\\n      budget=5\n\nText with `tractexp ui` and `code`.\n"
    )
    first, second = commands.of(path)
    assert (first.heading, first.arguments) == ("One", ["look", "a.cfg"])
    assert (second.heading, second.arguments) == ("Two", ["-m", "seed=1,2", "budget=5"])
    assert [c.line for c in commands.inline(path)] == ["tractexp ui"]


def test_the_gallery_has_twelve_programs_each_with_what_it_is_for():
    listed = gallery.list_examples()
    assert len(listed) == 12
    assert {*listed} == {*(DOCS / "gallery").glob("*.py")}
    for path in listed:
        title, empty, about = (ast.get_docstring(ast.parse(path.read_text())) or "").split("\n", 2)
        assert title
        assert not empty
        assert len(about.split()) > 10, path.name


@pytest.mark.usefixtures("registry_as_it_was")
def test_a_program_of_the_gallery_stands_with_what_it_prints_and_its_picture(tmp_path):
    section = gallery._run_example(DOCS / "gallery" / "draw_again.py", tmp_path)
    assert section.startswith("## An effect of your own\n")
    assert "class DrawAgain(Effect):" in section
    assert "exponential static load with draw_again" in section
    assert "![An effect of your own](gallery/draw_again.svg)" in section
    assert "<svg" in (tmp_path / "gallery" / "draw_again.svg").read_text(encoding="utf-8")
