"""The door through which plugins and schemas enter Hydra's groups."""

import argparse
import contextlib
import functools
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import OmegaConf

from tractexp.cache.store import TEXTS, compute_key, describe_environment
from tractexp.compat import hydra_config_store, hydra_plugins, hydra_versions
from tractexp.configuration import plugin
from tractexp.configuration.composition import MODEL
from tractexp.configuration.model_file import is_model_path, read_model_file
from tractexp.configuration.schema import Config


class PluginSearchPath(SearchPathPlugin):
    """Puts the `conf/` folder of every installed plugin package before ours, and the user's own
    before all.

    A file of the same name replaces ours.
    """

    own: ClassVar[list[Path]] = []  # folders that `-cd` names; Hydra itself would put them last

    def manipulate_search_path(self, search_path: Any) -> None:
        """Add the configurations of plugins, model files and a user's own folders."""
        for folder in plugin.list_configuration_folders():
            search_path.prepend("tractexp", f"file://{folder}", "main")
        search_path.prepend("tractexp", f"{ModelFiles.scheme()}://", "main")
        for folder in self.own:
            search_path.prepend("tractexp", f"file://{folder}")


class ModelFiles(ConfigSource):
    """The models that are chosen by the path of a file, `model=/path/extended.yaml`; read as
    `model_file` says.
    """

    @staticmethod
    def scheme() -> str:
        """The scheme by which Hydra finds this source."""
        return "tractexp-model"

    def load_config(self, config_path: str) -> ConfigResult:
        """The configuration of a model's file."""
        content = OmegaConf.create(read_model_file(config_path.removeprefix(f"{MODEL}/")))
        return ConfigResult(self.provider, self.full_path(), content, {"package": None})

    def is_config(self, config_path: str) -> bool:
        """Whether a path is that of a model's file."""
        group, _, name = config_path.partition("/")
        return group == MODEL and is_model_path(name) and Path(name).is_absolute()

    def is_group(self, config_path: str) -> bool:
        """False: there are no groups."""
        return False

    def available(self) -> bool:
        """True: files are always there to be read."""
        return True

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """[]: nothing is listed."""
        return []


def register(arguments: Sequence[str] = ()) -> None:
    """Discover all plugins and give Hydra their schemas. Raises `UserError` for a plugin that
    cannot be loaded.
    """
    PluginSearchPath.own = _find_own_folder(arguments)
    from tractexp.sweep.launcher import Cores, CoresConfig
    from tractexp.sweep.sweeper import Grid, GridConfig

    hydra_config_store.share()
    hydra_versions.store_schema(None, "config_schema", Config)
    for group, names in _list_offered().items():
        for name in names:
            where = f"schema/{group}" if _is_configured(group, name) else group
            hydra_config_store.store_later(
                where, name, functools.partial(_find_schema, group, name)
            )
    hydra_versions.store_schema("hydra/sweeper", "grid", GridConfig)
    hydra_versions.store_schema("hydra/launcher", "cores", CoresConfig)
    Plugins.instance().register(PluginSearchPath)
    Plugins.instance().register(ModelFiles)
    for cls in (Grid, Cores):
        hydra_plugins.admit(cls)
    with contextlib.suppress(ImportError):  # the extra `slurm` is not installed
        from tractexp.sweep.batches import LAUNCHERS

        for name, (cls, schema) in LAUNCHERS.items():
            hydra_versions.store_schema("hydra/launcher", name, schema)
            hydra_plugins.admit(cls)
    register_resolver = hydra_versions.register_resolver()
    register_resolver("fingerprint", _compute_fingerprint, replace=True)
    register_resolver("folder_name", _name_folder, replace=True)


def _list_offered() -> dict[str, set[str]]:
    """{group: names} of the plugins that Hydra offers.

    All are imported for it where the code of any has changed since, and else those that are chosen
    alone, when Hydra reads their schemas. What this process has registered itself comes, too.
    """

    def ask() -> bytes:
        offered = {group: [*names] for group, names in list_groups(plugin.discover())}
        for group, name in plugin.list_refused_choices():
            if offered.get(group):
                offered[group].append(name)
        return json.dumps(offered).encode()

    def list_groups(classes_of: Mapping[str, Any]) -> Iterator[tuple[str, set[str]]]:
        for group, classes in classes_of.items():
            yield group, {name for name, cls in classes.items() if cls.chosen}

    kept = json.loads(
        TEXTS.get(compute_key(describe_environment(), "plugins that Hydra offers"), ask)
    )
    here = dict(list_groups(plugin.list_registered()))
    return {group: {*kept.get(group, ()), *here.get(group, ())} for group in {*kept, *here}}


def _find_schema(group: str, name: str) -> type:
    """The dataclass that a plugin's configuration is checked against."""
    return plugin.make_schema(plugin.get(group, name))


def _find_own_folder(arguments: Sequence[str]) -> list[Path]:
    """The folder of configurations that a command names."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("-cd", "--config-dir")
    folder = parser.parse_known_args([*arguments])[0].config_dir
    return [Path(folder).absolute()] if folder and Path(folder).is_dir() else []


def _is_configured(group: str, name: str) -> bool:
    """Whether a file gives this plugin its defaults: it begins with the schema, as
    conf/task/export.yaml does.
    """
    folders = (plugin.CONF, *plugin.list_configuration_folders(), *PluginSearchPath.own)
    return any((folder / group / f"{name}.yaml").is_file() for folder in folders)


def _compute_fingerprint(overrides: Any) -> str:
    """Eight letters that stand for a sweep's overrides: the same command writes to the
    same folder.
    """
    return hashlib.sha256("\n".join(overrides).encode()).hexdigest()[:8]


def _name_folder(path: Any) -> str:
    """A folder's name, and letters that stand for its whole path: the same folder,
    the same name.
    """
    whole = Path(str(path)).absolute()
    return f"{whole.name}_{hashlib.sha256(str(whole).encode()).hexdigest()[:8]}"
