"""`tractexp new KIND NAME`: a package with one plugin, and its test, to begin from.

The modules beside this one are the plugins that it copies. In a copy the name stands for `example`.
"""

import argparse
import keyword
import re
from pathlib import Path

from tractexp.configuration.choices import read_choices
from tractexp.errors import UserError
from tractexp.storage import files

KINDS = {  # {kind: (group, how the plugin is chosen)}
    "effect": ("effect", "model.effects=[{}]"),
    "static": ("model/static", "model/static={}"),
    "motor": ("model/motor", "model/motor={}"),
    "optimizer": ("optimizer", "optimizer={}"),
}
PROPOSED = "class ProposedEffect("  # in the plugin of a proposed term
PROJECT = """\
[build-system]
requires = ["setuptools>=65"]
build-backend = "setuptools.build_meta"

[project]
name = "{package}"
version = "0.1"
dependencies = ["tractexp"]

[project.entry-points."tractexp.plugins"]
{package} = "{package}"

[tool.setuptools]
packages = ["{package}"]
"""
TEST = """\
\"\"\"What every plugin must satisfy.\"\"\"

import tractexp.testing

TestContract = tractexp.testing.contract("{package}")
"""


def new(arguments: list[str]) -> int:
    """Write the package into the current folder, and say how to use it; returns the exit code.

    Raises `UserError` for a name that is none or is taken, and where the folder is already there.
    """
    about = "Write a package with one plugin and its test into the current folder."
    parser = argparse.ArgumentParser(prog="tractexp new", description=about)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument(
        "name", metavar="NAME", help="such as motor_heating: what configurations call it"
    )
    parser.add_argument(
        "--from", dest="source", type=Path, metavar="FILE", help="an effect proposed by tractexp"
    )
    options = parser.parse_args(arguments)
    package = write_package(options.kind, options.name, Path(), options.source)
    put = "read it before you use it" if options.source else "put your equations into it"
    print(f"wrote {package}: the plugin is {package / package.name / options.name}.py; {put}")
    print(f"  cd {package} && python -m pytest        tests whether it is a sound plugin")
    print(f"  python -m pip install -e {package}      installs it; then choose it by", end=" ")
    print(KINDS[options.kind][1].format(options.name))
    return 0


def write_package(kind: str, name: str, folder: Path, source: Path | None = None) -> Path:
    """Write the package of a plugin into `folder`; its own folder. Raises `UserError` as `new`.

    The plugin is our example of that kind, or what stands in the file `source` of a proposed term.
    """
    group, _ = KINDS[kind]
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise UserError(
            f"'{name}' cannot be the name of a plugin, which is that of its file; take lower-case"
            " letters, digits and underscores, such as motor_heating"
        )
    if taken := read_choices().get(group, {}).get(name):
        raise UserError(
            f"the {group} '{name}' is there already ({taken.module or 'a configuration'}); take"
            " another name"
        )
    package = f"tractexp_{name}"
    place = folder / package
    if place.exists():
        raise UserError(
            f"{place} is there already and is not overwritten; take another name, or another folder"
        )
    title = "".join(word.capitalize() for word in name.split("_"))
    code = _copy_proposal(source, title) if source else _copy_example(kind, name, title)
    contents = {
        "pyproject.toml": PROJECT.format(package=package),
        f"test_{name}.py": TEST.format(package=package),
        f"{package}/__init__.py": f'"""The plugin {name} for tractexp."""\n',
        f"{package}/{name}.py": code,
    }
    for path, text in contents.items():
        files.write(place / path, text)
    return place


def _copy_example(kind: str, name: str, title: str) -> str:
    """The example's code under another name."""
    code = Path(__file__).with_name(f"{kind}.py").read_text(encoding="utf-8")
    return code.replace("Example", title).replace("example", name)


def _copy_proposal(source: Path, title: str) -> str:
    """The text of a proposed term's plugin, its class named anew. Raises `UserError` for what is
    none.
    """
    files.check_there(source)
    code = files.read(source).decode(errors="replace")
    if PROPOSED not in code:
        raise UserError(
            f"{source} is no term that tractexp has proposed (task=discrepancy writes"
            " proposed_effect.py)"
        )
    return code.replace(PROPOSED, f"class {title}(")
