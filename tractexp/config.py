"""The configuration's schema, and the door through which plugins enter Hydra's groups."""

import dataclasses
import hashlib
import importlib
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import OmegaConf

from tractexp import plugin
from tractexp.errors import UserError, among, check_range


@dataclass
class ModelConfig:
    """The parts of a load model, and what is known of its parameters beforehand."""

    motor: Any = None
    static: Any = None
    effects: list[str] = field(default_factory=list)  # names of effects added to the equations
    bounds: dict[str, list[float]] = field(default_factory=dict)  # {name: [lower, upper]}
    fixed: dict[str, float] = field(default_factory=dict)  # {name: value}
    substeps: int | None = None  # Runge-Kutta steps per sample; null: as many as needed
    per_event: list[str] = field(default_factory=list)  # parameters with a value of their own in each event


@dataclass
class TrackingConfig:
    """Where runs are logged."""

    enabled: bool = True
    uri: str | None = None  # null: SQLite in outputs/ of the current folder
    experiment: str | None = None  # null: named after task and data


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


def check(config: Mapping[str, Any]) -> None:
    """Raise `UserError` for a key nobody reads (as `+sede=3` makes one) or a value out of range."""
    for where, part, kind in (("", config, Config), ("model.", config["model"], ModelConfig)):
        known = [item.name for item in dataclasses.fields(kind)]
        for key in part:
            if key not in known:
                raise UserError(f"{where}{key}: there is no such key{among(key, known, 'Keys')}")
    for key, least in {"seed": 0, "budget": 1, "time_limit": 0, "target": 0}.items():
        if config[key] is not None:
            check_range(key, config[key], least)


class PluginSearchPath(SearchPathPlugin):
    """Adds the `conf/` folder of every installed plugin package to Hydra's search path."""

    def manipulate_search_path(self, search_path: Any) -> None:
        for folder in plugin.configuration_folders():
            search_path.append("tractexp", f"file://{folder}")


def register() -> None:
    """Discover all plugins and give Hydra their schemas. Raises `UserError` for a plugin that cannot be loaded."""
    Plugins.instance()  # executes Hydra's own sweepers anew: before ours are derived from them
    from tractexp.sweep.launcher import Cores, CoresConfig
    from tractexp.sweep.sweeper import Grid, GridConfig

    store = ConfigStore.instance()
    store.store(name="config_schema", node=Config)
    for group, classes in plugin.discover().items():
        for name, cls in classes.items():
            store.store(group=group, name=name, node=plugin.schema(cls))
    store.store(group="hydra/sweeper", name="grid", node=GridConfig)
    store.store(group="hydra/launcher", name="cores", node=CoresConfig)
    Plugins.instance().register(PluginSearchPath)
    for cls in (Grid, Cores):
        _admit(cls)
    OmegaConf.register_new_resolver("fingerprint", _fingerprint, replace=True)


def _admit(cls: type) -> None:
    """Make a sweeper or launcher known to Hydra, which takes them from modules below `hydra_plugins` only."""
    Plugins.instance().register(cls)
    package, _, name = cls.__module__.partition(".")
    try:
        parent = importlib.import_module(package)
    except ModuleNotFoundError:
        parent = sys.modules[package] = ModuleType(package)
        parent.__path__ = []
    door = sys.modules.setdefault(cls.__module__, ModuleType(cls.__module__))
    setattr(door, cls.__name__, cls)
    setattr(parent, name, door)


def _fingerprint(overrides: Any) -> str:
    """Eight letters that stand for a sweep's overrides: the same command writes to the same folder."""
    return hashlib.sha256("\n".join(overrides).encode()).hexdigest()[:8]
