"""What a call of a kernel needs beside its arrays, told in the kernel's text."""

import json
from dataclasses import dataclass

PREFIX = "; room "


@dataclass(frozen=True)
class Room:
    """Lanes of a vector, and numbers: of each candidate, of each event, and what the work space holds."""

    width: int  # lanes of a vector
    given: int  # of each candidate: its parameters, then P0 and Q0
    event: int  # of each event
    outputs: int
    starts: int  # states and memories before the event
    rows: int  # of each group of lanes
    points: int  # at each point in time that a step looks at
    signals: int  # at each sample

    @classmethod
    def of(cls, text: str) -> "Room":
        """As a kernel's text tells it."""
        line = text.split("\n", 2)[1]
        return cls(**json.loads(line.removeprefix(PREFIX)))
