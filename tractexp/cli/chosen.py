"""What the user chose for a run, and the refusal of what the task would silently ignore."""

import functools
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from tractexp.api.job import ALWAYS
from tractexp.errors import UserError

OF = {"domain": "model.domain"}  # groups that choose for another, and what


def collect_chosen_settings(overrides: Iterable[str], choices: Mapping[str, Any]) -> dict[str, str]:
    """{key: value} of what was chosen on the command line, by a sweep or by an experiment, and not
    by default.
    """
    experiment = choices.get("experiment")
    chosen = dict(_read_experiment_choices(str(experiment))) if experiment else {}
    for text in overrides:
        key, _, value = text.lstrip("+~").partition("=")
        chosen[key.partition("@")[0].replace("/", ".")] = value or "null"
    return chosen


def refuse_unread(task: Any, chosen: Mapping[str, str], needless: Collection[str] = ()) -> None:
    """Raise `UserError` for the first setting chosen that a task (class or instance)
    does not read.
    """
    for key, value in chosen.items():
        if key not in task.leaves_alone and not does_read(task, key, needless):
            instead = (
                task.instead[part] for part in task.instead if _do_overlap(OF.get(key, key), part)
            )
            raise UserError(
                f"{key}={value} is not read by task={task.name}; {next(instead, 'leave it out')}"
            )


def does_read(task: Any, key: str, needless: Collection[str] = ()) -> bool:
    """Whether a task (class or instance) reads a setting, or any task does."""
    return any(
        _do_overlap(OF.get(key, key), part)
        for part in (*ALWAYS, *task.reads)
        if part not in needless
    )


def _do_overlap(a: str, b: str) -> bool:
    """Whether one key is the other or a part of it: choosing `model` chooses `model.motor` too, but
    no domain.
    """
    return (
        a == b
        or f"{a}.".startswith(f"{b}.")
        or (f"{b}.".startswith(f"{a}.") and b not in OF.values())
    )


@functools.cache
def _read_experiment_choices(experiment: str) -> Mapping[str, str]:
    """The choices {group: name} of an experiment's file, wherever Hydra looks for it."""
    from hydra.core.hydra_config import HydraConfig

    from tractexp.configuration.composition import list_folders, set_by_experiment

    sources = HydraConfig.get().runtime.config_sources if HydraConfig.initialized() else ()
    return set_by_experiment(
        experiment, [*(Path(s.path) for s in sources if s.schema == "file"), *list_folders()]
    )
