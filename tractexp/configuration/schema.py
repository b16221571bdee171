"""The configuration's schema: what a run is made of beside its plugins, and the values that are
refused.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tractexp.errors import UserError, check_range, list_allowed

LEAST = {"seed": 0, "budget": 1, "time_limit": 0, "target": 0}  # of numbers


@dataclass
class ModelConfig:
    """The parts of a load model, and what is known of its parameters beforehand."""

    motor: Any = None
    static: Any = None
    effects: list[str] = field(default_factory=list)  # names of effects added to the equations
    bounds: dict[str, list[float]] = field(default_factory=dict)  # {name: [lower, upper]}
    fixed: dict[str, float] = field(default_factory=dict)  # {name: value}
    substeps: int | None = None  # Runge-Kutta steps per sample; null: as many as needed
    # or printed: Eq. (4) of the paper as it stands, one step per sample
    integration: str = "classical"
    # parameters with a value of their own in each event
    per_event: list[str] = field(default_factory=list)
    domain: str = "phasors"  # or waves; chosen by domain=
    # over which the recorder averages phasors: seconds, an estimator's name, or recorded
    window: Any = None
    # hold the motor to what machines usually are, where the records do not tell
    priors: bool = False
    # keep machines within what machines are; null: of records from the field
    physical: bool | None = None
    # {domain: choices of model that are raced}: the simplest that predicts nearly best is fitted
    candidates: dict[str, list[str]] = field(default_factory=dict)
    # add the effects that the records show, such as a current of zero sequence
    shown_effects: bool = False


@dataclass
class TrackingConfig:
    """Where runs are logged."""

    enabled: bool = True
    uri: str | None = None  # null: SQLite in outputs/ of the current folder
    experiment: str | None = None  # null: named after task and data


@dataclass
class SweepConfig:
    """The metrics that a job returns to an optimizer over jobs, such as Optuna."""

    returns: list[str] | None = None  # metrics, as MLflow shows them; null: search_objective


@dataclass
class Config:
    """One run. The groups hold the chosen plugins' settings."""

    task: Any = None
    model: ModelConfig = field(default_factory=ModelConfig)
    optimizer: Any = None
    data: Any = None
    objective: Any = None
    seed: int = 0
    budget: int | None = None  # simulations; null: the optimizer's own end
    time_limit: float | None = None  # s
    target: float | None = None  # objective at which the search may stop
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    sweep: SweepConfig = field(default_factory=SweepConfig)


def check(config: Mapping[str, Any]) -> None:
    """Raise `UserError` for a key nobody reads (as `+sede=3` makes one), one taken out, or a value
    out of range.
    """
    sections = {"model.": ModelConfig, "tracking.": TrackingConfig, "sweep.": SweepConfig}
    for where, kind in {"": Config, **sections}.items():
        part = config.get(where[:-1]) if where else config
        keys = [item.name for item in dataclasses.fields(kind)]
        if not isinstance(part, Mapping):
            raise UserError(f"{where.rstrip('.')} holds no settings; leave it as it is")
        for key in part:
            if key not in keys:
                raise UserError(
                    f"{where}{key}: there is no such key{list_allowed(key, keys, 'Keys')}"
                )
        for key in keys:
            if key not in part:
                raise UserError(
                    f"{where}{key} is taken out, and every run needs it; leave it as it is"
                )
    for key, least in LEAST.items():
        check_range(key, config[key], least)
