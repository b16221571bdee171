"""Configuration files read without Hydra, which takes half a second: a choice of a group, and what
an experiment sets.

A file's `defaults` name other choices, of the same group, of a group below it, or overrides of any
group; what the file says itself comes last.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tractexp.configuration import plugin
from tractexp.configuration.choices import describe_available, describe_elsewhere
from tractexp.configuration.model_file import is_model_path, read_model_file
from tractexp.errors import UserError

MODEL = "model"  # the group


def read_choice(group: str, name: str) -> dict[str, Any]:
    """The content of a choice of a group: of `conf/GROUP/NAME.yaml`, ours or a plugin package's,
    else of a plugin.

    A model may be the path of a file of one.

    Raises `UserError` for a name that is none, and for a file that cannot be read.
    """
    if group == MODEL and is_model_path(name):
        content = read_model_file(name)
    elif (file := _find_file(group, name, list_folders())) is not None:
        content = _read_content(group, file)
    elif plugin.find(group, name) is not None:
        return {"name": name}
    else:
        where = describe_elsewhere(group, name) or describe_available(
            group, name, list_choices(group)
        )
        raise UserError(f"{group}={name}: there is no such choice{where}")
    composed: dict[str, Any] = {}
    for item in content.pop("defaults", []):
        if isinstance(item, dict):
            ((part, chosen),) = item.items()
            composed[part] = read_choice(f"{group}/{part}", chosen)
        elif item != "_self_":
            place, _, chosen = item.partition("@")[0].rpartition("/")
            composed |= read_choice(
                place.removeprefix("/").removeprefix("schema/") or group, chosen
            )
    return _merge(composed, content)


def _merge(composed: Mapping[str, Any], content: Mapping[str, Any]) -> dict[str, Any]:
    """The composed parts with the choice's own content over them; the settings of one part are
    merged by key.
    """
    merged = {**composed}
    for key, value in content.items():
        nested = isinstance(value, dict) and isinstance(composed.get(key), dict)
        merged[key] = {**composed[key], **value} if nested else value
    return merged


def set_by_experiment(name: str, places: Sequence[Path]) -> dict[str, str]:
    """{"task": "paper", "task.parts": "['table1']"}: what an experiment's file and those that it
    builds on set.
    """
    file = _find_file("experiment", name, places)
    if file is None:
        return {}
    content = _read_content("experiment", file)
    values: dict[str, str] = {}
    for item in content.pop("defaults", []):
        if isinstance(item, dict):
            values |= {
                key.removeprefix("override ").strip("/").replace("/", "."): str(v)
                for key, v in item.items()
            }
        elif item != "_self_":
            values |= set_by_experiment(item.rpartition("/")[2], places)
    content.pop("hydra", None)  # of the run, not of the task
    return values | {key: str(value) for key, value in list_leaves(content)}


def list_leaves(node: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of a configuration by their keys: ("model.per_event", [])."""
    for key, value in node.items():
        if isinstance(value, dict) and value:
            yield from list_leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def list_texts(content: Any) -> Iterator[str]:
    """Every text in a configuration."""
    if isinstance(content, str):
        yield content
    elif isinstance(content, Mapping | list | tuple):
        for inner in content.values() if isinstance(content, Mapping) else content:
            yield from list_texts(inner)


def list_choices(group: str, *, files: bool = False) -> list[str]:
    """The names one may choose in a group, or those among them that have a file."""
    named = {file.stem for folder in list_folders() for file in (folder / group).glob("*.yaml")}
    return sorted(named if files else {*named, *plugin.discover().get(group, {})})


def list_folders() -> list[Path]:
    """The folders of configurations: of plugin packages first, whose files replace ours."""
    return [*plugin.list_configuration_folders(), plugin.CONF]


def _find_file(group: str, name: str, places: Iterable[Path]) -> Path | None:
    """The file of a choice in the first place that has one; None where none has."""
    files = (folder / group / f"{name}.yaml" for folder in places)
    # not `Path.is_file`, which raises for a name that is too long for any file
    return next((file for file in files if os.path.isfile(file)), None)


def _read_content(group: str, file: Path) -> dict[str, Any]:
    """The content of a configuration's file. Raises `UserError` where it cannot be read."""
    import yaml

    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8")) or {}
    except (OSError, yaml.YAMLError) as error:
        raise UserError(f"{group}={file} cannot be read: {error}") from error
    if not isinstance(content, dict):
        raise UserError(f"{group}={file} must hold keys and values")
    return content
