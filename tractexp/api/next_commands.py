"""The commands that go on from the files of an investigation."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from tractexp.api.investigation import Investigation
from tractexp.configuration.run_command import build_again_command
from tractexp.identification.adequacy import Grade
from tractexp.text.wording import join_words, shorten, shorten_path

NEXT = "next: "


def list_next_commands(result: Investigation, paths: Mapping[str, Path]) -> list[str]:
    """The commands that go on from the files of an investigation, {name: path}, each with what it
    does.

    What is missing still is looked for in the domain that tells more, where there is one.
    """
    from tractexp.discrepancy.discrepancy_json import MODEL_FILE, adopt_term, use_of
    from tractexp.discrepancy.proposal.generate import PLUGIN

    lines, domain = [], result.question.model.domain
    grade, fit_all = result.content["adequacy"]["grade"], result.gap.fitted_to_both
    context = result.steps.context
    better = next(filter(None, map(context.domain.better, context.events)), "")
    typed = {name: shorten_path(path) for name, path in paths.items()}
    if model := typed.get(MODEL_FILE.name):
        use = use_of(domain, model, fit_all=fit_all)
        which = f", which has {join_words(result.names)}" if result.verdict == "tied" else ""
        if grade == Grade.WRONG_MODEL:
            lines.append(f"see the extended model, which does not describe this load: {use}")
        else:
            lines.append(f"use the extended model{which}: {use}")
        if grade != Grade.ADEQUATE and not better:
            again = use_of(domain, model, fit_all=fit_all, task=["task=discrepancy"])
            lines.append(f"investigate it as the base model: {again}")
    if grade != Grade.ADEQUATE and better:
        in_waves = build_again_command("task=discrepancy", "domain=waves", of=("data", "task"))
        lines.append(f"{NEXT}{better}: {in_waves}")
    if term := typed.get(PLUGIN):
        lines.append(f"use the proposed term: {adopt_term(term)}")
    return lines


def choose_next(lines: Sequence[str], result: Investigation) -> str:
    """The one sentence that a screen has room for: of another domain, else the first command, else
    what would decide about what is left, else the recommendation.
    """
    urgent = [line.removeprefix(NEXT) for line in lines if line.startswith(NEXT)]
    open_ones = result.readings if result.verdict == "unexplained" else []
    deciding = [f"{shorten(one.sentence)}: {one.command}" for one in open_ones]
    return next(iter([*urgent, *lines, *deciding, result.recommendation]))
