"""The command line of this run, and commands that do something else with its settings."""

import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from tractexp.configuration import repeatable
from tractexp.text import quoting
from tractexp.text.wording import shorten_path

OF_LOAD = ("data", "model", "domain")  # groups
CALLS = {"discrepancy": "investigate"}  # tasks whose public call has another name
_started: list[str] = []
_placed: list[Path] = []
_roles: dict[str, list[Any]] = {}


def remember_command(arguments: list[str]) -> None:
    """Remember the command line that this process was started by."""
    _started[:] = ["tractexp", *arguments]
    _placed.clear()
    _roles.clear()


def remember_folder(folder: Path) -> None:
    """Remember the folder of this run, which `tractexp again` takes."""
    _placed[:] = [shorten_path(folder)]


def remember_roles(train: Sequence[Any] | None, validate: Sequence[Any] | None) -> None:
    """Remember the dips that this run fits and those that it holds out, as its settings name
    them.
    """
    _roles.update(train=list(train or ()), validate=list(validate or ()))


def list_settings_of_all() -> list[str]:
    """The settings by which a command fits the dips that this run holds out, too; none where it
    holds out none.
    """
    train, validate = (_roles.get(role, []) for role in ("train", "validate"))
    if not validate:
        return []
    dips = [quoting.hydra(dip) if isinstance(dip, str) else str(dip) for dip in (*train, *validate)]
    fitted = [f"data.train=[{','.join(dips)}]"] if train else []
    return [*fitted, "data.validate=[]"]


def build_again_command(*settings: str, of: Collection[str] = OF_LOAD) -> str:
    """The command that does something else with the settings of this run in some groups: its
    records and its load.

    Whole, or by the folder of this run where that is shorter. The command line of a sweep has
    several of each, so that its jobs repeat none.
    """
    whole = _repeat_settings(settings, of)
    possible = of == OF_LOAD and not any(map(_does_block_repetition, _started[1:]))
    by_folder = [
        quoting.shell("tractexp", "again", str(folder), *settings) for folder in _placed if possible
    ]
    return min(whole, *by_folder, key=len) if by_folder else whole


def suggest_run(*settings: str, of: Collection[str] = OF_LOAD) -> str:
    """The command that does something else with the records and the load of this run: as
    `build_again_command` where a command started it, elsewhere a call in Python, in which its
    events are called `dips`.
    """
    if _started:
        return build_again_command(*settings, of=of)
    given = dict(setting.split("=", 1) for setting in settings)
    task = given.pop("task", "identify")
    records = given.pop("data", None)
    values = (f"{key.rpartition('.')[2]}={_write_value(text)}" for key, text in given.items())
    arguments = ["dips" if records is None else repr(records), *values]
    return f"tractexp.{CALLS.get(task, task)}({', '.join(arguments)})"


def _write_value(text: str) -> str:
    """A setting's value as Python writes it."""
    return {"true": "True", "false": "False", "null": "None"}.get(text, repr(text))


def build_folder_command(*settings: str) -> str:
    """The command that does something else with what this run wrote into its folder; "" where it
    has none, as from Python.
    """
    return next((quoting.shell("tractexp", "again", str(f), *settings) for f in _placed), "")


def find_folder() -> Path | None:
    """The folder of this run; None where it has none, as from Python."""
    return next(iter(_placed), None)


def _does_block_repetition(argument: str) -> bool:
    """Whether an argument keeps `tractexp again` from repeating this run by its folder."""
    # which is none of the settings that a folder keeps
    if get_group(argument) == "hydra" or "=" not in argument:
        return argument.startswith("--config-dir")
    return bool(repeatable.explain_refusal(argument))


def _repeat_settings(settings: Collection[str], of: Collection[str]) -> str:
    """The arguments of this run that another command repeats, for groups `of` and without those set
    anew.
    """
    arguments, others = _started[1:], {setting.partition("=")[0] for setting in settings}
    if {"-m", "--multirun"} & {*arguments}:
        arguments = []
    keys = [(argument, argument.partition("=")[0]) for argument in arguments if "=" in argument]
    repeated = [argument for argument, key in keys if get_group(key) in of and key not in others]
    if "--config-dir" in arguments and "--config-dir" not in settings:
        at = arguments.index("--config-dir")
        repeated = [*arguments[at : at + 2], *repeated]
    return quoting.shell("tractexp", *settings, *repeated)


def get_group(key: str) -> str:
    """The group of a setting's key: `data` of data.train."""
    return re.split(r"[./@]", key.lstrip("+~"), maxsplit=1)[0]


def list_arguments() -> tuple[str, ...]:
    """The arguments of the command line that this process was started by."""
    return tuple(_started[1:])


def get_command() -> str:
    """The command line of this run, to be typed again; "" where there was none, as from Python."""
    return quoting.shell(*_started)
