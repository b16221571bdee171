"""The effects that could be missing: which of them this data can show, and how each is scanned."""

import functools
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.configuration.plugin import discover, find, get
from tractexp.errors import TASK, UserError, list_allowed
from tractexp.model.model import Model
from tractexp.model.parts import COMPARED, Effect, Measurement
from tractexp.parameter import Parameter
from tractexp.record import Event

MOST_SETTINGS = 16  # combinations of an effect's scanned parameters

# Change of the frequency [Hz] below which effects of it cannot be tested: a thousandth of nominal,
# by which a load of exponent 2 moves by 0.2 % of its power.
LEAST_SWING = 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect that may be missing in a model.

    Attributes
    ----------
    name : str
        That of the effect.
    effect : Effect
        Its equations.
    sizes : tuple of Parameter
        Its parameters with a null: the value at which the effect vanishes.
    settings : tuple of {name: value}
        The values that are scanned of its other parameters, such as thresholds and times, in their
        own units.
    """

    name: str
    effect: Effect
    sizes: tuple[Parameter, ...]  # the parameters that have a null
    settings: tuple[dict[str, float], ...]

    @property
    def measurement(self) -> bool:
        """Whether it is a fault of the measurement, not an effect of the load."""
        return isinstance(self.effect, Measurement)

    def sign(self, parameter: Parameter) -> int:
        """+1 or -1 where the null lies on a bound, 0 where the parameter may go both ways."""
        low, high = parameter.bounds
        return int(parameter.null == low) - int(parameter.null == high)

    def relevant(self, parameter: Parameter) -> float:
        """The smallest departure from the null that matters, in the parameter's unit."""
        low, high = parameter.bounds
        return float(self.effect.relevant.get(parameter.name, 0.1 * (high - low)))

    def compute_sized_value(self, parameter: Parameter, size: float, least: float) -> float:
        """The value of one of `sizes` at some distance from its null.

        Parameters
        ----------
        parameter : Parameter
            One of `sizes`.
        size : float
            Distance from the null, in the parameter's unit. Where the null lies on a bound its sign
            does not count: the value lies inside the box.
        least : float
            The least distance, in relevant sizes.

        Returns
        -------
        float
            Cut to the parameter's bounds.
        """
        sign = self.sign(parameter) or np.sign(size) or 1.0
        moved = sign * max(sign * size, least * self.relevant(parameter))
        return float(np.clip(parameter.absent + moved, *parameter.bounds))


@dataclass(frozen=True, eq=False)
class Catalogue:
    """All effects that can be tested on some records, and why the others cannot.

    Attributes
    ----------
    candidates : tuple of Candidate
        The textbook effects and the faults of the measurement.
    untestable : {name: sentence}
        Why the records or the model do not allow an effect.
    members : tuple of Candidate
        Effects of the candidates' families with another place or another law; they are tried beside
        the best textbook effect.
    """

    candidates: tuple[Candidate, ...]
    untestable: dict[str, str]
    members: tuple[Candidate, ...] = ()

    def __getitem__(self, name: str) -> Candidate:
        """The candidate of that name, an effect of the catalogue or another member of a family."""
        return self._candidates_by_name[name]

    @functools.cached_property
    def _candidates_by_name(self) -> dict[str, Candidate]:
        """{name: candidate} of the catalogue's effects and of all members of their families."""
        return {c.name: c for c in (*self.candidates, *self.members)}

    def parameters(self, names: Sequence[str]) -> list[Parameter]:
        """All parameters of the named effects."""
        return [p for name in names for p in self[name].effect.parameters]

    def sizes(self, names: Sequence[str]) -> list[Parameter]:
        """The parameters of the named effects that have a null."""
        return [p for name in names for p in self[name].sizes]

    def family(self, name: str) -> str:
        """The name of the textbook effect whose family an effect belongs to; its own where it is
        one.
        """
        return self[name].effect.family or name

    def textbook(self, names: Sequence[str]) -> tuple[str, ...]:
        """The names of the textbook effects whose families these effects belong to."""
        return tuple(self.family(name) for name in names)

    def list_channels(self, names: Iterable[str]) -> set[str]:
        """The channels beside the voltage that effects read."""
        return {channel for name in names for channel in self[name].effect.reads}

    def label_effect(self, name: str) -> str:
        """The name of the textbook effect, followed by what differs from it in place or law."""
        differs = self[name].effect.differs
        if not differs:
            return name
        comma = "," if differs.startswith("but") else ""
        return f"{self.family(name)}{comma} {differs}"

    @functools.cached_property
    def effects(self) -> list[Effect]:
        """The effects that can be tested on these records, in the catalogue's order."""
        return [c.effect for c in self.candidates]

    @functools.cached_property
    def of_load(self) -> tuple[str, ...]:
        """Names of the effects of the load itself."""
        return tuple(c.name for c in self.candidates if not c.measurement)

    @functools.cached_property
    def of_measurement(self) -> tuple[str, ...]:
        """Names of the faults of the measurement."""
        return tuple(c.name for c in self.candidates if c.measurement)


NOTHING = Catalogue((), {})  # of a model that is fitted as it is


def build_catalogue(model: Model, events: Sequence[Event], only: Sequence[str] = ()) -> Catalogue:
    """The registered effects that a model lacks.

    Parameters
    ----------
    model : Model
        The base model; its own effects are left out.
    events : sequence of Event
        The records, whose channels decide which effects can be seen.
    only : names
        Restricts the load's effects to these and their families; none: all. Faults of the
        measurement always stay.

    Returns
    -------
    Catalogue

    Raises
    ------
    UserError
        For a name in `only` that no effect has.
    """
    registered = discover().get("effect", {})
    for name in only:
        if find("effect", name) is None:
            raise UserError(
                f"{TASK.effects} names '{name}', which is no effect{list_allowed(name, registered)}"
            )
    here = {effect.name for effect in model.effects}
    testable, untestable, members = [], {}, []
    for name in sorted(registered.keys() - here):
        effect = get("effect", name)()
        if not _is_wanted(effect, only):
            continue
        if effect.family:
            if effect.family not in here and not model.acceptance(effect).refusal:
                members.append(build_candidate(effect))
        elif why := explain_missing_channel(effect, events) or model.acceptance(effect).refusal:
            untestable[name] = why
        else:
            testable.append(build_candidate(effect))
    _check_testable(only, untestable)
    heads = {c.name for c in testable}
    return Catalogue(
        tuple(testable), untestable, tuple(m for m in members if m.effect.family in heads)
    )


def _check_testable(only: Sequence[str], untestable: Mapping[str, str]) -> None:
    """Raise `UserError` where none of the effects that were asked for can be tested."""
    if only and all(name in untestable for name in only):
        reasons = (f"{name}: {untestable[name]}" for name in only)
        raise UserError(f"{TASK.effects} names nothing that can be tested: {'; '.join(reasons)}")


def _is_wanted(effect: Effect, only: Sequence[str]) -> bool:
    """Whether an effect is among those asked for.

    Where none is named all are. With a textbook effect its family is, and faults of the measurement
    always are.
    """
    if not only or effect.name in only:
        return True
    return effect.family in only if effect.family else isinstance(effect, Measurement)


def explain_missing_channel(effect: Effect, events: Sequence[Event]) -> str:
    """The sentence why the recorded channels do not show this effect, "" where they do."""
    for channel in effect.reads:
        enough = any if channel in COMPARED else all
        if not enough(channel in e.channels for e in events):
            return f"it is seen through {channel}, which is not recorded"
        if channel == "f" and all(np.ptp(e.record.channels["f"]) < LEAST_SWING for e in events):
            return f"it is seen through the frequency, which moves by less than {LEAST_SWING:g} Hz"
    return ""


def build_candidate(effect: Effect) -> Candidate:
    """The candidate of an effect: its sizes, and at most about `MOST_SETTINGS` combinations of what
    is scanned of its other parameters.
    """
    sizes = tuple(p for p in effect.parameters if p.null is not None)
    scanned = [p for p in effect.parameters if p.null is None]
    grid = getattr(effect, "grid", {})
    values = [grid.get(p.name, (p.default,)) for p in scanned]
    settings = [
        dict(zip((p.name for p in scanned), choice, strict=True))
        for choice in itertools.product(*values)
    ]
    step = -(-len(settings) // MOST_SETTINGS)
    return Candidate(effect.name, effect, sizes, tuple(settings[::step]))
