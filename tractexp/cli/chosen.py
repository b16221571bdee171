"""What the user chose for a run, and the refusal of what the task would silently ignore."""

import functools
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from tractexp.api.task import ALWAYS
from tractexp.errors import UserError

OF = {"domain": "model"}  # groups that choose for another


def given(overrides: Iterable[str], choices: Mapping[str, Any]) -> dict[str, str]:
    """{key: value} of what was chosen on the command line, by a sweep or by an experiment, and not by default."""
    experiment, task = choices.get("experiment"), str(choices["task"])
    chosen = dict(_by_experiment(str(experiment), task)) if experiment else {}
    for text in overrides:
        key, _, value = text.lstrip("+~").partition("=")
        chosen[key.partition("@")[0].replace("/", ".")] = value or "null"
    return chosen


def refuse_unread(task: Any, chosen: Mapping[str, str], needless: Collection[str] = ()) -> None:
    """Raise `UserError` for the first setting chosen that a task (class or instance) does not read."""
    read = [part for part in (*ALWAYS, *task.reads) if part not in needless]
    for key, value in chosen.items():
        if not any(_overlap(OF.get(key, key), part) for part in read):
            instead = (task.instead[part] for part in task.instead if _overlap(OF.get(key, key), part))
            raise UserError(f"{key}={value} is not read by task={task.name}; {next(instead, 'leave it out')}")


def _overlap(a: str, b: str) -> bool:
    """Whether one key is the other or a part of it: choosing `model` chooses `model.motor` too."""
    return f"{a}.".startswith(f"{b}.") or f"{b}.".startswith(f"{a}.")


@functools.cache
def _by_experiment(experiment: str, task: str) -> Mapping[str, str]:
    """What an experiment's file sets: where the configuration with it is another than without it."""
    (groups, values), (plain_groups, plain_values) = (
        _composed(f"task={task}", *extra) for extra in ([f"experiment={experiment}"], [])
    )
    chosen = {group.replace("/", "."): name for group, name in groups.items() if plain_groups.get(group) != name}
    for key, value in values.items():
        if plain_values.get(key) != value and not any(f"{key}.".startswith(f"{group}.") for group in chosen):
            chosen[key] = str(value)
    return chosen


def _composed(*overrides: str) -> tuple[dict[str, str], dict[str, Any]]:
    """The choices and the values {"model.per_event": []} of a configuration, composed beside the one that runs."""
    from hydra import compose
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    name = HydraConfig.get().job.config_name if HydraConfig.initialized() else "config"
    whole: Any = OmegaConf.to_container(compose(name, list(overrides), return_hydra_config=True))
    groups = {g: str(c) for g, c in whole.pop("hydra")["runtime"]["choices"].items() if not g.startswith("hydra/")}
    return groups, dict(_leaves(whole))


def _leaves(node: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in node.items():
        if isinstance(value, dict) and value:
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
