"""Records from CSV files: one event per file."""

import importlib.resources
import io
import json
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, check_range, nearest
from tractexp.plugin import plugin
from tractexp.record import Base, Events, Reader, Record

REQUIRED = ("t", "U", "P", "Q")
OPTIONAL = ("f", "U2")
PACKAGE = "pkg://"


@plugin
class CSV(Reader):
    """CSV files with a header line naming the columns t, U, P, Q and, where recorded, f and U2.

    Any order; further columns are left out with a note; lines starting with # are comments; cells are separated
    by comma, semicolon or tab, decimals by a point. t in s, f in Hz; U, P, Q, U2 per unit, or in kV (line to
    line), MW and Mvar where `base_voltage` [kV] and `base_power` [MVA] say what one per unit is. A path
    `pkg://package/file.csv` reads a file inside an installed package. A file of the same name ending in .json
    beside the CSV may give its "name" and a "note" on where it comes from.

    Source: RFC 4180, with comment lines; the columns are tractexp's own.
    Departures: quoted cells are not read.
    """

    endings = (".csv", ".txt", ".tsv")

    train: list[str] = field(default_factory=list)  # files to fit
    validate: list[str] = field(default_factory=list)  # files held out
    base_voltage: float | None = None  # kV, line to line
    base_power: float | None = None  # MVA, three-phase
    frequency: float = 50.0  # Hz, nominal

    @staticmethod
    def of(path: str) -> dict[str, Any]:
        return {"train": [path]}

    def check(self) -> None:
        if not self.train:
            raise UserError("data.train is empty: name at least one CSV file to fit, e.g. data.train=[dip.csv]")
        seen: set[str] = set()
        for path in (*self.train, *self.validate):
            if path in seen:
                raise UserError(f"data.train and data.validate name '{path}' twice; a record may serve only once")
            seen.add(path)
        for key in ("base_voltage", "base_power", "frequency"):
            value = getattr(self, key)
            if value is not None:
                check_range(f"data.{key}", value, 1e-6)

    def read(self) -> Events:
        return Events([self._record(path) for path in self.train], [self._record(path) for path in self.validate])

    def _record(self, path: str) -> Record:
        text, beside = load(path)
        table, spare = parse(text, path)
        base = Base(self.base_voltage or 1.0, self.base_power or 1.0, self.frequency)
        stem = Path(path.removeprefix(PACKAGE)).stem
        stems = [Path(p.removeprefix(PACKAGE)).stem for p in (*self.train, *self.validate)]
        notes = [beside["note"]] if "note" in beside else []
        if spare:
            notes.append(f"columns not used: {', '.join(spare)}")
        record = Record(
            name=str(beside.get("name", stem)) if stems.count(stem) == 1 else path,
            base=base,
            source=path,
            notes=tuple(notes),
            **base.per_unit(table),
        )

        def place(i: int) -> str:
            return f"line {line_of(text, i)}"

        return record.uniform(place).check(place)


def load(path: str) -> tuple[str, dict[str, Any]]:
    """The text of a CSV file and what its sidecar says, {} without one."""
    if path.startswith(PACKAGE):
        package, _, name = path.removeprefix(PACKAGE).partition("/")
        try:
            folder: Any = importlib.resources.files(package)
        except (ImportError, ValueError) as error:
            raise UserError(f"{path}: there is no installed package '{package}'") from error
    else:
        folder, name = Path(path).parent, Path(path).name
    file = folder / name
    if not file.is_file():
        found = [item.name for item in folder.iterdir()] if folder.is_dir() else None
        hint = "; that folder does not exist" if found is None else nearest(name, found)
        raise UserError(f"{path}: there is no such file in {str(folder) if found is not None else folder}{hint}")
    sidecar = folder / (Path(name).stem + ".json")
    try:
        text = file.read_bytes().decode("utf-8-sig")
        beside = json.loads(sidecar.read_bytes()) if sidecar.is_file() else {}
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: byte {error.start + 1} is not UTF-8 text; save the file as UTF-8 CSV") from error
    except json.JSONDecodeError as error:
        raise UserError(f"{sidecar}: line {error.lineno}: not valid JSON ({error.msg})") from error
    return text, beside if isinstance(beside, dict) else {}


def parse(text: str, path: str) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns wanted, each (N,), and the names of those left over."""
    lines = io.StringIO(text)
    header = next((line.partition("#")[0] for line in lines if _is_data(line)), "")
    if not header:
        raise UserError(f"{path}: the file is empty; it must start with a line naming the columns t,U,P,Q")
    mark = next((m for m in (";", "\t") if m in header), ",")
    names = [cell.strip().strip('"') for cell in header.split(mark)]
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        lacks = ", ".join(missing)
        raise UserError(
            f"{path}: column {lacks} is missing; the header line must name {', '.join(REQUIRED)} and names "
            f"{', '.join(names)}{nearest(missing[0], names)}"
        )
    wanted = [name for name in (*REQUIRED, *OPTIONAL) if name in names]
    twice = [name for name in wanted if names.count(name) > 1]
    if twice:
        raise UserError(f"{path}: column {twice[0]} occurs {names.count(twice[0])} times; keep one")
    columns = [names.index(name) for name in wanted]
    rest = lines.read()
    try:
        if not rest.strip():
            raise ValueError("no rows")
        values = np.loadtxt(io.StringIO(rest), delimiter=mark, usecols=columns, comments="#", ndmin=2)
    except ValueError as error:
        raise UserError(f"{path}: {_wrong_cell(text, mark, names, columns) or error}") from error
    table = {name: values[:, i].copy() for i, name in enumerate(wanted)}
    return table, [name for name in names if name and name not in wanted]


def line_of(text: str, row: int) -> int:
    """The line, from 1, of a data row, from 0."""
    numbers = (i for i, line in enumerate(io.StringIO(text), 1) if _is_data(line))
    return next(number for i, number in enumerate(numbers) if i == row + 1)


def _is_data(line: str) -> bool:
    """Whether a line holds more than blanks and a comment."""
    return bool(line.partition("#")[0].strip())


def _wrong_cell(text: str, mark: str, names: list[str], columns: list[int]) -> str:
    """A sentence on the first cell that is no number, found by reading line by line."""
    rows = [(i, line) for i, line in enumerate(io.StringIO(text), 1) if _is_data(line)][1:]
    if not rows:
        return "there are no rows below the header line"
    for number, line in rows:
        cells = [cell.strip() for cell in line.partition("#")[0].split(mark)]
        for column in sorted(columns):
            where = f"line {number}, column {names[column]}"
            if column >= len(cells) or not cells[column]:
                return f"{where}: the cell is empty; a gap in P or Q is written nan"
            try:
                float(cells[column])
            except ValueError:
                comma = " (decimals are written with a point)" if "," in cells[column] else ""
                return f"{where}: '{cells[column]}' is not a number{comma}"
    return ""
