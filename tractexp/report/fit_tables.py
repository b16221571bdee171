"""Tables of an identification: estimates, where the search ended, errors by event, its origin."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tractexp.blocks import Table
from tractexp.identification.verdict import shorten_verdict
from tractexp.inference.model_error import format_percent, tell_error
from tractexp.record.identity import Identity
from tractexp.report.fitted_curves import ROLES
from tractexp.text.wording import format_epsilon

if TYPE_CHECKING:
    from tractexp.api.identification import Identification

EXACT = (
    "Nothing but noise is left: the estimate is the most likely set, noise whitened, the power"
    " before each dip free. pu: per unit of the record's base."
)
SCATTERED = (
    "More than noise is left: the estimate is the minimum of Eq. (8), and intervals say by how much"
    " it scatters where stretches of 0.1 s are left out. pu: per unit of the record's base."
)
MODEL_ERROR = (
    "Model error: rms of what is left beyond the noise, from the dip on, over the rms of the load's"
    " response, both in apparent power S. epsilon: Eq. (20)."
)
FIXED = "fixed"


def format_digits(value: float) -> str:
    """A number with four digits."""
    return f"{value:.4g}"


def tabulate_parameters(fit: "Identification") -> Table:
    """The estimates. Where the search ended is a detail, unless that lies outside an interval."""
    rows = [
        [
            e.name,
            e.about,
            e.value,
            e.unit,
            "{:.4g} .. {:.4g}".format(*e.interval) if e.interval else "",
            "{:g} .. {:g}".format(*e.bounds),
            e.search,
            shorten_verdict(e.verdict),
        ]
        for e in fit.parameters.values()
        if e.name not in fit.result.nuisances
    ]
    columns = [
        "parameter",
        "meaning",
        "value",
        "unit",
        "95 % interval",
        "bounds",
        "search ended at",
        "verdict",
    ]
    caption = EXACT if fit.adequate else SCATTERED
    for missing in fit.result.unrecorded.values():  # a further column: what it would move each by
        columns.append(f"{missing['words']} moves")
        rows = [[*row, missing["moves"].get(row[0])] for row in rows]
    return Table(
        columns,
        rows,
        fit.model.model.title,
        caption,
        words=(1, 3, 7),
        detail=(1, 5) if fit.parameters.outside_interval else (1, 5, 6),
    )


def tabulate_search_end(fit: "Identification") -> Table:
    """Where the search ended beside the estimate, and a word where they differ."""
    search, result, away = fit.result.search, fit.result, fit.parameters.outside_interval
    keys = [("objective", "pu²"), ("epsilon_p", "1"), ("epsilon_q", "1")] if search else []
    rows = [[key, search[key], getattr(result, key), unit, ""] for key, unit in keys]
    rows += [
        [e.name, e.search, e.value, e.unit, "outside the 95 % interval" if e.name in away else ""]
        for e in fit.parameters.values()
        if e.verdict != FIXED
    ]
    return Table(["", "search ended at", "estimate", "unit", "they differ"], rows, words=(3, 4))


def tabulate_model_errors(fit: "Identification") -> Table:
    """The model's error on each event, and the errors of Eq. (20)."""
    return tabulate_errors(fit.result)


def tabulate_errors(result: Any) -> Table:
    """The errors of a result on each event."""
    unknown = {"value": None, "interval": (), "of_S": None}
    of_events = result.model_error.get("events") or [unknown] * len(result.events)
    return build_error_table(result.events, of_events, result.epsilons)


def list_error_rows(result: Any) -> list[list[str]]:
    """Name, role, model's error and its interval of each event."""
    return [[str(cell) for cell in row[:4]] for row in tabulate_errors(result).rows]


def build_error_table(
    events: Sequence[Any], of_events: Sequence[Any], epsilons: Sequence[str]
) -> Table:
    """Entries of `events` and of `model_error` as `result.json` has them, a row each."""
    columns = ["event", "role", "model error", "95 % interval", "of S", *epsilons]
    rows = [
        [
            e["name"],
            ROLES[e["role"]],
            tell_error(m),
            "" if m.get("stalls") else " .. ".join(map(format_percent, m["interval"])),
            "" if m.get("stalls") else format_percent(m["of_S"]),
            *(format_epsilon(e[key]) for key in epsilons),
        ]
        for e, m in zip(events, of_events, strict=True)
    ]
    return Table(columns, rows, "", MODEL_ERROR, words=(1,), detail=(4,))


def list_origin(result: Any, command: str) -> list[list[str]]:
    """The command, the version and the records that a result was made of, a row each."""
    rows = [["command", command]] if command else []
    rows.append(
        [
            "tractexp",
            f"{result.tractexp_version}{f', commit {result.commit}' if result.commit else ''}",
        ]
    )
    rows += [
        [
            f"record {r['name']} ({r['role']})",
            "; ".join(filter(None, [str(Identity.from_content(r)), f"SHA-256 {r['sha256']}"])),
        ]
        for r in result.records
    ]
    return rows
