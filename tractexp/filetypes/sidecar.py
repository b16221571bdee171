"""The JSON beside a table: its name, where it is from, its base and units, and what its columns
are.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tractexp.errors import UserError
from tractexp.record.record import DECLARATION, LOAD, SIZES, Base
from tractexp.record.window import Window
from tractexp.storage import files
from tractexp.storage.files import locate_file


@dataclass(frozen=True)
class Sidecar:
    """The content of `name.json` beside `name.csv`; each key is optional, and other keys are the
    user's own.
    """

    name: str | None = None
    notes: tuple[str, ...] = ()
    base: Base | None = None
    columns: Mapping[str, Any] = field(default_factory=dict)  # as data.columns
    units: Mapping[str, str] = field(default_factory=dict)  # as data.units
    uniform: bool = False  # its times are those of a record as read: they need no mending
    window: Window | None = None  # what the phasors of such a record are averages over
    more: tuple[str, ...] = ()  # further columns of it: P_3, THD_u, ...
    recording: Mapping[str, Any] | None = None  # of a recording that task=convert wrote


def read_sidecar(path: str) -> Sidecar:
    """The sidecar of a table, an empty one where there is none; raises `UserError` for one that is
    no JSON.
    """
    own = locate_file(path)
    if own.suffix.lower() == ".json" or not files.is_there(own):
        return Sidecar()
    file = own.with_name(f"{own.stem}.json")
    if not files.is_there(file):
        return Sidecar()
    content = files.read_json(file)
    if not isinstance(content, dict):
        return Sidecar()
    notes = [content.get("note"), *_take_kind(list, content, "notes")]
    return Sidecar(
        str(content["name"]) if "name" in content else None,
        tuple(note for note in notes if isinstance(note, str)),
        _read_base(file, content.get("base")),
        _take_kind(dict, content, "columns"),
        {key: str(unit) for key, unit in _take_kind(dict, content, "units").items()},
        content.get("uniform") is True,
        _read_window(file, content.get("window")),
        tuple(map(str, _take_kind(list, content, "more"))),
        _take_kind(dict, content, "recording") or None,
    )


def _take_kind(kind: type[Any], content: Mapping[str, Any], key: str) -> Any:
    """The value under a key where it is of that kind, else an empty one."""
    return content[key] if isinstance(content.get(key), kind) else kind()


def _read_window(file: Any, content: Any) -> Window | None:
    """The recorder's window; None where the sidecar has none. Raises `UserError` for another
    form.
    """
    if not isinstance(content, dict):
        return None
    try:
        return Window.from_content(content)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise UserError(f"{file}: window is not as task=convert writes it; leave it out") from error


def _read_base(file: Any, content: Any) -> Base | None:
    """The base of per-unit values, where the sidecar tells it in numbers; else None."""
    if not isinstance(content, dict):
        return None
    numbers = {key: content[key] for key in ("voltage", "power", "frequency") if key in content}
    for key, value in numbers.items():
        low, high = SIZES[key]
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not low <= value <= high
        ):
            raise UserError(
                f"{file}: base.{key} = {json.dumps(value):.60} must be a number from {low:g} to"
                f" {high:g} (kV, MVA, Hz)"
            )
    origin = LOAD if content.get("origin") == LOAD else DECLARATION  # as task=convert writes it
    return Base(**{key: float(value) for key, value in numbers.items()}, origin=origin)
