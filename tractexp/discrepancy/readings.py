"""What a shape that is left may be physically, and what would decide it: a table with its sources.

A reading names no effect of the catalogue: those were tested and do not explain. It says where the
like comes from, which channel, event or setting of the recorder tells it apart, and by which
command one gets there.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from tractexp.configuration.run_command import suggest_run
from tractexp.discrepancy.remainder import Remainder
from tractexp.record import Event
from tractexp.record.identity import Identity
from tractexp.record.wave_event import WaveEvent, has_fine_samples
from tractexp.storage import files
from tractexp.text import quoting

POWERS = ("P", "Q")  # channels of phasors; those of waveforms are currents
SAME_FREQUENCY = 0.12  # of a frequency: so far off it counts as that
SAME_RING = 0.1  # of a frequency: shapes of two events that close ring alike
SLOW = 0.1  # s, from which on a decay is one of the load rather than of a field
LOOK, WAVES = "look", "waves"


@dataclass(frozen=True)
class Rule:
    """A row of the table: the kind of shape, its frequency over the supply's (lowest, highest), its
    time constant [s], whether it is in power or in currents, and what that says.
    """

    kind: str
    means: str
    source: str
    decides: str
    command: str
    frequency: tuple[float, float] = (0.0, inf)
    time_constant: tuple[float, float] = (0.0, inf)
    in_power: bool | None = None  # None: in either

    def holds(self, shape: Remainder, supply: float) -> bool:
        """Whether a shape of a record with this supply frequency [Hz] is so."""
        relative = (shape.frequency or 0.0) / supply
        tau = inf if shape.time_constant is None else shape.time_constant
        return (
            shape.kind == self.kind
            and self.in_power in (None, shape.channel in POWERS)
            and self.frequency[0] <= relative <= self.frequency[1]
            and self.time_constant[0] <= tau <= self.time_constant[1]
        )


def _about(multiple: float) -> tuple[float, float]:
    return multiple * (1 - SAME_FREQUENCY), multiple * (1 + SAME_FREQUENCY)


RULES = (
    Rule(
        "ringing",
        "a direct component of flux or current, which power shows at the supply frequency: the"
        " stator's own transient, an offset of the source or of a current transformer",
        "Kundur 1994, Power System Stability and Control, stator transients",
        "the sampled currents: a direct part that decays is in the load, one in a single phase is"
        " in its transformer",
        WAVES,
        frequency=_about(1),
        in_power=True,
    ),
    Rule(
        "ringing",
        "a voltage or load that is not balanced: its negative sequence makes power swing at twice"
        " the supply frequency",
        "Akagi, Watanabe and Aredes 2007, Instantaneous Power Theory",
        "the three phases, or a channel of the negative sequence (U2)",
        WAVES,
        frequency=_about(2),
        in_power=True,
    ),
    Rule(
        "ringing",
        "harmonics, of a core that saturates or of a converter",
        "Arrillaga and Watson 2003, Power System Harmonics, 2nd ed.",
        "the spectra of the phase currents before, in and after the dip",
        LOOK,
        frequency=(2.5, inf),
    ),
    Rule(
        "decay",
        "a direct current: the flux of a transformer's core, of the load or of the instrument",
        "IEC 61869-2, transient performance of current transformers",
        "the same current by another core or recorder: an offset of the instrument is not in it",
        LOOK,
        in_power=False,
    ),
    Rule(
        "step",
        "a part of the load that trips or comes back, at a level of the voltage or by a timer",
        "IEEE Task Force 1993, IEEE Trans. Power Systems 8(2) 472",
        "a dip of another depth: a level acts at the same voltage, a timer after the same time; and"
        " the status channels",
        LOOK,
    ),
    Rule(
        "pulse",
        "the instant of switching, or a sample that the recorder lost",
        "IEEE C37.111, time stamps and status channels",
        "the status channels, and the recorder's rate and clock",
        LOOK,
    ),
    Rule(
        "decay",
        "a transient faster than the model has: a field of the machine, the capacitor of a"
        " converter",
        "Kundur 1994, Power System Stability and Control, stator transients",
        "the sampled currents: phasors average over a cycle",
        WAVES,
        time_constant=(0.0, SLOW),
    ),
    Rule(
        "decay",
        "a slow recovery: thermostats, tap changers, drives that run up again",
        "Karlsson and Hill 1994, IEEE Trans. Power Systems 9(1) 157",
        "a record that goes on for several of these time constants",
        LOOK,
        time_constant=(SLOW, inf),
    ),
    Rule(
        "ringing",
        "a control loop of the load, or the network beside it",
        "Arrillaga and Watson 2003, Power System Harmonics, 2nd ed., resonances",
        "the other loads of the bus, and another event: a ring of the network is in all of them",
        LOOK,
    ),
)
IN_COMMON = (
    "a ring that two events have in common: the network, or a loop that any dip sets going; no"
    " function of the voltage"
)


@dataclass(frozen=True)
class ShapeReading:
    """What is left, what it may be, who says so, what would decide it, and the command."""

    shape: str
    means: str
    source: str
    decides: str
    command: str

    @property
    def sentence(self) -> str:
        """What to do about it."""
        return f"{self.shape} may be {self.means}; to decide, look at {self.decides}"


def read_shapes(shapes: Sequence[Remainder], event: Event) -> list[ShapeReading]:
    """A reading of each shape, the loudest first; `event` is the first that was fitted, whose file
    is looked at.
    """
    supply = event.record.base.frequency
    commands = _list_commands(event)
    return [
        reading
        for shape in shapes
        for reading in _read_shape(shape, list(shapes), supply, commands)
    ]


def _read_shape(
    shape: Remainder, shapes: Sequence[Remainder], supply: float, commands: Mapping[str, str]
) -> Iterator[ShapeReading]:
    rule = next((rule for rule in RULES if rule.holds(shape, supply)), None)
    if rule is None:
        return
    means = rule.means
    if any(_rings_alike(shape, other) for other in shapes):
        means = f"{IN_COMMON}; else {means}"
    yield ShapeReading(_name(shape), means, rule.source, rule.decides, commands[rule.command])


def _rings_alike(one: Remainder, other: Remainder) -> bool:
    """Whether shapes of two events ring at the same frequency."""
    if one.event == other.event or not (one.frequency and other.frequency):
        return False
    return abs(one.frequency - other.frequency) <= SAME_RING * one.frequency


def _name(shape: Remainder) -> str:
    """A shape in short."""
    at = f" at {shape.frequency:.3g} Hz" if shape.frequency else ""
    lasts = f" of {1000 * shape.time_constant:.3g} ms" if shape.time_constant else ""
    return f"the {shape.kind} of {shape.channel}{at}{lasts}"


def _list_commands(event: Event) -> dict[str, str]:
    """The commands by which one gets to what decides, of which each can be carried out.

    A record without samples is looked at, and of arrays that came from no file the next event is
    planned.
    """
    record = event.record
    file = Identity.from_record(record).recording.source["file"]
    if record.is_shipped or files.exists(file):
        seen = quoting.shell("tractexp", "look", file, "--all")
    else:
        waves = ["domain=waves"] if isinstance(event, WaveEvent) else []
        seen = suggest_run("task=plan", *waves, of=("data",))
    if not has_fine_samples(record):
        return {LOOK: seen, WAVES: seen}
    in_waves = suggest_run("task=discrepancy", "domain=waves", of=("data", "task"))
    return {LOOK: seen, WAVES: in_waves}
