"""A file of a load model, whoever wrote it: its values are read, and nothing in it is obeyed.

Hydra does as the files that it composes say: `@package` in a first line, `defaults` that reach any
group, references that a resolver fills in. A model's file may come from a stranger. So it is read
here for both the command line (`.config`) and Python (`.composition`): keys of a model, names of
its parts, and values.
"""

import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from tractexp.configuration.schema import ModelConfig
from tractexp.errors import UserError, list_allowed
from tractexp.storage import yaml_files

ENDINGS = (".yaml", ".yml")
LARGEST = 1 << 20  # bytes
# characters of the name of a choice: a system takes no file's name of more than some 250
LONGEST_CHOICE_NAME = 100
DEFAULTS, SELF = "defaults", "_self_"
PARTS = ("motor", "static")
NAME = re.compile(r"[^\W_]\w*(-\w+)*")  # of a choice: no path, no package, no other group
REFERENCES = ("${", "???")  # what Hydra would fill in, and what it takes for missing


def is_model_path(name: str) -> bool:
    """Whether what was chosen as a model is the path of a file, not the name of a choice."""
    return name.endswith(ENDINGS)


def read_model_file(path: Path | str) -> dict[str, Any]:
    """The content of a model's file: keys of a model, and `defaults` that name its parts or a
    choice it begins with.

    Raises `UserError` where the file is missing, too large, not YAML, or holds anything else than
    values of a model.
    """
    try:
        content = yaml_files.read_yaml(path, LARGEST) or {}
    except FileNotFoundError:
        raise UserError(f"model={path}: there is no such file") from None
    if not isinstance(content, dict):
        raise UserError(f"{path} must hold keys and values of a model")
    keys = [DEFAULTS, *(field.name for field in fields(ModelConfig))]
    for key in content:
        if key not in keys:
            raise UserError(
                f"{path}: '{key}' is no key of a model{list_allowed(key, keys, 'Keys')}"
            )
    if DEFAULTS in content:
        content[DEFAULTS] = _check_defaults(path, content[DEFAULTS])
    _check_values(path, "model", {key: value for key, value in content.items() if key != DEFAULTS})
    return content


def _check_defaults(path: Path | str, defaults: Any) -> list[Any]:
    """The list as it stands: a choice to begin with, the names of a motor and of a static load, and
    `_self_`.
    """
    items = list(defaults) if isinstance(defaults, list) else [defaults]
    for item in items:
        is_part = isinstance(item, Mapping)
        group, name = next(iter(item.items())) if is_part and len(item) == 1 else ("", item)
        if not _is_choice_name(name) or (is_part and group not in PARTS):
            raise UserError(
                f"{path}: its defaults have {item!s:.80}; they may name a choice of a model,"
                f" {SELF}, or a part: motor: NAME, static: NAME"
            )
    return items


def _is_choice_name(name: Any) -> bool:
    """Whether what stands in a list of defaults is the name of a choice, or `_self_`."""
    if not isinstance(name, str) or len(name) > LONGEST_CHOICE_NAME:
        return False
    return name == SELF or NAME.fullmatch(name) is not None


def _check_values(path: Path | str, key: str, value: Any) -> None:
    """Raise `UserError` for a key that is no text, and for a text that refers to something else."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            if not isinstance(name, str):
                raise UserError(f"{path}: {key} has the key {name!r:.40}; keys are names")
            _check_values(path, f"{key}.{name}", inner)
    elif isinstance(value, list):
        for inner in value:
            _check_values(path, key, inner)
    elif isinstance(value, str) and any(mark in value for mark in REFERENCES):
        raise UserError(
            f"{path}: {key} is {value:.60}; a model's file holds values, and no references to"
            " others"
        )
