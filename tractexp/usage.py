"""`tractexp --help`: the groups and their choices, told without composing a configuration."""

import textwrap
from collections import defaultdict
from pathlib import Path

from tractexp import plugin

TOLD = ("task", "model", "model/motor", "model/static", "optimizer", "objective", "data", "experiment")

TEXT = """\
tractexp: identify the parameters of a traction load from recorded voltage dips

Choose with GROUP=NAME, change a value with KEY=VALUE:

{groups}

Effects are added by model.effects=[NAME,...].

Examples
  tractexp optimizer=pso data=tibet_30pct seed=3
  tractexp data=csv 'data.train=[dip1.csv]' 'data.validate=[dip2.csv]'
  tractexp -m optimizer=issa,ssa,pso 'seed=range(0,30)'      a sweep
  tractexp task=compare                                       the newest sweep, compared
  tractexp task=discrepancy data=csv 'data.train=[dip1.csv,dip2.csv]' 'data.validate=[dip3.csv]'
  tractexp ui                                                 the MLflow UI, on this computer only

  tractexp --cfg job             every setting of the present choice
  tractexp --hydra-help          the options of Hydra, which composes the configuration
  eval "$(tractexp -sc install=bash)"        completion of groups, choices and keys
"""


def usage(conf: Path) -> str:
    """The text of `--help`; `conf` is the folder of our own configurations."""
    choices: dict[str, set[str]] = defaultdict(set)
    for group, classes in plugin.discover().items():
        choices[group] |= set(classes)
    for folder in (conf, *plugin.configuration_folders()):
        for file in folder.rglob("*.yaml"):
            choices[file.parent.relative_to(folder).as_posix()].add(file.stem)
    groups = "\n".join(_listed(group, choices[group]) for group in (*TOLD, "effect"))
    return TEXT.format(groups=groups)


def _listed(label: str, names: set[str]) -> str:
    """A group and its choices, folded beneath each other."""
    start = f"  {label:<{max(map(len, TOLD))}}  "
    return textwrap.fill(", ".join(sorted(names)), 118, initial_indent=start, subsequent_indent=" " * len(start))
