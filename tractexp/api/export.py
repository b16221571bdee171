"""Write an identified load for another simulator."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from tractexp import files, plugin
from tractexp.api.arguments import public
from tractexp.api.identify import Identification
from tractexp.errors import check_range
from tractexp.outcome import Outcome, Table


@dataclass(frozen=True, eq=False, repr=False)
class Exported(Outcome):
    """An identified load in another simulator's format; `text` is the file, `write(path)` writes it."""

    kind = "export"

    format: str
    suffix: str
    title: str
    text: str
    notes: tuple[str, ...]

    def write(self, path: Path | str) -> Path:
        """Write the file, whole or not at all."""
        return files.write(path, self.text)

    def table(self) -> Table:
        return Table([], [], f"{self.title}, as {self.format}", [*self.notes, "", *self.text.splitlines()])

    def to_dict(self) -> dict[str, Any]:
        return {key: getattr(self, key) for key in ("format", "suffix", "title", "text", "notes")}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        told = {key: content[key] for key in ("format", "suffix", "title", "text")}
        return cls(**told, notes=tuple(content["notes"]))


@public
def export(
    fit: Identification, format: str, *, bus: int = 1, power: float = 100.0, voltage: float = 110.0
) -> Exported:  # fmt: skip
    """Turn an identification into the file of another simulator's format ("andes", "psse_dyr", "modelica", ...).

    The load is on `bus`; 1 pu of its record stands for `power` [MVA] and `voltage` [kV, line to line]. Raises
    `UserError` where the format cannot represent a part of the model.
    """
    from tractexp.exchange.format import Identified

    for name, value, least in (("bus", bus, 1), ("power", power, 1e-6), ("voltage", voltage, 1e-6)):
        check_range(f"task.{name}", value, least)
    identified = Identified(fit.result, bus, power, voltage)
    form = plugin.build("format", {"name": format})
    form.check_parts(identified)
    text = form.text(identified)
    return Exported(format, form.suffix, identified.model.title, text, tuple(form.notes(identified)))
