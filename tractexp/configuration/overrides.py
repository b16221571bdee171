"""Arguments as people write them, converted to overrides that Hydra reads."""

import functools
import itertools
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from tractexp.configuration.model_file import is_model_path
from tractexp.errors import UserError, list_allowed
from tractexp.storage import files
from tractexp.text import quoting

# settings that take names of their own
OPEN = (
    "model.bounds.",
    "model.fixed.",
    "task.values",
    "task.criteria.",
    "hydra.sweeper.comparison.",
    "data.columns",
    "data.units",
)
# settings that name files and channels
NAMING = ("data.", "task.", "tracking.", "hydra.run.dir", "hydra.sweep.dir")
MISSING = re.compile(r"(^|[=\[,{:\s])\?\?\?($|[\],}\s])")
MODEL = "model"  # the group
OPTIONS = ("-", "~", "+", "")  # what begins an argument that needs no value
CONFIG_FOLDER = ("--config-dir", "-cd")
# Hydra's options: those followed by a value, the one that may be, and those that are not
TAKING = (*CONFIG_FOLDER, "--config-name", "-cn", "--config-path", "-cp", "--cfg", "-c")
TAKING = (*TAKING, "--package", "-p", "--experimental-rerun")
INFO = ("--info", "-i")
FLAGS = ("--multirun", "-m", "--run", "-r", "--resolve", "--help", "-h", "--hydra-help")
FLAGS = (*FLAGS, "--version", "--shell-completion", "-sc")
DEEPEST_BRACKETS = 20  # brackets within one another
NEEDED = (
    "seed",
    "budget",
    "time_limit",
    "target",
    "task",
    "model",
    "optimizer",
    "data",
    "objective",
    "tracking",
)
NO_NAME = re.compile(
    r"(?!\[.*\],\[)\[.*\]|[-+.]?[\d_]+[\d_.e+-]*|[-+]?(nan|inf)|null|true|false", re.IGNORECASE
)
MARKS = set(",'\"[](){}\\")  # which a name within a list cannot have as it stands
WORD = re.compile(r"[^\W\d_].*[^\W\d_]|[^\w.+\-]")  # in what is no number
PLAIN = re.compile(r"[A-Za-z0-9_./:\-]*", re.ASCII)  # what Hydra's grammar takes as it stands


def quote_overrides(arguments: Iterable[str]) -> list[str]:
    """The command's arguments as Hydra reads them.

    `model/motor=[a,b]` is several motors, for which Hydra would merge the settings of both.
    """
    arguments = [*arguments]
    for before, argument in itertools.pairwise(["", *arguments]):
        if "=" not in argument and argument[:1] not in OPTIONS and before[:1] != "-":
            _refuse_word(argument)
    result = []
    for argument in map(_strip_plus, _name_model_file(arguments)):
        group, _, value = argument.partition("=")
        if group == "model/motor" and "[" in value:
            result += _expand_choices(group, value)
        else:
            _check(argument, group, value)
            result.append(quote_override(argument))
    return _put_options_first(result)


def _put_options_first(arguments: Iterable[str]) -> list[str]:
    """The arguments with Hydra's options before all settings, for it reads none between them.

    Raises `UserError` for an option that there is not.
    """
    options: list[str] = []
    settings: list[str] = []
    awaited = False  # whether an option still takes a value
    for argument in arguments:
        option = argument.partition("=")[0]
        if awaited and not (options[-1] in INFO and "=" in argument):
            options.append(argument)
            awaited = False
        elif not argument.startswith("-"):
            settings.append(argument)
            awaited = False
        elif option in (*TAKING, *INFO, *FLAGS):
            options.append(argument)
            awaited = argument in (*TAKING, *INFO)
        else:
            raise UserError(
                f"{option:.80}: there is no such option"
                f"{list_allowed(option, (*TAKING, *INFO, *FLAGS))}; settings are KEY=VALUE"
            )
    return [*options, *settings]


def _refuse_word(word: str) -> None:
    """Raise `UserError` for an argument that is neither KEY=VALUE nor anything else that could be
    meant.
    """
    from tractexp.configuration.choices import describe_elsewhere

    raise UserError(
        f"{' '.join(word.split()):.200} is no setting (KEY=VALUE), no command, and no file or"
        f" folder that is there{describe_elsewhere('', word)}; tractexp --help shows what there is"
    )


def _strip_plus(argument: str) -> str:
    """`+experiment=x` as `experiment=x`: the group is there already, and Hydra would refuse to add
    it twice.
    """
    key = argument.partition("=")[0]
    return argument[1:] if key[:1] == "+" and key[1:] in list_groups() else argument


def _check(argument: str, key: str, value: str) -> None:
    """Raise `UserError` for what Hydra takes without a word, or refuses in words of
    its own code.
    """
    depth = max(itertools.accumulate((c in "[({") - (c in "])}") for c in value), default=0)
    if depth > DEEPEST_BRACKETS:
        raise UserError(
            f"{key:.80} has brackets {depth} deep within one another; no setting needs more than"
            f" {DEEPEST_BRACKETS}"
        )
    if not argument.isprintable():
        raise UserError(
            f"{' '.join(argument.split()):.80} has a line break or another sign that cannot be"
            " printed"
        )
    if MISSING.search(value):
        raise UserError(
            f"{argument:.200}: ??? stands for a value that is missing; give one, or leave the"
            " setting out"
        )
    if key[:1] == "~" and key[1:] in NEEDED:
        raise UserError(
            f"{argument:.200} takes out what every run needs; give {key[1:]} a value, or leave it"
            " as it is"
        )
    group = key.lstrip("+").partition("@")[0].replace("model.", "model/")
    if NO_NAME.fullmatch(value) and group in list_groups():
        raise UserError(
            f"{group}={value:.80}: what is chosen there has a name; tractexp --help shows the names"
        )


def _name_model_file(arguments: list[str]) -> list[str]:
    """The arguments with a model of a folder, `--config-dir CONF model=NAME`, as the path of its
    file.

    A folder that holds models only is then left out: nothing else in it is looked at.
    """
    flag, folder, rest = _take_config_folder(arguments)
    if folder is None:
        return arguments
    found = False
    for k, argument in enumerate(rest):
        key, _, name = argument.partition("=")
        if key == MODEL and (file := folder / MODEL / f"{name}.yaml").is_file():
            rest[k], found = f"{MODEL}={file}", True
    only_models = found and all(path.parent == folder / MODEL for path in folder.rglob("*.y*ml"))
    return rest if only_models else [*flag, *rest]


def _take_config_folder(arguments: list[str]) -> tuple[list[str], Path | None, list[str]]:
    """Hydra's option for a further folder of configurations as it was given, that folder, and the
    other arguments.
    """
    for k, argument in enumerate(arguments):
        option, equals, value = argument.partition("=")
        if option not in CONFIG_FOLDER:
            continue
        end = k + 1 if equals else k + 2
        folder = value if equals else "".join(arguments[k + 1 : end])
        return (
            arguments[k:end],
            Path(folder) if folder else None,
            [*arguments[:k], *arguments[end:]],
        )
    return [], None, arguments


@functools.cache
def list_groups() -> tuple[str, ...]:
    """The groups whose members are chosen by name."""
    from tractexp.configuration.choices import read_default_choices

    own = (name.removeprefix("override ") for name in read_default_choices())
    return ("hydra", *own, "model/motor", "model/static")


def _expand_choices(group: str, value: str) -> list[str]:
    """The overrides that a list chosen in a group stands for."""
    from tractexp.configuration.plugin import join_choices

    listed = _split_at_commas(value.strip()[1:-1])
    node = join_choices(group, [part.strip() for part in listed])
    name, ((setting, names),) = node.pop("name"), node.items()
    key = f"{group.replace('/', '.')}.{setting}"
    if not (value.strip().startswith("[") and value.strip().endswith("]")) or any(
        "[" in part for part in listed
    ):
        raise UserError(
            f"{group}={value} is not one list of names; a sweep over lists is written"
            f" {group}={name} {key}=[a,b],[c,d]"
        )
    return [f"{group}={name}", f"{key}=[{','.join(names)}]"]


def quote_override(argument: str) -> str:
    """An argument as Hydra reads it.

    `model.bounds.C=[0.5,0.9]` adds the entry it names, for which Hydra would ask a plus sign. Names
    of files and channels with spaces, brackets or letters of any script are quoted, for which Hydra
    would ask inner quotes.
    """
    key, equals, value = argument.partition("=")
    if equals and key == MODEL:
        chosen = [value] if _names_a_file(value) else _split_at_commas(value)  # a sweep has several
        return f"{key}={','.join(map(_quote_model_choice, chosen))}"
    if equals and key.lstrip("+~").startswith(NAMING) and not _read_by_hydra(argument, value):
        argument = f"{key}={_quote_override_value(value)}"
    return f"++{argument}" if argument.startswith(OPEN) else argument


def _quote_model_choice(name: str) -> str:
    """A choice of a model as Hydra reads it: the path of a file whole and in quotes, another name
    as it stands.
    """
    if not is_model_path(name):
        return name
    file = Path(name).absolute()
    files.check_there(file)
    return quoting.hydra(str(file))


def build_typed_command(data: Mapping[str, object], *more: str) -> str:
    """The command, as a shell takes it, that reads records by these settings (`name` and the
    reader's own).
    """
    settings = dict(data)
    words = [
        f"data={settings.pop('name')}",
        *(format_assignment(f"data.{key}", value) for key, value in settings.items()),
    ]
    return quoting.shell("tractexp", *more, *words)


def survey_of(folder: str) -> str:
    """The command, as a shell takes it, that makes a table of the recordings in a folder."""
    return quoting.shell("tractexp", "task=survey", format_assignment("data.path", folder))


def format_assignment(key: str, value: object) -> str:
    """KEY=VALUE as `override` and Hydra read it back: numbers, texts, true and false, and lists of
    them.
    """
    if isinstance(value, list | tuple):
        return f"{key}=[{','.join(map(_write_for_hydra, value))}]"
    is_quoted = isinstance(value, str) and _is_quoted_whole(value)
    return f"{key}={value if is_quoted else _write_for_hydra(value)}"


def _is_quoted_whole(value: str) -> bool:
    """Whether `override` quotes a value by itself: brackets behind a space are no function."""
    return _write_for_hydra(re.sub(r"\B[()]|[()]\B", "", value))[:1] != "'"


def _write_for_hydra(value: object) -> str:
    """A value as Hydra reads it, with quotes where it needs some."""
    if isinstance(value, Mapping):
        return f"{{{','.join(f'{key}:{_write_for_hydra(inner)}' for key, inner in value.items())}}}"
    if isinstance(value, str):
        plain = WORD.search(value) and value == value.strip() and not NO_NAME.fullmatch(value)
        return value if plain and not set(value) & MARKS else quoting.hydra(value)
    return (
        "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
    )


def _read_by_hydra(argument: str, value: str) -> bool:
    """Whether Hydra takes the value as it stands, and what names a file as that name."""
    return PLAIN.fullmatch(value) is not None or (
        not _names_a_file(value) and _is_readable(argument)
    )


def _names_a_file(value: str) -> bool:
    """Whether a value is the path of a file that is there."""
    return bool(value) and files.exists(value)


def _is_readable(argument: str) -> bool:
    """Whether Hydra can read an argument."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    try:
        OverridesParser.create().parse_override(argument)
    except HydraException:
        return False
    return True


def _quote_override_value(value: str) -> str:
    """A value in quotes; of a list, each of its elements that Hydra would not read."""
    if value.startswith("[") and value.endswith("]") and not _names_a_file(value):
        return (
            f"[{','.join(_quote_element(part.strip()) for part in _split_at_commas(value[1:-1]))}]"
        )
    return quoting.hydra(value, literal=_names_a_file(value))


def _quote_element(text: str) -> str:
    """An element of a list, with quotes where it needs some."""
    quoted = len(text) > 1 and text[0] == text[-1] and text[0] in "'\""
    return text if quoted or PLAIN.fullmatch(text) else _quote_override_value(text)


DEEPER = {"[": 1, "(": 1, "{": 1, "]": -1, ")": -1, "}": -1}  # levels of brackets, by letter


def _split_at_commas(inner: str) -> list[str]:
    """The parts of a text between commas that stand outside quotes and brackets."""
    parts, depth, mark, start = [], 0, "", 0
    for i, letter in enumerate(inner):
        if mark:
            mark = "" if letter == mark else mark
        elif letter in "'\"" and not inner[start:i].strip():  # an apostrophe within a name is none
            mark = letter
        elif letter in DEEPER:
            depth += DEEPER[letter]
        elif letter == "," and depth == 0:
            parts.append(inner[start:i])
            start = i + 1
    return [*parts, inner[start:]] if inner else []
