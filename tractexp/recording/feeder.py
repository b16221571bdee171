"""Which channels show one load, and how they are connected."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Feeder:
    """One load's channels, numbers from 0, in the order that their connection takes them."""

    voltages: tuple[int, ...]
    currents: tuple[int, ...]
    connection: str = "three_phase"  # name of the plugin that makes phase quantities of them
    reverse_current: bool = False  # the recorder counts current out of the load as positive
    name: str = ""
    why: tuple[str, ...] = ()  # what it was recognised by, and what was changed in the order given, one sentence each
