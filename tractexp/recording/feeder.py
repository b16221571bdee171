"""One load's channels, and how they are connected."""

from dataclasses import dataclass
from typing import Any

from tractexp.recording.connection import choose_usual_connection


@dataclass(frozen=True)
class Feeder:
    """One load's channels, numbers from 0, in the order that their connection takes them."""

    voltages: tuple[int, ...]
    currents: tuple[int, ...]
    connection: Any  # the plugin that makes phase quantities of them: a name, or name and settings
    reverse_current: bool = False  # the recorder counts current out of the load as positive
    name: str = ""
    # the evidence for it, and what was changed in the order, one sentence each
    why: tuple[str, ...] = ()
    loaded: bool = True
    question: str = ""  # where other voltages may as well be its own: which there are, one sentence

    @property
    def channels(self) -> dict[str, tuple[int, ...]]:
        """Numbers of its channels by the letter of their quantity."""
        return {"U": self.voltages, "I": self.currents}

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of a reader that reads this load."""
        result: dict[str, Any] = {"voltages": list(self.voltages), "currents": list(self.currents)}
        counts = len(self.voltages), len(self.currents)
        if self.connection != choose_usual_connection(*counts, lines=counts[0] == 2):
            result["connection"] = self.connection
        return result | ({"reverse_current": True} if self.reverse_current else {})
