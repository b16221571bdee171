"""What a table holds, made of its columns: powers against time, or a recording of waveforms."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.recording.columns import PER_UNIT, factor
from tractexp.recording.mapping import LINES, PHASES, Chosen, Mapped, check_mapping, mapped
from tractexp.recording.recording import Channel, Recording, Segment
from tractexp.recording.table import Column, Form, Table, open_table

ROTATION = np.exp(2j * np.pi / 3)
HIGH = 1000.0  # the median of a voltage without a unit that can only be in V
GAP = 1.5  # usual steps: a longer one parts two segments
EPOCH = 1e6  # s: later times are counted from the first


@dataclass(frozen=True)
class Mapping_:
    """How a table is read, as the user says; what is left out is found."""

    columns: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    form: Form = Form()


@dataclass(frozen=True, eq=False)
class Powers:
    """Columns (N,) by the names of a record; `absolute` says of U and P whether they are in kV, MW (None: unsaid)."""

    columns: dict[str, np.ndarray]
    absolute: dict[str, bool | None]
    notes: tuple[str, ...]
    table: Table
