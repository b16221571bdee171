"""A COMTRADE configuration: the header, its channels, and the lines that are still to be read."""

from collections import deque
from dataclasses import dataclass, field
from datetime import datetime

from tractexp.errors import UserError
from tractexp.filetypes.remarks import Remarks


@dataclass(frozen=True)
class Analog:
    """An analog channel's line."""

    name: str
    phase: str
    circuit: str
    unit: str
    gain: float
    offset: float
    skew: float  # microseconds
    limits: tuple[float, float] | None
    primary: float = 1.0
    secondary: float = 1.0
    side: str = ""  # P, S, or "" where the file does not say (1991)

    @property
    def ratio(self) -> float:
        """From the values recorded to primary ones."""
        return self.primary / self.secondary if self.side == "S" else 1.0


@dataclass(frozen=True)
class Digital:
    """A status channel's line."""

    name: str
    phase: str
    circuit: str
    normal: int


@dataclass
class Header:
    """All that the configuration says."""

    station: str = ""
    device: str = ""
    revision: int = 1991
    analogs: list[Analog] = field(default_factory=list)
    digitals: list[Digital] = field(default_factory=list)
    frequency: float = 50.0
    # (Hz, last sample from 1); 0 Hz: see the time stamps
    rates: list[tuple[float, int]] = field(default_factory=list)
    dates: tuple[str, str] = ("", "")  # of the first sample and the trigger, as written
    start: datetime | None = None
    trigger: float | None = None  # s since the first sample
    kind: str = "ASCII"
    timemult: float = 1.0
    time_code: str = ""  # lines of 2013, as written
    quality: str = ""
    lines: dict[str, int] = field(default_factory=dict)  # where things stand, for messages

    @property
    def samples(self) -> int:
        """How many samples the file holds, by its last rate."""
        return self.rates[-1][1]


class Lines:
    """The remaining lines, with their numbers."""

    def __init__(self, where: str, lines: list[str], remarks: Remarks, first: int) -> None:
        """The lines of a configuration, numbered from `first`; blank ones are passed over with a
        remark.
        """
        self.where, self.remarks = where, remarks
        lines = lines[: max((n for n, line in enumerate(lines, 1) if line), default=0)]
        self.rest = deque((n, line) for n, line in enumerate(lines, first) if line)
        self.last = first + len(lines) - 1
        for n, line in enumerate(lines, first):
            if not line:
                remarks.add("a blank line is passed over", n)

    def take(self, what: str) -> tuple[int, str]:
        """The next line with its number. Raises `UserError` with `what` was to come where there is
        none.
        """
        if not self.rest:
            raise UserError(
                f"{self.where}: ends after line {self.last}, before {what}; the file is cut short"
            )
        return self.rest.popleft()

    def peek(self) -> str:
        """The next line without taking it; "" at the end."""
        return self.rest[0][1] if self.rest else ""

    def refuse(self, line: int, words: str) -> UserError:
        """The error that a line is."""
        return UserError(f"{self.where}: line {line}: {words}")
