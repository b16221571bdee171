"""The configurations of many jobs, composed once per choice of groups instead of once per job.

Hydra takes 0.1 s to compose a configuration, mostly to gather its files. A plain value (`seed=3`)
is set on a composed one afterwards, which is what Hydra does with it too, in well under a hundredth
of that.
"""

import copy
import functools
from collections.abc import Iterable, Sequence
from typing import Any

from omegaconf import DictConfig, OmegaConf, open_dict, read_write

from tractexp.sweep.job import Composed

BY_NUMBER = "${hydra.job.num}"  # `hydra.sweep.subdir` as it is by default


class Composer:
    """Composes jobs of one sweep. Raises what Hydra raises for a choice or value it
    does not know.
    """

    def __init__(self, loader: Any, master: DictConfig):
        """Compose the jobs of a sweep; what they share is composed once."""
        from hydra.core.override_parser.overrides_parser import OverridesParser

        self.loader, self.master = loader, master
        self._parser = OverridesParser.create(config_loader=loader)
        self._parsed = functools.cache(lambda text: self._parser.parse_override(text))
        self._is_group = functools.cache(lambda key: bool(loader.get_group_options(key)))
        self._base = functools.cache(self._composed_base)
        self._subdir = OmegaConf.to_container(master.hydra.sweep, resolve=False)["subdir"]  # type: ignore[index, call-overload]
        # a logger without a handler writes nothing
        self._reads_hydra = bool(master.hydra.callbacks or master.hydra.job_logging.get("handlers"))

    def __call__(self, overrides: Sequence[str], number: int) -> Composed:
        """The job of this number with these overrides."""
        texts = tuple(overrides)
        if self._reads_hydra or self._subdir != BY_NUMBER:
            return self._as_hydra_composes(texts, number)
        values = [text for text in texts if self._is_value(text)]
        whole, task = self._base(tuple(text for text in texts if text not in values))
        _number(whole, number)  # what ${hydra:job.num} refers to
        if values:
            task = copy.deepcopy(task)
        for text in values:
            override = self._parsed(text)
            OmegaConf.update(task, override.key_or_group, override.value(), merge=True)
        return Composed(_resolve(task), dict(whole.hydra.runtime.choices))

    def _as_hydra_composes(self, overrides: tuple[str, ...], number: int) -> Composed:
        """The job whole, where its folder's name or somebody's callback may ask for
        any part of it.
        """
        whole = self._compose_config(overrides)
        _number(whole, number)
        subdir = "" if self._subdir == BY_NUMBER else str(whole.hydra.sweep.subdir)
        hydra = whole if self._reads_hydra else None
        return Composed(
            _resolve(_drop_hydra(whole)), dict(whole.hydra.runtime.choices), subdir, hydra
        )

    def _is_value(self, text: str) -> bool:
        """Whether an override changes one plain value that is there already."""
        override = self._parsed(text)
        added = override.is_add() or override.is_force_add() or override.is_delete()
        return not (added or self._is_group(override.key_or_group) or override.is_hydra_override())

    def _composed_base(self, overrides: tuple[str, ...]) -> tuple[DictConfig, DictConfig]:
        """The configuration that some overrides give, and the task's part of it."""
        whole = self._compose_config(overrides)
        return whole, _drop_hydra(whole)

    def _compose_config(self, overrides: Iterable[str]) -> DictConfig:
        """Hydra's own composition."""
        return self.loader.load_sweep_config(self.master, list(overrides))


def _number(whole: DictConfig, number: int) -> None:
    """Give a job its number, and let `${hydra:...}` refer to it."""
    from hydra.core.hydra_config import HydraConfig

    with open_dict(whole), read_write(whole.hydra):  # read-only since the job before
        whole.hydra.job.num = number
        whole.hydra.job.id = f"{whole.hydra.job.name}_{number}"
    HydraConfig.instance().set_config(whole)


def _drop_hydra(whole: DictConfig) -> DictConfig:
    """A configuration without Hydra's part."""
    task = copy.deepcopy(whole)
    with read_write(task), open_dict(task):
        del task["hydra"]
    return task


def _resolve(task: DictConfig) -> dict[str, Any]:
    """A configuration as plain data, interpolations resolved."""
    plain: Any = OmegaConf.to_container(task, resolve=True)
    return plain
