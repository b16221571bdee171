"""The content of a table, from its columns: what it holds, and a load's powers against time."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.column_key import check_mapping
from tractexp.filetypes.column_options import MappedColumn
from tractexp.filetypes.column_unit import PER_UNIT
from tractexp.filetypes.direct_table import describe_direct_table
from tractexp.filetypes.mapping import Mapped, map_columns, map_voltage
from tractexp.filetypes.phasor_columns import read_phasors
from tractexp.filetypes.power_columns import (
    Powers,
    has_absolute_unit,
    read_columns,
    read_powers,
    take_line_voltage,
)
from tractexp.filetypes.sidecar import Sidecar, read_sidecar
from tractexp.filetypes.table import TableFile, TableForm, find_instrument, open_table
from tractexp.record import Base, Record
from tractexp.recording.snapshot import OTHER_FREQUENCY, find_nominal_frequency
from tractexp.storage.files import locate_file

LEAST_LIVE_VOLTAGE = 0.5  # of the median voltage: at less the frequency is noise
SLOWEST = 10.0  # Hz: no network's frequency is lower


@dataclass(frozen=True, kw_only=True)
class Tabular:
    """The settings of readers of tables; what is not set is detected, and a note says how it was
    read.
    """

    # {U: name of a column, or its number from 0}
    columns: dict[str, Any] = field(default_factory=dict)
    # {U: kV, P: MW, t: ms} where the header does not have them
    units: dict[str, str] = field(default_factory=dict)
    decimal: str = ""  # decimal mark, "." or ","
    header: int | None = None  # line of the columns' names, from 1
    sheet: Any = None  # of a workbook, by name or number from 1
    encoding: str | None = None  # of a text file

    def check_table(self) -> None:
        """Raise `UserError` for a setting that cannot be."""
        check_mapping(self.columns, self.units)
        self._form.check()

    @property
    def _form(self) -> TableForm:
        """How the table is written, as the settings say."""
        return TableForm(self.decimal, self.header, self.sheet, self.encoding)

    def table_of(
        self, path: str, sidecar: Sidecar, join: Sequence[str] = ()
    ) -> tuple[TableFile, Mapped]:
        """A table, with those of the same event, and what its columns are; raises `UserError` for
        what is no table, or ambiguous.
        """
        table = open_table(path, replace(self._form, join=tuple(join)))
        columns = {**sidecar.columns, **self.columns}
        units = {**sidecar.units, **self.units}
        try:
            return table, map_columns(table, columns, units, sidecar.more)
        except UserError:
            if said := describe_direct_table(table, units):
                raise UserError(f"{table.source}: {said}") from None
            raise

    def record_voltage(
        self, source: str, path: str, join: Sequence[str], nominal: float
    ) -> Record | None:
        """The line voltage [kV, or as it stands without a unit] of a table without powers as a
        record of `source`, P and Q unknown (nan); None where it holds more, or cannot be read.
        """
        try:
            table = open_table(path, replace(self._form, join=tuple(join)))
            mapping = map_voltage(table)
            if mapping is None or describe_direct_table(table, self.units):
                return None
            return _record_voltage(source, table, mapping, nominal)
        except UserError:
            return None


def _record_voltage(source: str, table: TableFile, mapping: Mapped, nominal: float) -> Record:
    values, start, said = read_columns(table, mapping)
    keys = [key for key in values if key[0] == "U"]
    columns = {"U": np.mean([values[key] for key in keys], axis=0)}
    absolute = has_absolute_unit(mapping, keys[0])
    lines = take_line_voltage(columns, mapping.columns[keys[0]], None) if absolute else []
    level = float(np.nanmedian(columns["U"])) if absolute else 1.0
    record = Record(
        name=Path(source).stem,
        t=values["t"],
        U=columns["U"] / level,
        P=np.zeros(len(values["t"])),
        Q=np.zeros(len(values["t"])),
        source=source,
        base=Base(level, frequency=table.frequency or nominal),
        identity={"time": start.isoformat()} if start else {},
        notes=(*table.notes, *said, *lines),
    )
    even = record.uniform(table.place)
    unknown = np.full(even.samples, np.nan)
    return replace(even, P=unknown, Q=unknown)


def kind_of(path: str, *join: str) -> str:
    """The kind of the table in a file, or in those of one event: "powers", "phasors" or "waves";
    "powers" where it is ambiguous.
    """
    try:
        sidecar = read_sidecar(path)
        instrument = find_instrument(locate_file(path))
        if sidecar.recording is not None or (
            instrument and instrument.holds_waveforms(locate_file(path))
        ):
            return "waves"
        return map_columns(
            open_table(path, TableForm(join=join), whole=False), sidecar.columns, sidecar.units
        ).kind
    except UserError:
        return "powers"  # whose reader says what is wrong


def powers(
    table: TableFile, mapping: Mapped, nominal: float, reverse: bool, kilovolts: bool
) -> Powers:
    """What a table of powers or of phasors holds.

    `reverse` negates P and Q; `kilovolts` says that a voltage without a unit is in kV. Raises
    `UserError` for cells that are no numbers, and for ambiguous units.
    """
    if mapping.kind == "phasors":
        result = read_phasors(table, mapping, nominal)
    elif mapping.kind == "powers":
        result = read_powers(table, mapping, kilovolts)
    else:
        raise UserError(
            f"{table.source} holds waveforms"
            f" ({', '.join(c.label for c in mapping.columns.values())}), not powers; read it as"
            f" such: data=waveforms data.path={table.source}"
        )
    if reverse:
        result.columns["P"], result.columns["Q"] = -result.columns["P"], -result.columns["Q"]
    return _tune_nominal_frequency(result, nominal, mapping.columns.get("f"))


def _tune_nominal_frequency(result: Powers, declared: float, source: MappedColumn | None) -> Powers:
    """The powers with the nominal frequency [Hz] that f shows, else the declared one, and without
    an f that is none; a note on what was found.
    """
    if "f" not in result.columns or source is None:
        return replace(result, frequency=declared)
    columns = {**result.columns}
    U = result.columns["U"]
    f = (
        columns["f"]
        if source.role.unit.strip().lower() not in PER_UNIT
        else columns["f"] * declared
    )
    alive = LEAST_LIVE_VOLTAGE * np.nanmedian(U) < U
    level = float(np.nanmedian(f[alive])) if np.isfinite(f[alive]).any() else declared
    if level < SLOWEST:
        del columns["f"]
        note = (
            f"{source.label} is about {level:.3g}, a deviation from the nominal frequency or per"
            " unit of it: not used"
        )
        return replace(result, columns=columns, notes=(*result.notes, note), frequency=declared)
    columns["f"], nominal = f, find_nominal_frequency(level)
    if nominal is None or abs(nominal / declared - 1) < OTHER_FREQUENCY:
        return replace(result, columns=columns, frequency=declared)
    note = (
        f"f is {level:.5g} Hz: {nominal:.3g} Hz is taken for nominal, where {declared:g} Hz stands"
        " in the settings"
    )
    return replace(result, columns=columns, notes=(*result.notes, note), frequency=nominal)
