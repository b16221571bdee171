"""How the structures did that were raced before a fit."""

from collections.abc import Mapping, Sequence
from typing import Any

from tractexp.blocks import Table

CAPTION = (
    "What each leaves of the load's response where it is fitted, and where it predicts stretches or"
    " dips that it was not fitted to. The simplest within 5 % of the best is the model."
)


def tabulate_race(entries: Sequence[Mapping[str, Any]]) -> list[Table]:
    """The entries, the winner first; none where no structures were raced."""
    if not entries:
        return []
    rows = [
        [
            entry["name"],
            entry["parameters"],
            _format_percent(entry["fitted"]),
            _format_percent(entry["predicted"]),
            entry["why"] or ("the model" if number == 0 else ""),
        ]
        for number, entry in enumerate(entries)
    ]
    columns = ["structure", "parameters", "fitted", "predicted", ""]
    return [Table(columns, rows, "Structures raced", CAPTION, words=(0, 4))]


def _format_percent(error: float | None) -> str:
    return "" if error is None else f"{100 * error:.3g} %"
