"""What a table holds, powers, phasors or waveforms, by the keys that its columns could be."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tractexp.errors import UserError
from tractexp.filetypes.column_key import (
    LINES,
    PHASES,
    has_quantity,
    list_quantity_keys,
    list_single_phases,
)
from tractexp.filetypes.column_options import MappedColumn
from tractexp.filetypes.missing_column import describe_missing_columns, read_sample_numbers
from tractexp.filetypes.table import TableFile


def find_kind(
    table: TableFile, options: Mapping[str, Any], chosen: Iterable[str]
) -> tuple[str, list[str]]:
    """The kind of a table, and the keys that make it up, t first; raises `UserError` for what is no
    such table.
    """
    kinds = _find_kinds(table, options)
    times = [key for key in ("t", "frac") if key in options]
    for kind, keys in kinds.items():
        if "t" not in options or not {*chosen} <= {"t", "frac", *keys}:
            continue
        if kind == "waves" and not _does_oscillate(table, options, keys):
            named = ", ".join(options[key][0].label for key in keys)
            raise UserError(
                f"{table.source}: the columns {named} hold magnitudes without angles, and there are"
                " none of P and Q: the load's power does not follow from them; add P and Q, or the"
                " angles"
            )
        return kind, [*times, *keys]
    raise UserError(describe_missing_columns(table, options, kinds))


def _find_kinds(table: TableFile, options: Mapping[str, Any]) -> dict[str, list[str]]:
    """{kind that a table may be: the keys that make it up}, the likeliest first.

    Columns of one quantity alone, and columns beside powers, are waveforms only where they
    oscillate.
    """
    wave = _list_waveforms(options)
    powers = _list_powers(options)
    swings = _does_oscillate(table, options, wave)
    if len({key[0] for key in wave}) == 1 and not swings:
        wave = []
    kinds = {"phasors": _list_phasors(options), "waves": wave, "powers": powers}
    if powers:
        kinds["powers"] = [*powers, *_find_telling_current(table, options, powers)]
        if not (swings and has_quantity(options, "P")):
            kinds = {"powers": kinds["powers"], "phasors": kinds["phasors"]}
    return {kind: keys for kind, keys in kinds.items() if keys}


def _list_powers(options: Mapping[str, Any]) -> list[str]:
    """The keys of U, P and Q, and of what stands beside them; [] where one is missing."""
    U = list_quantity_keys(options, "U", ("U", "U1")) or list_single_phases(options, "U")
    P = list_quantity_keys(options, "P", ("P",))
    Q = list_quantity_keys(options, "Q", ("Q",))
    if not (U and P and Q):
        return []
    angle = [key for key in ("U_angle", "U1_angle") if key in options][:1]
    return [*U, *P, *Q, *(key for key in ("f", "U2") if key in options), *angle]


def _find_telling_current(
    table: TableFile, options: Mapping[str, list[MappedColumn]], powers: Sequence[str]
) -> list[str]:
    """The key of a current [kA] beside powers, which tells whether a voltage whose name does not is
    line to line; [] where there is none, or no need.
    """
    voltage = options[powers[0]][0]
    keys = [key for key in ("I", "Ia", "Ib", "Ic", "I1") if key in options]
    told = voltage.role.line is not None or voltage.name == voltage.role.key == "U"
    if told or not voltage.role.unit or not keys or len(options[keys[0]]) > 1:
        return []
    current = options[keys[0]][0]
    known = len(read_sample_numbers(table, current.number)) == len(table.sample)
    return [keys[0]] if current.role.unit and known else []


def _list_phasors(options: Mapping[str, Any]) -> list[str]:
    """Magnitudes and angles of voltages and currents, and f; [] where those of one are missing."""
    voltages = _list_phasor_keys(options, "U")
    currents = _list_phasor_keys(options, "I")
    if not (voltages and currents):
        return []
    return [*voltages, *currents, *(key for key in ("f",) if key in options)]


def _list_phasor_keys(options: Mapping[str, Any], letter: str) -> list[str]:
    """Magnitudes and angles of one quantity: of three phases where they are there, else of the
    positive sequence, else of two phases (of U two lines), which say the third. [] for none.
    """
    pairs = itertools.combinations(LINES if letter == "U" else PHASES, 2)
    for ends in (PHASES, LINES, ("1",), ("",), *pairs):
        keys = [key for end in ends for key in (letter + end, f"{letter}{end}_angle")]
        if options.keys() >= {*keys}:
            return keys
    return []


def _list_waveforms(options: Mapping[str, Any]) -> list[str]:
    """Voltages and currents that may be waveforms: both, or those of one kind where no power stands
    beside them.
    """
    U, I = (
        list_quantity_keys(options, letter, ()) or _find_single_phase(options, letter)
        for letter in "UI"
    )
    one_kind = (
        len(U or I) == 3 and not has_quantity(options, "P") and not has_quantity(options, "Q")
    )
    return [*U, *I] if (U and I) or one_kind else []


def _find_single_phase(options: Mapping[str, Any], letter: str) -> list[str]:
    """The key of the one column there is of a quantity; [] where there is none."""
    return [key for key in (letter, f"{letter}a", f"{letter}1") if key in options][:1]


def _does_oscillate(
    table: TableFile, options: Mapping[str, list[MappedColumn]], keys: Sequence[str]
) -> bool:
    """Whether a voltage among the columns takes both signs, as a waveform does and a magnitude does
    not.

    Where there is no voltage, whether a current does.
    """
    ours = [key for key in keys if key[0] == "U"] or keys
    samples = [read_sample_numbers(table, options[key][0].number) for key in ours]
    return any(min(values, default=0.0) < 0 < max(values, default=0.0) for values in samples)
