"""Records from tables: CSV and other text, Parquet, Excel."""

from dataclasses import field, replace
from pathlib import Path
from typing import Any

from tractexp.extend import (
    DATA,
    Base,
    Events,
    Reader,
    Record,
    UserError,
    check_range,
    plugin,
)
from tractexp.extend.files import (
    DECLARATION,
    ENDINGS,
    LOAD,
    PACKAGE,
    SIZES,
    FileDip,
    Powers,
    Sidecar,
    Tabular,
    check_joined,
    check_load,
    check_numbers,
    chosen,
    count_noun,
    cut_dips,
    estimator_of,
    event_paths,
    kind_of,
    level,
    powers,
    read_sidecar,
    signs,
)

PRE, POST = 1.0, 10.0  # s kept of a table that holds several dips


@plugin
class CSV(Tabular, Reader):
    """Tables of t, U, P, Q and, where recorded, f, U2 and U_angle: CSV and other text, Parquet,
    Excel, logs of instruments.

    A file named in `train` or `validate` is one record. With `path` the dips of one long table are
    numbered from 1 in order of time, and `train` and `validate` are numbers: the first is fitted
    and the others validate unless said otherwise. Names, units, delimiter, decimal mark and
    encoding are found and said in a note, or given (`columns`, `units`, ...); phasors (magnitudes
    and angles) become U, P, Q, U_angle, f, U2. U_angle [rad or deg] is the voltage's angle in a
    frame that turns at nominal frequency, wrapped or not: f is the frequency at which it turns
    between its jumps. Without units U, P, Q, U2 are per unit, or in kV (line to
    line), MW and Mvar where `base_voltage` [kV] and `base_power` [MVA] say what one per unit is;
    with units and no base, the base is the steady state before the first dip. A path
    `pkg://package/file.csv` reads a file inside an installed package. A file of the same name
    ending in .json beside the table may give its "name", a "note" on where it comes from, "base",
    "columns" and "units".

    Source: RFC 4180, with comment lines; the names t, U, P, Q, f, U2, U_angle are tractexp's own.
    Phasors: Fortescue 1918.
    Departures: any delimiter, title lines, unit rows.
    """

    endings = (*ENDINGS, ".pqd", ".pqdif", ".cev", ".cfg", ".cff", ".dat")

    path: str = ""  # one table with several dips, or a .zip that holds it
    # further tables of the same event, whose columns are put beside those of `path`
    join: list[str] = field(default_factory=list)
    train: list[Any] = field(default_factory=list)  # files to fit; with path, dips by number
    # files held out; with path, dips by number, null: every other one
    validate: list[Any] | None = None
    # s kept before a dip starts, at most; null: 1 where there are several dips, else all
    pre: float | None = None
    # s kept after a dip starts, at most; null: 10 where there are several dips, else all
    post: float | None = None
    base_voltage: float | None = None  # kV, line to line
    base_power: float | None = None  # MVA, three-phase
    frequency: float = 50.0  # Hz, nominal
    reverse_current: bool = False  # true where P and Q are counted positive out of the load
    # phasor estimator of the recorder: one_cycle, p_class, m_class; null: not known
    estimator: Any = None

    @classmethod
    def takes(cls, path: str, *join: str) -> bool:
        return kind_of(path, *join) != "waves"

    def check(self) -> None:
        if self.path:
            self._check_numbers()
            check_joined("data.join", [self.path, *self.join], self.endings)
        elif self.join:
            raise UserError(f"{DATA.join} goes with {DATA.path}: name the first file there")
        elif not self.train:
            raise UserError(
                f"{DATA.train} is empty: name at least one CSV file to fit, e.g."
                f" {DATA.train}=[dip.csv]"
            )
        files: set[str] = set()
        for path in [] if self.path else map(str, (*self.train, *(self.validate or []))):
            if path in files:
                raise UserError(
                    f"{DATA.train} and {DATA.validate} name '{path}' twice; a record may serve only"
                    " once"
                )
            files.add(path)
        limits = {
            "base_voltage": SIZES["voltage"],
            "base_power": SIZES["power"],
            "frequency": SIZES["frequency"],
        }
        for key, allowed in (limits | {"pre": (0.05,), "post": (0.1,)}).items():
            value = getattr(self, key)
            if value is not None:
                check_range(f"data.{key}", value, *allowed)
        self.check_table()

    def _check_numbers(self) -> None:
        for each in (*self.train, *(self.validate or [])):
            if not isinstance(each, int) or isinstance(each, bool):
                raise UserError(
                    f"{DATA.path}={self.path} is given, so {DATA.train} and {DATA.validate} are"
                    f" numbers of its dips, and '{each}' is none; leave {DATA.path} out to read"
                    " whole files"
                )
        check_numbers(self.train or None, self.validate)

    def read(self) -> Events:
        if self.path:  # the dips of one table: the whole of it where there is one
            whole, dips = self._dips()
            notes = (
                ()
                if dips and dips[0].result is whole
                else (*whole.notes, count_noun(len(dips), "dip"))
            )
            return chosen(self.path, dips, self.train or None, self.validate, notes)
        first = self._record(str(self.train[0]))
        rest = [
            self._record(str(path), first.base)
            for path in (*self.train[1:], *(self.validate or []))
        ]
        return Events([first, *rest[: len(self.train) - 1]], rest[len(self.train) - 1 :])

    def table(self) -> tuple[Record, list[FileDip]] | None:
        return self._dips() if self.path else None

    def read_voltage(self) -> Record | None:
        if not self.path:
            return None
        inside, *join = event_paths(self.path, self.join, self.endings)
        return self.record_voltage(self.path, inside, join, self.frequency)

    def _dips(self) -> tuple[Record, list[FileDip]]:
        whole = self._record(self.path)
        pre, post = (
            usual if given is None else given
            for given, usual in ((self.pre, PRE), (self.post, POST))
        )
        dips = cut_dips([replace(whole, notes=())], self.path, pre, post)
        if len(dips) < 2 and self.pre is None and self.post is None:
            spans = [(dip.start, dip.end) for dip in dips] or [
                (float(whole.t[0]), float(whole.t[-1]))
            ]
            return whole, [FileDip(1, *spans[0], whole)]
        return whole, dips

    def _record(self, path: str, base: Base | None = None) -> Record:
        """The whole of one table; `base` is that of the first one read, which all share."""
        inside, *join = event_paths(path, self.join if self.path else [], self.endings)
        sidecar = read_sidecar(inside)
        table, mapping = self.table_of(inside, sidecar, join)
        given = self.base_voltage or (sidecar.base and sidecar.base.voltage)
        declared = sidecar.base.frequency if sidecar.base else table.frequency or self.frequency
        quantities = powers(
            table, mapping, declared, self.reverse_current, kilovolts=given is not None
        )
        raw = self._raw_record(path, sidecar, quantities, table.numbers(sidecar.more))
        even = raw if sidecar.uniform else raw.uniform(table.place)
        base, note = self._choose_base(even, quantities, sidecar, base)
        voltage = _one_of(quantities.absolute["U"], base.voltage, given)
        power = _one_of(quantities.absolute["P"], base.power, self.base_power or sidecar.base)
        arrays: Any = Base(voltage, power).per_unit(even.channels)
        record = replace(even, base=base, notes=(*even.notes, *note), **arrays)
        record.check(table.place if record.samples == raw.samples else None)
        return replace(record, notes=(*record.notes, *signs(record)))

    def _raw_record(
        self, path: str, sidecar: Sidecar, quantities: Powers, more: dict[str, Any]
    ) -> Record:
        """A table as a record of what stands in it, at its own times and in its own units."""
        window = sidecar.window
        if window is None and self.estimator:
            window = estimator_of(self.estimator).window(quantities.frequency)
        arrays: Any = quantities.columns
        return Record(
            name=self._name(path, sidecar),
            source=path,
            notes=(*sidecar.notes, *quantities.notes),
            identity={"time": quantities.start.isoformat()} if quantities.start else {},
            base=Base(frequency=quantities.frequency),
            more=more,
            window=window,
            **arrays,
        )

    def _name(self, path: str, sidecar: Sidecar) -> str:
        stem = Path(path.removeprefix(PACKAGE)).stem
        stems = [
            Path(str(p).removeprefix(PACKAGE)).stem for p in (*self.train, *(self.validate or []))
        ]
        return sidecar.name or stem if self.path or stems.count(stem) == 1 else path

    def _choose_base(
        self, record: Record, quantities: Powers, sidecar: Sidecar, same: Base | None
    ) -> tuple[Base, list[str]]:
        """The base of per-unit values and notes on it: the base given, else the previous record's,
        else (of values in kV and MW) the steady state.

        `absolute` of a quantity is None where no unit is told.
        """
        earlier = sidecar.base or same
        voltage = self.base_voltage or (earlier and earlier.voltage)
        power = self.base_power or (earlier and earlier.power)
        absolute_U = quantities.absolute["U"]
        absolute_P = quantities.absolute["P"]
        if voltage is None and power is None and absolute_U and absolute_P is None:
            raise UserError(
                f"{record.where}: U is in kV, and the unit of P and Q is not told; say"
                f" {DATA.units}={{P: MW, Q: Mvar}} or {DATA.units}={{P: pu, Q: pu}}, or the base,"
                f" {DATA.base_voltage} and {DATA.base_power}"
            )
        chosen_by = None if self.base_power else earlier
        origin = chosen_by.origin if chosen_by else DECLARATION
        sources = []
        lacks_voltage = voltage is None and absolute_U
        lacks_power = power is None and absolute_P
        U = S = 0.0
        if lacks_voltage or lacks_power:
            U, S = _measure_level(record, bool(absolute_U), bool(absolute_P))
        if lacks_voltage:
            voltage = U
            sources.append(f"{U:.4g} kV line to line")
        if lacks_power:
            power = S
            origin = LOAD
            sources.append(f"{S:.4g} MVA")
        base = Base(voltage or 1.0, power or 1.0, quantities.frequency, origin)
        if not sources:
            return base, []
        return base, [f"base: {' and '.join(sources)}, the steady state before the first dip"]


def _one_of(absolute: bool | None, size: float, given: Any) -> float:
    """The size of one per unit [kV, MVA] that a table's values are divided by: where they are
    absolute, or have no unit and the user has `given` that size; else 1.
    """
    return size if absolute or (absolute is None and given) else 1.0


def _measure_level(record: Record, absolute_U: bool, absolute_P: bool) -> tuple[float, float]:
    """Voltage [kV] and apparent power [MVA] before the first dip. Raises `UserError` for a record
    without power there, or of a voltage that no load has.
    """
    U, S = level(record)
    if S < 1e-9:
        raise UserError(
            f"{record.where}: P and Q are zero or missing before the first dip, so they give no"
            f" base; say it: {DATA.base_power} (MVA)"
        )
    if absolute_U:
        check_load(record.where, U, S if absolute_P else 0.0)
    return U, S
