"""The first screen of an investigation: the verdict, how good the model is now, how much of the gap
is closed, and where. All else is on the page, and printed by `--all`.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

from tractexp.blocks import Report, Table
from tractexp.report.discrepancy import build_gap_table, describe_nearest, describe_where
from tractexp.report.screen import describe_load
from tractexp.text.wording import join_alternatives, shorten

if TYPE_CHECKING:
    from tractexp.api.investigation import Investigation

MOST_SIZES = 3  # parameters of the effects named that the screen has room for


def build_screen(found: "Investigation") -> Report:
    """One screen, the verdict first."""
    names = join_alternatives(found.content["name_sets"])
    page = Report().text(f"verdict: {found.verdict.upper()} {shorten(names)}".rstrip())
    left, fitted = found.remainder.caption, [event.record.name for event in found.question.train]
    sentences = [found.reason, *found.sizes[:MOST_SIZES], left, *found.proposal_sentences[:1]]
    page.items([shorten(sentence) for sentence in sentences if sentence])
    page.text(describe_load(found.result, fitted), shorten(_describe_grade(found)), "")
    page.add(_build_gap(found)).text("")
    told = [
        *describe_where(found.content),
        *describe_nearest(found.content, found.sizes_of_nearest),
    ]
    return page.text(*map(shorten, told))


def _describe_grade(found: "Investigation") -> str:
    """Whether the model that the investigation ends with may be used, and why."""
    which = "the extended model" if found.names else "the base model"
    sentence = found.content["adequacy"]["sentence"].replace("the model", which, 1)
    doubt = "; ".join(found.fit.doubts)
    return f"{found.fit.usability}: {'; '.join(filter(None, [sentence, doubt]))}"


def _build_gap(found: "Investigation") -> Table:
    """The gap without the errors of single channels."""
    table = build_gap_table(found.content)
    epsilons = [k for k, name in enumerate(table.columns) if name.startswith("epsilon")]
    return replace(table, detail=epsilons)
