"""`tractexp again RUN_FOLDER [KEY=VALUE ...]`: the configuration of an earlier run, with other
settings on top.
"""

import argparse
import os
from collections.abc import Collection, Iterable
from dataclasses import fields
from pathlib import Path

from tractexp.cli.chosen import does_read
from tractexp.configuration.plugin import get
from tractexp.configuration.repeatable import explain_refusal
from tractexp.configuration.run_command import get_group
from tractexp.errors import UserError
from tractexp.storage import yaml_files
from tractexp.storage.run_folder import CONFIGURATION as FOLDER
from tractexp.storage.run_folder import settle
from tractexp.text import quoting
from tractexp.text.progress import say

RESULT = "result.json"
SEARCHED = "--config-dir"


def build_repeat_command(arguments: list[str]) -> list[str]:
    """The arguments of `tractexp` that repeat a run with other settings, in the folder where that
    ran.

    What the task does not read is left out, and a setting of a group goes with the choice of
    another there. A task that takes a result (`task.parameters`) is given that of the run. The
    folder may be somebody else's: what it may say is in `repeatable`. Raises `UserError` where it
    holds no run, or says more.
    """
    parser = argparse.ArgumentParser(
        prog="tractexp again", description=(build_repeat_command.__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("folder", metavar="RUN_FOLDER", help="the folder of an earlier run")
    parser.add_argument(
        "settings",
        metavar="KEY=VALUE",
        nargs="*",
        help="what is to be different, as task=discrepancy",
    )
    parser.add_argument(SEARCHED, help="a folder of configurations of your own that the run used")
    chosen = parser.parse_args(arguments)
    folder = Path(chosen.folder).absolute()
    if odd := [text for text in chosen.settings if "=" not in text]:
        raise UserError(f"{odd[0]} is no setting; give KEY=VALUE, as task=discrepancy")
    settle(folder)
    lines, cwd, searched = _read_stored_run(folder)
    if searched and chosen.config_dir is None:
        raise UserError(
            f"{folder} used configurations in {searched[0]}, which only you can name: where they"
            f" are yours, give {SEARCHED} {quoting.shell(searched[0])} too"
        )
    given = [SEARCHED, str(Path(chosen.config_dir).absolute())] if chosen.config_dir else []
    _enter(cwd, folder)
    result = [*given, *merge_settings(lines, chosen.settings, folder)]
    say(f"that is: {quoting.shell('tractexp', *result)}")
    return result


def merge_settings(arguments: Iterable[str], settings: Iterable[str], folder: Path) -> list[str]:
    """Earlier settings that still count beside newer ones, and these. Raises `UserError` for one
    not taken over.
    """
    settings = list(settings)
    keys = set(map(_get_key, settings))
    stay = _select_kept(arguments, keys)
    for text in stay:
        _check_taken_over(text, folder)
    tasks = [text.partition("=")[2] for text in (*stay, *settings) if _get_key(text) == "task"]
    task = get("task", ["identify", *tasks][-1])
    stay = [text for text in stay if does_read(task, _get_key(text).replace("/", "."))]
    own = {field.name for field in fields(task)}
    if "parameters" in own and "task.parameters" not in keys:
        settings.append(f"task.parameters={folder / RESULT}")
    return [*stay, *settings]


def _select_kept(arguments: Iterable[str], keys: Collection[str]) -> list[str]:
    """Earlier settings whose key is not among the newer ones', and whose group is not chosen
    anew.
    """
    groups = {key for key in keys if key == get_group(key)}
    return [
        text
        for text in arguments
        if _get_key(text) not in keys and get_group(_get_key(text)) not in groups
    ]


def _check_taken_over(text: str, folder: Path) -> None:
    """Raise `UserError` for a setting of a run that says more than what is computed."""
    if why := explain_refusal(text):
        key = text.partition("=")[0]
        raise UserError(
            f"{folder}: {key:.80} is not taken over from the folder of a run ({why}); where it is"
            " meant, say so:"
            f" {quoting.shell('tractexp', 'again', str(folder), f'{_get_key(text):.80}=VALUE')}"
        )


def _get_key(text: str) -> str:
    """The key of a setting."""
    return text.partition("=")[0].lstrip("+~").partition("@")[0]


def _read_stored_run(folder: Path) -> tuple[list[str], Path, list[str]]:
    """The settings that were chosen for a run, where it ran, and the folders that it read
    configurations from.
    """
    try:
        whole, arguments = (
            yaml_files.read_yaml(folder / FOLDER / name)
            for name in ("hydra.yaml", "overrides.yaml")
        )
        runtime = whole["hydra"]["runtime"]
        sources = [
            s["path"] for s in runtime.get("config_sources", []) if s["provider"] == "command-line"
        ]
        return (
            [str(text) for text in arguments],
            Path(runtime["cwd"]),
            [str(path) for path in sources],
        )
    except (FileNotFoundError, LookupError, TypeError, AttributeError) as error:
        raise UserError(
            f"{folder} holds no run ({FOLDER} is missing or damaged); give the folder of one"
        ) from error


def _enter(cwd: Path, folder: Path) -> None:
    """Go where the run was, since its settings name files from there: to a folder that holds its
    own, to no other.
    """
    if not cwd.is_dir() or cwd.resolve() == Path.cwd().resolve():
        return
    if folder.resolve().is_relative_to(cwd.resolve()):
        os.chdir(cwd)
        say(f"in {cwd}, where that run was")
    else:
        say(f"here, though that run was in {cwd}: files that it names from there may be missing")
