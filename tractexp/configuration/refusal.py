"""Hydra's refusals of a configuration, as one sentence with the nearest name."""

import re
import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tractexp.configuration.choices import (
    describe_available,
    describe_elsewhere,
    describe_nameless,
    read_choices,
)
from tractexp.errors import UserError, list_allowed

HYDRA = ("hydra", "omegaconf", "antlr4")  # whose code composes configurations
KINDS = {
    "Integer": "a whole number",
    "Float": "a number",
    "Boolean": "true or false",
    "String": "a text",
}
PYTHON = re.compile(
    r"Config\b|Exception|Error:|\btype '|\b(?:dict|list|tuple|int|str|float|None\w*)\b|__"
)
# choices that other packages bring, and the extra by which they come
EXTRAS = {
    "hydra/sweeper=optuna": "optuna",
    "hydra/launcher=submitit_slurm": "slurm",
    "hydra/launcher=submitit_local": "slurm",
}
LONGEST_REPEATED_VALUE = 80  # characters of a value that are repeated


@contextmanager
def explain_errors() -> Iterator[None]:
    """Turn Hydra's and OmegaConf's exceptions into `UserError`, unforeseen ones from their code
    too.
    """
    from hydra.errors import HydraException, MissingConfigException
    from omegaconf.errors import OmegaConfBaseException

    try:
        yield
    except UserError:  # of a job that Hydra has run: it is a sentence
        raise
    except MissingConfigException as error:
        raise UserError(_describe_missing_choice(error)) from error
    except (HydraException, OmegaConfBaseException) as error:
        raise UserError(_describe_error(error)) from error
    except OSError as error:
        if not _comes_from_hydra(error):
            raise
        raise UserError(
            f"{error.filename} cannot be created ({error.strerror}); choose another folder for"
            " hydra.run.dir"
        ) from error
    except Exception as error:
        if not _comes_from_hydra(error):
            raise
        raise UserError(_describe_unforeseen(error)) from error


def _comes_from_hydra(error: BaseException) -> bool:
    """Whether an exception comes from what composes configurations: Python's own library apart, it
    is the last one.
    """
    own = sysconfig.get_path("stdlib")
    files = [Path(frame.f_code.co_filename) for frame, _ in traceback.walk_tb(error.__traceback__)]
    foreign = [f for f in files if "site-packages" in f.parts or not f.is_relative_to(own)]
    return bool(foreign) and bool(set(HYDRA) & set(foreign[-1].parts))


def _describe_unforeseen(error: BaseException) -> str:
    """The sentence for an error of Hydra's that no rule of ours knows."""
    if isinstance(error, RecursionError):
        return (
            "an argument has brackets within brackets, or a reference to itself, deeper than can be"
            " read"
        )
    argument = _find_argument(error)
    if argument is None:
        return (
            "the arguments make no configuration: one names a part of a value that has no parts, or"
            " a wrong value"
        )
    return (
        f"{argument}: no such value can be set there; it may name a part of a value that has no"
        " parts"
    )


def _find_argument(error: BaseException | None) -> str | None:
    """The argument that Hydra was about to apply."""
    while error is not None:
        for frame, _ in reversed(list(traceback.walk_tb(error.__traceback__))):
            if line := getattr(frame.f_locals.get("override"), "input_line", None):
                return _shorten(line)
        error = error.__cause__ or error.__context__
    return None


def _shorten(text: object) -> str:
    """A text on one line, cut where it is long."""
    text = " ".join(str(text).split())
    return text if len(text) <= LONGEST_REPEATED_VALUE else f"{text[:LONGEST_REPEATED_VALUE]}…"


def _describe_missing_choice(error: Any) -> str:
    """That a choice is not there, with those that are.

    Raises `UserError` with the reason for a plugin whose file cannot be used.
    """
    from tractexp.configuration.plugin import find

    name = str(error.missing_cfg_file or "")
    group, _, choice = name.rpartition("/")
    find(group, choice)  # raises the reason where its file cannot be used
    options = [o for o in error.options or () if not o.startswith("_")]
    if named := re.match(r"In '(.*)': Could not load '(.*)/(.*)'", get_first_line(error)):
        return _describe_missing_default(*named.groups())
    if not group or not options:
        return _read_first_line(error)
    where = describe_elsewhere(group, choice) or describe_available(group, choice, options)
    if extra := EXTRAS.get(f"{group}={choice}"):
        where = f" before it is installed: pip install 'tractexp[{extra}]'"
    return f"{group}={choice}: there is no such choice{where}"


def _describe_missing_default(file: str, group: str, name: str) -> str:
    """That a file of configurations begins with a choice that is not there, with those that are."""
    group = group.removeprefix("schema/")
    available = describe_available(group, name, read_choices().get(group, ()))
    return f"{file}.yaml: its defaults name {group}={name}, and there is no such choice{available}"


def _describe_error(error: BaseException) -> str:
    """The sentence of an error, by what caused it."""
    for link in _list_causes(error):
        key = getattr(link, "full_key", None)
        text = get_first_line(link)
        if key and ("not in" in text or "is not in struct" in text):
            return _describe_unknown_key(key, link)
        if sentence := _describe_wrong_value(key or _find_key(error), text):
            return sentence
    group = re.search(r"Could not override '([^']*)'", get_first_line(error))
    if group and "No match in the defaults list" in str(error):
        groups = _list_groups()
        return f"there is no group '{group[1]}'{list_allowed(group[1], groups, 'Groups')}"
    return _read_first_line(error)


def _list_causes(error: BaseException) -> list[BaseException]:
    """An error, what it was raised from, and so on, each once."""
    chain = [error]
    cause = error.__cause__ or error.__context__
    while cause is not None and cause not in chain:
        chain.append(cause)
        cause = cause.__cause__ or cause.__context__
    return chain


def _find_key(error: BaseException) -> str:
    """The key of the argument that an error is about."""
    return (_find_argument(error) or "").lstrip("+~").partition("=")[0]


def _describe_wrong_value(key: str, text: str) -> str:
    """The sentence about a value of another kind than its setting; "" for another exception."""
    if match := re.search(
        r"[Vv]alue '(.*)' of type '.*' could not be converted to (\w+)", text, re.DOTALL
    ):
        return f"{key}={_shorten(match[1])} is not {KINDS.get(match[2], 'what this setting takes')}"
    if "is not a ListConfig" in text:
        return f"{key} takes a list, such as {key}=[a,b]"
    return ""


# What Hydra says of an option or an argument, and our sentence with the parts it names
SENTENCES = {
    r"Cannot find primary config '(.*)'\.": (
        "-cn {0}: there is no such configuration; give the folder of yours, too: -cd FOLDER, with"
        " {0}.yaml in it"
    ),
    r"Additional config directory '(.*)' not found": "-cd {0}: there is no such folder",
    r"Ambiguous value for argument '([^=]*)=(.*)'": (
        "{0}={1} has several values; a sweep over them is written tractexp -m {0}={1}, one list of"
        " them {0}=[{1}]"
    ),
    r"Interpolation key '(.*)' not found": "${{{0}}} refers to a setting that there is not",
    r"TypeError raised while resolving interpolation: Index 'name' \(str\) is not an int": (
        "a file that is chosen holds a list; it must hold keys and values, of which the first is"
        " 'defaults: [NAME]'"
    ),
    r"Error locating target '(.*)', set env": (
        "{0} cannot be imported; _target_ names a class, as package.module.Class"
    ),
    r"Primary config (?:directory|module '.*') not found": (
        "-cp names no folder; -cd FOLDER adds configurations of yours to those that are here"
    ),
    r"Could not delete from config\. '(.*)' does not exist": "~{0}: there is no such setting to"
    " take out",
    r"Could not delete\. No match for '(.*)' in the defaults list": "~{0}: nothing is chosen there"
    " to take out",
    r"Multiple values for (\S+)\. To override a value use 'override \1: (.*)'": (
        "{0} is chosen already; within a file of configurations write 'override {0}: {1}'"
    ),
    r"Could not override '(.*)@(.*)'": "{0}@{1}: no choice of {0} stands at '{1}'; write {0}=NAME",
}


def _read_first_line(error: BaseException) -> str:
    """The first line of an exception where it is in plain words, else what can be said in its
    place.
    """
    text = get_first_line(error)
    if nameless := re.match(r"Interpolation key '(\w+)\.name' not found", text):
        return describe_nameless(nameless[1])
    for pattern, sentence in SENTENCES.items():
        if match := re.match(pattern, text):
            return sentence.format(*map(_shorten, match.groups()))
    if match := re.match(r"LexerNoViableAltException: (.*)", text, re.DOTALL):
        return (
            f"{_shorten(match[1])} cannot be read; an argument is KEY=VALUE, and other signs go in"
            " quotes: KEY='a \"b\"'"
        )
    if match := re.match(r"Error merging override (.*)", text, re.DOTALL):
        return (
            f"{_shorten(match[1])} cannot be applied: every run may need that setting, or it holds"
            " no such value"
        )
    return text if not PYTHON.search(text) else _describe_unforeseen(error)


def _describe_unknown_key(key: str, error: Any) -> str:
    """That a key is not there, with those that are."""
    if key == "experiment":
        return "the file of an experiment begins with the line '# @package _global_'"
    parent = getattr(error, "parent_node", None)
    try:
        keys = sorted(map(str, parent.keys())) if parent is not None else []
    except Exception:
        keys = []
    section, _, last = key.rpartition(".")
    where = f"'{section}' has" if section else "the configuration has"
    return f"{key}: {where} no key '{last}'{list_allowed(last, keys, 'Keys')}"


def _list_groups() -> list[str]:
    """The groups that a choice can be made in."""
    from tractexp.configuration.plugin import discover

    return sorted({*discover(), "model", "experiment"})


def get_first_line(error: BaseException) -> str:
    """The first line of an error, or its class."""
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
