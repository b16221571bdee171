"""What the studies are given: events, a model, optimizers; and the base of the results they write into a folder."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp import plugin
from tractexp.errors import UserError, check_range
from tractexp.outcome import Outcome
from tractexp.record import Base, Event, Record, detect

if TYPE_CHECKING:
    from tractexp.identification.optimizer import Optimizer
    from tractexp.identification.problem import Problem
    from tractexp.identification.search import Limits
    from tractexp.model.model import Model

NODE = {"effects": [], "bounds": {}, "fixed": {}, "substeps": None, "per_event": []}  # of a model, beside its two parts
CHANNELS = ("t", "U", "P", "Q", "f", "U2")


class Written(Outcome):
    """A result that is told in a folder: a page where it has one, figures, files for machines."""

    def write(self, folder: Path) -> list[Path]:
        """Write everything into a folder; returns the paths, the one to look at first."""
        raise NotImplementedError

    def report(self, folder: Path | str) -> Path:
        """Write everything into a folder and return the path of the page."""
        return self.write(Path(folder))[0]


@dataclass(frozen=True, eq=False)
class Setup:
    """What searches are asked: events, the model with what is known of it, how a residual counts, when to end.

    Plain enough to travel to other processes, where compiled models cannot go.
    """

    train: tuple[Event, ...]
    held_out: tuple[Event, ...]
    model: Mapping[str, Any]  # configuration: motor, static and the keys of NODE
    objective: Mapping[str, Any] | None = None  # name and settings; None: least squares
    seed: int = 0
    limits: Mapping[str, Any] = field(default_factory=dict)  # of each search: budget, time_limit, target

    @classmethod
    def of(
        cls, records: Any, held_out: Any, model: Any, known: Mapping[str, Any], objective: Any, seed: int,
        **limits: Any,
    ) -> "Setup":  # fmt: skip
        """From the arguments of a call; `known` replaces keys of the model where it is not None."""
        check_range("seed", seed, 0)
        for key, value in limits.items():
            if value is not None:
                check_range(key, value, 1 if key == "budget" else 0)
        node = NODE | _model_node(model) | {key: value for key, value in known.items() if value is not None}
        how = None if objective is None else settings(objective)
        return cls(events(records), events(held_out), node, how, seed, limits)

    def problem(self) -> "Problem":
        """The identification problem of the fitted events, composed anew. Raises `UserError` for unknown names."""
        from tractexp.identification.problem import Problem
        from tractexp.identification.result import parts
        from tractexp.model.model import compose

        node = self.model
        loss = None if self.objective is None else plugin.build("objective", self.objective)
        known = (node[key] for key in ("bounds", "fixed", "substeps", "per_event"))
        return Problem(compose(*parts(node)), self.train, *known, loss=loss)

    @functools.cached_property
    def search_limits(self) -> "Limits":
        from tractexp.identification.search import Limits

        return Limits(self.limits.get("budget"), self.limits.get("time_limit"), self.limits.get("target"))

    def to_dict(self) -> dict[str, Any]:
        """Plain data, the records with it."""
        told = {key: getattr(self, key) for key in ("model", "objective", "seed", "limits")}
        return {key: [_kept(event) for event in getattr(self, key)] for key in ("train", "held_out")} | told

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Setup":
        records = {key: tuple(map(_again, content[key])) for key in ("train", "held_out")}
        return cls(**{**content, **records})


def events(records: Any) -> tuple[Event, ...]:
    """Events of a record, an event, or several; the dips of records are found. Raises `UserError` for anything else."""
    listed = [records] if isinstance(records, Record | Event) else list(records)
    for one in listed:
        if not isinstance(one, Record | Event):
            raise UserError(f"{one!r:.60} is of type {type(one).__name__}; give events or records")
    return tuple(one if isinstance(one, Event) else detect(one) for one in listed)


def optimizers_by_name(chosen: Any) -> "dict[str, Optimizer]":
    """Optimizers under the names to call them by: of names and plugins, or of a mapping of names to either.

    A plugin may also be given by its settings, {"name": "pso", "population": 100}.
    """
    named = chosen.items() if isinstance(chosen, Mapping) else ((settings(one)["name"], one) for one in chosen)
    made = {name: plugin.build("optimizer", settings(one)) for name, one in named}
    if not made:
        raise UserError("optimizers is empty; give at least one, by its name")
    return made


def settings(chosen: Any) -> dict[str, Any]:
    """Name and settings of a plugin, which may be given as these, as its name or as the plugin itself."""
    if isinstance(chosen, str):
        return {"name": chosen}
    return dict(chosen) if isinstance(chosen, Mapping) else {"name": chosen.name, **dataclasses.asdict(chosen)}


def _model_node(model: "Model | Mapping[str, Any]") -> dict[str, Any]:
    """A model's configuration: of a composed model, or that configuration itself."""
    if isinstance(model, Mapping):
        return {**model, **{part: settings(model[part]) for part in ("motor", "static")}}
    parts = {part: settings(getattr(model, part)) for part in ("motor", "static")}
    return {**parts, "effects": [effect.name for effect in model.effects]}


def _kept(event: Event) -> dict[str, Any]:
    """A record as plain data."""
    return {f.name: getattr(event.record, f.name) for f in dataclasses.fields(Record)} | {
        "base": dataclasses.asdict(event.record.base)
    }


def _again(content: Mapping[str, Any]) -> Event:
    """The event of what `_kept` told; its dip is found again."""
    arrays = {key: np.array(content[key], dtype=float) for key in CHANNELS if content[key] is not None}
    base, notes = Base(**content["base"]), tuple(content["notes"])
    return detect(Record(content["name"], base=base, source=content["source"], notes=notes, **arrays))


def distinct(where: str, values: Sequence[Any]) -> None:
    """Raise `UserError` for an empty list or one that names something twice."""
    if not values:
        raise UserError(f"{where} is empty; give at least one")
    for value in values:
        if list(values).count(value) > 1:
            raise UserError(f"{where} names {value} twice; name each once")
