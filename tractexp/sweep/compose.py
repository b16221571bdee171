"""The configurations of many jobs, composed once per choice of groups instead of once per job.

Hydra takes 0.1 s to compose a configuration, mostly to gather its files. A plain value (`seed=3`) is set on a
composed one afterwards, which is what Hydra does with it too, in well under a hundredth of that.
"""

import copy
import functools
from collections.abc import Iterable, Sequence
from typing import Any

from omegaconf import DictConfig, OmegaConf, open_dict, read_write


class Composer:
    """Composes jobs of one sweep. Raises what Hydra raises for a choice or value it does not know."""

    def __init__(self, loader: Any, master: DictConfig):
        from hydra.core.override_parser.overrides_parser import OverridesParser

        self.loader, self.master = loader, master
        self._parser = OverridesParser.create(config_loader=loader)
        self._parsed = functools.cache(lambda text: self._parser.parse_override(text))
        self._is_group = functools.cache(lambda key: bool(loader.get_group_options(key)))
        self._base = functools.cache(self._compose)

    def __call__(self, overrides: Sequence[str]) -> tuple[dict[str, Any], dict[str, str]]:
        """The plain, resolved configuration of the job with these overrides, and the choices made in its groups."""
        values = [text for text in overrides if self._is_value(text)]
        task, choices = self._base(tuple(text for text in overrides if text not in values))
        if values:
            task = copy.deepcopy(task)
        for text in values:
            override = self._parsed(text)
            OmegaConf.update(task, override.key_or_group, override.value(), merge=True)
        plain: Any = OmegaConf.to_container(task, resolve=True)
        return plain, choices

    def _is_value(self, text: str) -> bool:
        """Whether an override changes one plain value that is there already."""
        override = self._parsed(text)
        added = override.is_add() or override.is_force_add() or override.is_delete()
        return not (added or self._is_group(override.key_or_group) or override.is_hydra_override())

    def _compose(self, overrides: Iterable[str]) -> tuple[DictConfig, dict[str, str]]:
        from hydra.core.hydra_config import HydraConfig

        whole = self.loader.load_sweep_config(self.master, list(overrides))
        HydraConfig.instance().set_config(whole)  # what ${hydra:...} refers to
        choices = dict(whole.hydra.runtime.choices)
        task = copy.deepcopy(whole)
        with read_write(task), open_dict(task):
            del task["hydra"]
        return task, choices
