"""`tractexp --help` and `tractexp list`: what can be chosen, without composing a configuration."""

import argparse
import re
import shutil
import textwrap
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from tractexp.configuration.choices import (
    FEWEST_VARIANTS,
    Option,
    find_families,
    group_variants,
    read_choices,
    read_default_choices,
    take_first_sentence,
)
from tractexp.errors import UserError, list_allowed

WIDEST_HELP = 100  # columns
MOST_HELP_NAMES = 9  # names of a group that fit into two lines of the help, or three

GROUPS = {
    "task": "what to do",
    "domain": "what is compared",
    "model": "a motor and a static load",
    "model/motor": "the motor's equations",
    "model/static": "the static load's equations",
    "effect": "what a model may lack, added by model.effects=[NAME,...]",
    "optimizer": "how the parameters are searched",
    "objective": "what the search makes small",
    "data": "the records",
    "connection": "how the channels of a recording are connected, chosen by data.connection=NAME",
    "estimator": "how phasors are measured from waveforms, chosen by data.estimator=NAME",
    "format": "what task=export writes, chosen by task.format=NAME",
    "writer": "what task=convert writes, chosen by task.to=NAME",
    "experiment": "a task with its settings, such as a table of the paper",
    "hydra/launcher": "where the jobs of a sweep run; by default on the cores of this computer",
}
# groups that the help shows elsewhere, or leaves to `tractexp list`
LATER = ("task", "connection", "estimator", "format", "writer", "hydra/launcher")

TEXT = """\
tractexp: identify the parameters of a traction load from recorded voltage dips

The commonest
  tractexp look station.cfg       (or tractexp station.cfg)
      what a file holds: its loads, what happened, what is worth fitting, and the command for it
  tractexp data=csv 'data.train=[dip1.csv]'
      identify a load from a dip (columns t,U,P,Q): how well it fits, how sure each parameter is
  tractexp task=discrepancy data=csv 'data.train=[dip1.csv,dip2.csv]' 'data.validate=[dip3.csv]'
      name the effect that the model lacks, and show the gap shrink
  tractexp again RUN_FOLDER task=discrepancy         an earlier run with other settings on top
  tractexp --all ...              all that a run has to say, instead of one screen
  tractexp ui                     look at all that was logged, in a browser on this computer only
  tractexp doctor                 whether all here is sound; tractexp sync: log what was not logged
  tractexp new effect NAME        write a package with an effect of your own, and its test

Tasks, chosen by task=NAME; {task} by default
{tasks}

What else can be chosen, by GROUP=NAME (effects by model.effects=[NAME,...])
{groups}
  tractexp list GROUP        every name of a group with a line on each; without GROUP, of all

Values are changed by KEY=VALUE
  tractexp optimizer.population=100 model.bounds.C=[0.8,0.95] budget=5000 seed=7
  tractexp -m optimizer=issa,ssa,pso 'seed=range(0,30)'        a sweep, and which is better
  tractexp --cfg job                                           every setting of the present choice
  tractexp --hydra-help                                        Hydra's options
  eval "$(tractexp -sc install=bash)"                          completion of groups, names and keys
"""


def describe_usage() -> str:
    """The text of `tractexp --help`."""
    options = read_choices()
    tasks = {
        name: re.split("[:;] ", options["task"][name].about)[0]
        for name in _sort_names("task", options["task"])
    }
    groups = {
        group: _summarize_group(group, options[group])
        for group in _order_groups(options)
        if group not in LATER
    }
    return TEXT.format(
        task=read_default_choices()["task"],
        tasks=_fold_columns(tasks),
        groups=_fold_columns(groups),
    )


def print_choices(arguments: list[str]) -> int:
    """`tractexp list [GROUP or NAME ...]`: print every name with a sentence on each; returns the
    exit code.

    Of a NAME that has variants these are printed. Raises `UserError` for what is neither.
    """
    given = _parse_list_arguments(arguments)
    options = read_choices([] if given.config_dir is None else [given.config_dir])
    chosen = _select_groups(given.group, options)
    options, refused = _import_choices(options)
    width = min(WIDEST_HELP, shutil.get_terminal_size((WIDEST_HELP, 24)).columns)
    print(
        "\n\n".join(
            _describe_choices(name, options, width) for name in chosen or _order_groups(options)
        )
    )
    for why in refused:
        print(f"\nleft out: {why}")
    return 0


def _parse_list_arguments(arguments: list[str]) -> argparse.Namespace:
    """`group` and `config_dir` of a command line. Raises `UserError` for a folder that is not
    there.
    """
    about = (
        "Show what can be chosen: every name of a group with a line on each; without GROUP, of all"
        " groups."
    )
    parser = argparse.ArgumentParser(prog="tractexp list", description=about)
    parser.add_argument("group", nargs="*", metavar="GROUP")
    parser.add_argument(
        "-cd",
        "--config-dir",
        type=Path,
        metavar="FOLDER",
        help="a folder of configurations of yours",
    )
    given = parser.parse_args(arguments)
    if given.config_dir is not None and not given.config_dir.is_dir():
        raise UserError(
            f"tractexp list: there is no folder {given.config_dir}; -cd names one of configurations"
        )
    return given


def _select_groups(typed: Sequence[str], options: Mapping[str, Mapping[str, Option]]) -> list[str]:
    """The groups and names that are meant. Raises `UserError` for what is neither.

    `static` is `model/static`, as `tractexp new static` has it.
    """
    short = {group.rpartition("/")[2]: group for group in options}
    names = [group.rstrip("/=") for group in typed]
    chosen = [short.get(name) or name for name in names]
    for name in chosen:
        if name not in options and not _find_group_of_variants(name, options):
            raise UserError(f"there is no group '{name}'{_describe_holders(name, options)}")
    return chosen


def _describe_choices(name: str, options: Mapping[str, Mapping[str, Option]], width: int) -> str:
    """Return what there is of a group, or of a name that has variants."""
    if name in options:
        return _describe_group(name, options[name], width)
    return _describe_variants(name, options[_find_group_of_variants(name, options)], width)


def _find_group_of_variants(name: str, options: Mapping[str, Mapping[str, Option]]) -> str:
    """Return the group in which a name has variants; "" where there is none."""
    for group in _order_groups(options):
        if group_variants(options[group]).get(name):
            return group
    return ""


def _describe_holders(name: str, options: Mapping[str, Mapping[str, Option]]) -> str:
    """Return the end of a sentence on a name that is no group: the groups that hold it, or all
    groups.
    """
    holders = [
        f"'tractexp list {group}'" for group in _order_groups(options) if name in options[group]
    ]
    if holders:
        return f", but there is such a name in {' and '.join(holders)}"
    return list_allowed(name, options, "Groups")


def _import_choices(
    options: Mapping[str, Mapping[str, Option]],
) -> tuple[dict[str, dict[str, Option]], list[str]]:
    """The choices as they are once every plugin is imported, and why those that fit no group cannot
    be.
    """
    from tractexp.configuration.plugin import discover, list_refused

    refused = list_refused()
    result = {group: dict(names) for group, names in options.items()}
    for group, classes in discover().items():
        # also those registered by a program, which are in no file
        for name, cls in classes.items():
            result.setdefault(group, {})[name] = Option(
                name, take_first_sentence(cls.__doc__ or ""), cls.__module__
            )
    placed = set()
    for names in result.values():
        for name, choice in names.items():
            if choice.module in refused:
                names[name] = Option(name, f"cannot be used: {refused[choice.module]}")
                placed.add(choice.module)
    return result, [why for module, why in refused.items() if module not in placed]


def _describe_group(group: str, names: Mapping[str, Option], width: int) -> str:
    """A group and its names, each with its sentence."""
    head = f"{group}: {GROUPS[group]}" if group in GROUPS else group
    if chosen := read_default_choices().get(group):
        head += f"; {chosen} by default"
    grouped = group_variants({name: names[name] for name in _sort_names(group, names)})
    rows = {base: names[base].about for base in grouped}
    for base, varied in grouped.items():
        if varied:
            rows[base] += f" {len(varied)} variants: tractexp list {base}"
    return f"{head}\n{_fold_columns(rows, width)}"


def _describe_variants(base: str, names: Mapping[str, Option], width: int) -> str:
    """Return a plugin and its variants, each with its sentence."""
    varied = sorted(group_variants(names)[base])
    return _fold_columns({name: names[name].about for name in [base, *varied]}, width)


def _summarize_group(group: str, names: Mapping[str, Option]) -> str:
    """The names of a group, variants counted beside what they vary; of many, how many."""
    families = find_families({name: names[name] for name in _sort_names(group, names)})
    parts = [
        f"{base} and {len(members) - 1} variants"
        if len(members) > FEWEST_VARIANTS
        else ", ".join(members)
        for base, members in families.items()
    ]
    more = f" and {len(parts) - MOST_HELP_NAMES + 1} others" if len(parts) > MOST_HELP_NAMES else ""
    return ", ".join(parts[: MOST_HELP_NAMES - 1] if more else parts) + more


def _order_groups(options: Mapping[str, object]) -> list[str]:
    """The groups, those that a person chooses in first."""
    return [*(group for group in GROUPS if group in options), *sorted(options.keys() - GROUPS)]


def _sort_names(group: str, names: Collection[str]) -> list[str]:
    """Names in order, `figure3` before `figure10`, and first of all the one that is chosen by
    default.
    """
    numbered = {
        name: [(word, int(digits or 0)) for word, digits in re.findall(r"(\D*)(\d*)", name)]
        for name in names
    }
    return sorted(
        names, key=lambda name: (name != read_default_choices().get(group), numbered[name])
    )


def _fold_columns(rows: Mapping[str, str], width: int = WIDEST_HELP) -> str:
    """Names in a column, and beside each its text, folded."""
    indent = 4 + max(map(len, rows), default=0)
    folded = textwrap.TextWrapper(max(width, indent + 30), subsequent_indent=" " * indent)
    folded.break_on_hyphens = folded.break_long_words = False
    return "\n".join(folded.fill(f"  {name:<{indent - 2}}{text}") for name, text in rows.items())
