"""A proposal in sentences, from what `discrepancy.json` holds of it."""

from collections.abc import Mapping, Sequence
from typing import Any

from tractexp.text.wording import format_probability, format_share, format_with_error, join_words


def describe_proposal(proposal: Mapping[str, Any] | None, why: str | None) -> list[str]:
    """The proposal, or why there is none; nothing where none was asked for."""
    if not proposal:
        return [f"no term is proposed: {why}"] if why else []
    (term,) = proposal["terms"]
    explained = proposal["explained"]
    sentences = [
        f"proposed: {term['words']}, which explains {format_share(explained['train'])} of what"
        " exceeds the noise on the"
        f" fitted events and {format_share(explained['validate'])} on the held-out ones;"
        f" {_format_numbers(term['parameters'])}",
    ]
    if not term["function_of_voltage"]:
        sentences.append("it is not a function of the voltage: something happened by itself")
    if proposal["ties"]:
        names = join_words([t["words"] for t in proposal["ties"]], "or")
        sentences.append(f"these events cannot tell it from {names}")
    if proposal["alike"]:
        sentences.append(
            "looks like it:"
            f" {join_words([f'{n} ({format_share(v)})' for n, v in proposal['alike'].items()])}"
        )
    return sentences


def describe_chance(p: float) -> str:
    """How often noise gives as much, as a clause."""
    return (
        "noise gives the best of the whole library as much with a probability of"
        f" {format_probability(p)}"
    )


def _format_numbers(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """ "size = 0.12 ± 0.01, time = 0.03 ± 0.002"."""
    each: Sequence[str] = [
        f"{n} = "
        + format_with_error(
            p["value"], float("nan") if p["standard_error"] is None else p["standard_error"]
        )
        for n, p in parameters.items()
    ]
    return join_words(each)
