"""`tractexp again RUN_FOLDER [KEY=VALUE ...]`: the configuration of an earlier run, with other settings on top."""

import argparse
import os
from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from tractexp import quoting
from tractexp.cli.chosen import reads
from tractexp.cli.configuration import FOLDER
from tractexp.errors import UserError
from tractexp.plugin import get
from tractexp.progress import say
from tractexp.provenance import group_of

RESULT = "result.json"


def again(arguments: list[str]) -> list[str]:
    """The arguments of `tractexp` that repeat a run with other settings, in the folder where that ran.

    What the task does not read is left out, and a setting of a group goes with the choice of another there. A task that
    takes a result (`task.parameters`) is given that of the run. Raises `UserError` where the folder holds no run.
    """
    parser = argparse.ArgumentParser(prog="tractexp again", description=(again.__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", metavar="RUN_FOLDER", help="the folder of an earlier run")
    parser.add_argument("settings", metavar="KEY=VALUE", nargs="*", help="what is to be different, as task=discrepancy")
    chosen = parser.parse_args(arguments)
    folder = Path(chosen.folder).absolute()
    if odd := [text for text in chosen.settings if "=" not in text]:
        raise UserError(f"{odd[0]} is no setting; give KEY=VALUE, as task=discrepancy")
    whole, lines = _stored(folder)
    _enter(Path(whole["runtime"]["cwd"]))
    search = [s["path"] for s in whole["runtime"]["config_sources"] if s["provider"] == "command-line"]
    result = [*(part for path in search for part in ("--config-dir", path)), *repeated(lines, chosen.settings, folder)]
    say(f"that is: {quoting.shell('tractexp', *result)}")
    return result


def repeated(arguments: Iterable[str], settings: Iterable[str], folder: Path) -> list[str]:
    """Earlier settings that still count beside newer ones, and these."""
    settings = list(settings)
    keys = {_key(text) for text in settings}
    groups = {key for key in keys if key == group_of(key)}
    stay = [text for text in arguments if _key(text) not in keys and group_of(_key(text)) not in groups]
    names = [text.partition("=")[2] for text in (*stay, *settings) if _key(text) == "task"]
    task = get("task", names[-1] if names else "identify")
    stay = [text for text in stay if reads(task, _key(text).replace("/", "."))]
    if "parameters" in {field.name for field in fields(task)} and "task.parameters" not in keys:
        settings.append(f"task.parameters={folder / RESULT}")
    return [*stay, *settings]


def _key(text: str) -> str:
    return text.partition("=")[0].lstrip("+~").partition("@")[0]


def _stored(folder: Path) -> tuple[Mapping[str, Any], list[str]]:
    """Hydra's own part of a run's configuration, and the settings that were chosen."""
    import yaml

    try:
        files = [(folder / FOLDER / name).read_text(encoding="utf-8") for name in ("hydra.yaml", "overrides.yaml")]
        whole, arguments = (yaml.safe_load(text) for text in files)
        return whole["hydra"], [str(text) for text in arguments]
    except (OSError, UnicodeDecodeError, yaml.YAMLError, LookupError, TypeError) as error:
        raise UserError(f"{folder} holds no run ({FOLDER} is missing or damaged); give the folder of one") from error


def _enter(cwd: Path) -> None:
    """Go where the run was: its settings name files from there."""
    if cwd.is_dir() and cwd != Path.cwd():
        os.chdir(cwd)
        say(f"in {cwd}, where that run was")
