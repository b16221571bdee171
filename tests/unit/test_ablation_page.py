"""docs/comparison.md says of the ablation what the stored result says. No searches."""

import json

import ablation
import marked

STORED = json.loads(ablation.STORED.read_text(encoding="utf-8"))


def test_the_page_is_what_the_stored_result_gives():
    _, made, _ = marked.parted(ablation.PAGE.read_text(encoding="utf-8"), ablation.NAME)
    assert made.strip() == ablation.text(STORED).strip()


def test_another_result_gives_another_page():
    changed = json.loads(json.dumps(STORED))
    changed["overall"][0]["ablation"]["effects"][0]["factor"] *= 2
    assert ablation.text(changed) != ablation.text(STORED)


def test_the_stored_result_is_of_all_sets_of_ingredients_on_all_problems_from_a_clean_commit():
    records, iterations, bbob = STORED["overall"]
    assert "dirty" not in STORED["commit"]
    assert len(STORED["commit"]) == 40
    assert (
        records["columns"] == iterations["columns"] == ["tibet_50pct", "tibet_30pct", "tibet_65pct"]
    )
    assert (records["ranks"]["seeds"], bbob["ranks"]["seeds"]) == (90, 24)
    for part in STORED["overall"]:
        assert len(part["figures"]) == 16
        assert [effect["seeds"] for effect in part["ablation"]["effects"]] == [
            24 if part["share"] else 30
        ] * 4
        assert {len(effect["contrasts"]) for effect in part["ablation"]["effects"]} == {8}


def test_text_goes_between_its_marks_only(tmp_path):
    first, last = marked.marks("me")
    page = tmp_path / "page.md"
    page.write_text(f"above\n{first}old\n{last}below\n")
    marked.replace(page, "me", "new")
    assert page.read_text() == f"above\n{first}\nnew\n\n{last}below\n"
