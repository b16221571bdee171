"""COMTRADE records of values and not of waveforms: a swing recorder's U, P, Q and f, a PMU's
phasors, as a table.
"""

import itertools
from pathlib import Path

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.filetypes.column_unit import find_unit_quantity, split_unit
from tractexp.filetypes.columns import find_role
from tractexp.filetypes.comtrade_lines import Header
from tractexp.filetypes.table import Rows
from tractexp.recording.recording import FEWEST_PER_CYCLE, Channel

ENDINGS = (".cfg", ".cff", ".dat")


def recognizes(path: Path | str) -> bool:
    """Whether a file is called as a COMTRADE record is."""
    return Path(path).suffix.lower() in ENDINGS


def holds_waveforms(path: Path, encoding: str | None = None) -> bool:
    """Whether the samples are waveforms: all but powers, or phasors, sampled more slowly than
    waveforms are.

    Powers without a current beside them are values however fast they come. A record that cannot be
    read counts as waveforms, whose reader says what is wrong.
    """
    try:
        header = comtrade.read_header(path, encoding)
    except UserError:
        return True
    quantities, keys = _read_meanings(header)
    powers = {"power", "reactive"} <= quantities or {"P", "Q"} <= {key[0] for key in keys}
    if powers and "current" not in quantities:
        return False
    phasors = {"U", "I"} <= {key[0] for key in keys if key.endswith("_angle")}
    fast = max(header.rates)[0] >= FEWEST_PER_CYCLE * header.frequency
    return fast or not (powers or phasors)


def _read_meanings(header: Header) -> tuple[set[str], set[str]]:
    """(the quantities that the channels' units say, the keys that their names and units say)."""
    parted = [(*split_unit(one.name.strip()), one.unit) for one in header.analogs]
    columns = [(name, unit or inside) for name, inside, unit in parted]
    roles = itertools.starmap(find_role, columns)
    return {find_unit_quantity(unit) for _, unit in columns}, {one.key for one in roles if one}


def table(path: Path, encoding: str | None = None) -> Rows:
    """Read a COMTRADE record of values, not of waveforms, as a table.

    Parameters
    ----------
    path : Path
        Of the .cfg, .dat or .cff file.
    encoding : str or None
        Of the configuration; None: guessed from its letters.

    Returns
    -------
    Rows
        The channels as columns, on the primary side, in their units; the longest stretch of one
        rate.

    Raises
    ------
    UserError
        As `comtrade.load`.
    """
    recording = comtrade.load(path, encoding)
    segment = max(recording.segments, key=lambda one: one.stop - one.first)
    part = slice(segment.first, segment.stop)
    names = [channel.name.strip() for channel in recording.channels]
    columns = [("t", "s", segment.t)]
    for name, channel in zip(names, recording.channels, strict=True):
        columns.append(
            (
                *_build_heading(name, channel, names.count(name) > 1),
                channel.ratio * channel.read_values()[part],
            )
        )
    notes = list(recording.notes)
    if len(recording.segments) > 1:
        notes.append(
            f"{len(recording.segments)} stretches of samples: the longest is read, {segment.rate:g}"
            f" Hz from {segment.start:.3f} s"
        )
    rows = Rows.from_columns(
        path, [(name, unit, np.asarray(v, float)) for name, unit, v in columns], 1, tuple(notes)
    )
    rows.start, rows.frequency = recording.start, recording.frequency
    return rows


def _build_heading(name: str, channel: Channel, repeated: bool) -> tuple[str, str]:
    """(name of a column, with what it is measured on where others have the same name; unit)."""
    bare, unit = split_unit(name)
    where = " ".join(filter(None, (channel.circuit.strip(), channel.phase.strip())))
    return (f"{where} {bare}".strip() if repeated else bare or name), channel.unit.strip() or unit
