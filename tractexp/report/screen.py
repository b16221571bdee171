"""The first screen of a command: the answer in at most 25 lines of 80 characters. All else is on
the page, and printed by `--all`.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tractexp.blocks import Report, Table
from tractexp.identification.result import Result
from tractexp.identification.verdict import (
    BOUND,
    END_OF_RANGE,
    IDENTIFIED,
    UNIDENTIFIED,
    WEAK,
    shorten_verdict,
)
from tractexp.inference.model_error import format_percent, tell_error
from tractexp.record.identity import UNKNOWN, Identity, label
from tractexp.text.wording import (
    count_noun,
    format_with_error,
    list_first,
    shorten,
    write_quantity,
)

if TYPE_CHECKING:
    from tractexp.api.identification import Identification

MOST_PARAMETERS = 10  # rows of the table of parameters
MOST_EVENTS = 2  # events that a line names
# verdicts in a word, so that rows fit a line beside long names
SHORT = {
    IDENTIFIED: "yes",
    WEAK: "weakly",
    UNIDENTIFIED: "no",
    BOUND: "at bound",
    END_OF_RANGE: "at end",
}


def build_screen(fit: "Identification") -> Report:
    """Which load, whether the model may be used and why, its parameters, its error, what next."""
    result = fit.result
    page = describe_judged_load(fit).add(tabulate_parameters(fit))
    if len(rows := fit.own_parameters) > MOST_PARAMETERS:
        page.text(f"{count_noun(len(rows) - MOST_PARAMETERS, 'parameter')} more: --all prints all")
    page.text("")
    if fit.operating_point is not None:
        page.text(f"motor: {fit.operating_point.machine}")
    if bound := result.share_bound:
        page.text(shorten(f"share: {bound['sentence']}."))
    page.text(describe_error(result))
    return page.text(*(f"next: {sentence}" for sentence in fit.next_steps[:1]))


def describe_judged_load(fit: "Identification") -> Report:
    """The load, and whether its model may be used and why: two sentences."""
    result = fit.result
    names = [event["name"] for event in result.events if event["role"] == "train"]
    page = Report().text(describe_load(result, names))
    if fit.usability:
        page.text(shorten(f"{fit.usability_sentence}."))
    return page.text("")


def describe_load(result: Result, names: Sequence[str]) -> str:
    """Station and load, voltage and power before the dip, and which dips were fitted.

    S is what shares "of S" are told of.
    """
    own, before = result.base, result.before
    scale, units = choose_units(result)
    P, Q = scale * before["P0"], scale * before["Q0"]
    drawn = zip("PQS", (P, Q, math.hypot(P, Q)), units, strict=True)
    powers = [write_quantity(symbol, power, unit) for symbol, power, unit in drawn]
    identities: list[Identity] = result.identities
    voltage = identities[0].voltage if identities else None
    level = write_quantity("U", before["U0"] * (voltage or 1.0), "kV" if voltage else "pu")
    dips = list_first(names, MOST_EVENTS)
    parts = [label(identities), level, *powers, f"fitted: {dips}"]
    unknown = f" ({UNKNOWN})" if not (own.in_mva or voltage) else ""
    return f"load: {', '.join(filter(None, parts))}{unknown}"


def choose_units(result: Result) -> tuple[float, tuple[str, str, str]]:
    """The factor of powers, and the units of P, Q and S that they then have: MW, Mvar and MVA where
    the record tells them.
    """
    own = result.base
    return (own.power, ("MW", "Mvar", "MVA")) if own.in_mva else (own.ratio, ("pu", "pu", "pu"))


def tabulate_parameters(fit: "Identification") -> Table:
    """Name, value with its standard error, unit, 95 % interval, and whether it is identified, in a
    word.
    """
    rows = [
        [
            e.name,
            format_with_error(e.value, e.standard_error or 0.0),
            e.unit,
            "{:.4g} .. {:.4g}".format(*e.interval) if e.interval else "",
            name_verdict(e.verdict),
        ]
        for e in fit.own_parameters[:MOST_PARAMETERS]
    ]
    columns = ["parameter", "value ± std. error", "unit", "95 % interval", "known"]
    return Table(columns, rows, words=(2, 4))


def name_verdict(verdict: str) -> str:
    """A verdict on a parameter in a word or two."""
    return SHORT.get(shorten_verdict(verdict), shorten_verdict(verdict))


def describe_error(result: Result) -> str:
    """The model's error on the events fitted and held out, in a line."""
    fitted, held_out = result.model_error, result.model_error.get("held_out")
    if not fitted:
        return "error: not judged"
    parts = [f"fitted {_tell_error(fitted)}"]
    parts.append(f"held out {_tell_error(held_out)}" if held_out else "no event was held out")
    return f"error, of the response: {', '.join(parts)}"


def _tell_error(entry: Mapping[str, Any]) -> str:
    """A model's error with its interval."""
    interval = entry.get("interval")
    if entry.get("stalls") or not isinstance(interval, list | tuple) or None in interval:
        return tell_error(entry)
    return f"{tell_error(entry)} ({' to '.join(map(format_percent, interval))})"
