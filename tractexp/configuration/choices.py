"""What can be chosen in each group, read from the files that declare it.

Nothing is imported, so that `--help` takes no time and a plugin that cannot be imported hides none
of the others. A plugin is a class decorated with `@plugin` in a module of a plugin package, in the
group that its bases declare; a configuration is a YAML file in a package's `conf/` folder. Names
that start with an underscore are nobody's choice.
"""

import ast
import functools
import importlib.metadata
import importlib.util
import pkgutil
import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from tractexp.errors import suggest_nearest

ENTRY_POINTS = "tractexp.plugins"
FEWEST_VARIANTS = 3  # of a plugin that are told as a number
PACKAGE = Path(__file__).resolve().parents[1]
# in a wheel, in a clone
CONF = next(p for p in (PACKAGE / "conf", PACKAGE.parent / "conf") if (p / "config.yaml").is_file())


@dataclass(frozen=True)
class Option:
    """A name that a group offers: what it is, in a sentence, and the module of its class ("" for a
    configuration).
    """

    name: str
    about: str
    module: str = ""


def read_choices(own: Iterable[Path] = ()) -> dict[str, dict[str, Option]]:
    """{group: {name: option}}. Its sentence is a plugin's docstring, or a configuration's leading
    comment.

    `own` are further folders of configurations, as Hydra's `-cd` names one.
    """
    options: dict[str, dict[str, Option]] = defaultdict(dict)
    for folder in (CONF, *list_configuration_folders(), *own):
        for file in folder.rglob("*.yaml"):
            place = file.relative_to(folder).with_suffix("")
            if len(place.parts) > 1 and not any(part.startswith("_") for part in place.parts):
                options[place.parent.as_posix()][place.name] = Option(
                    place.name, _read_comment(file)
                )
    for package, folder in list_plugin_folders():
        for module in list_modules(package, [str(folder)]):
            for group, about in list_declared_plugins(module):
                name = module.rpartition(".")[2]
                options[group][name] = Option(name, about, module)
    return options


@functools.cache
def read_default_choices() -> dict[str, str]:
    """{group: what is chosen where nothing else is}: that of `conf/config.yaml`."""
    import yaml

    content = yaml.safe_load((CONF / "config.yaml").read_text(encoding="utf-8"))
    return {
        group: name
        for item in content["defaults"]
        if isinstance(item, dict)
        for group, name in item.items()
    }


def describe_elsewhere(group: str, name: str) -> str:
    """The end of a sentence on a name that is another group's: ", but there is task=plan"; "" where
    it is none's.
    """
    holders = [
        g
        for g, names in read_choices().items()
        if name in names and g != group and (g in read_default_choices() or "/" in g)
    ]
    return (
        f", but there is {' and '.join(f'{g}={name}' for g in sorted(holders))}" if holders else ""
    )


@functools.cache
def read_replacements(group: str, name: str) -> dict[str, str]:
    """{group: choice} that the configuration `group=name` puts in the place of the usual ones."""
    import yaml

    content = yaml.safe_load((CONF / group / f"{name}.yaml").read_text(encoding="utf-8"))
    items = [item for item in content.get("defaults", ()) if isinstance(item, dict)]
    return {
        key.removeprefix("override /"): chosen for item in items for key, chosen in item.items()
    }


@functools.cache
def set_holding(sources: tuple[str, ...]) -> str:
    """The shipped choice of data that fits these files and holds further ones out; "" where there
    is none.
    """
    import yaml

    for file in sorted((CONF / "data").glob("*.yaml")):
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
        if content.get("validate") and set(sources) <= set(content.get("train") or ()):
            return file.stem
    return ""


def find_varied(name: str, plugins: Collection[str]) -> str:
    """Return the plugin that a configuration varies, by its name: `issa` of `issa_no_levy`."""
    stems = [plugin for plugin in plugins if name.startswith(f"{plugin}_")]
    return name if name in plugins or not stems else max(stems, key=len)


def find_families(names: Mapping[str, Option]) -> dict[str, list[str]]:
    """Return {plugin: its names, itself among them} of the names of a group."""
    plugins = {name for name, option in names.items() if option.module}
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(find_varied(name, plugins), []).append(name)
    return families


def group_variants(names: Mapping[str, Option]) -> dict[str, list[str]]:
    """Return {name: what varies it, in order} of the names of a group.

    Fewer than `FEWEST_VARIANTS` stand for themselves.
    """
    grouped: dict[str, list[str]] = {}
    for base, members in find_families(names).items():
        varied = [name for name in members if name != base]
        if len(varied) >= FEWEST_VARIANTS:
            grouped[base] = varied
        else:
            grouped |= {name: [] for name in members}
    return grouped


def describe_available(group: str, name: str, names: Iterable[str]) -> str:
    """Return the end of a sentence on an unknown choice: the nearest, and all but variants."""
    names = sorted(names)
    plugins = read_choices().get(group, {})
    grouped = group_variants({name: plugins.get(name, Option(name, "")) for name in names})
    parts = [
        f"{base} and {len(varied)} variants" if varied else base
        for base, varied in sorted(grouped.items())
    ]
    return f"{suggest_nearest(name, names) or '.'} Available: {', '.join(parts) or 'none'}"


def describe_nameless(group: str) -> str:
    """Return the sentence on a choice that names no plugin of its group, with those there are."""
    plugins = sorted(o.name for o in read_choices().get(group, {}).values() if o.module)
    return (
        f"{group} lacks the name of what is chosen; write {group}=NAME, or begin its file with"
        f" 'defaults: [NAME]'. Names: {', '.join(plugins) or 'none'}"
    )


def list_entry_points() -> list[importlib.metadata.EntryPoint]:
    """The plugin packages that are installed, in order of name."""
    return sorted(
        importlib.metadata.entry_points(group=ENTRY_POINTS), key=lambda p: (p.name, p.value)
    )


@functools.cache
def list_plugin_folders() -> tuple[tuple[str, Path], ...]:
    """(package, folder) of the plugin packages that are there."""
    names = dict.fromkeys(point.module for point in list_entry_points())
    return tuple((name, folder) for name in names for folder in _find_folders(name))


def list_configuration_folders() -> list[Path]:
    """The `conf/` folders of the plugin packages, of which the last that has a file is the one that
    is read.
    """
    return [folder / "conf" for _, folder in list_plugin_folders() if (folder / "conf").is_dir()]


def list_modules(package: str, folders: Iterable[str]) -> Iterator[str]:
    """The modules below a package, in its subpackages too, that do not start with an underscore."""
    for folder in folders:
        for info in pkgutil.iter_modules([folder]):
            if not info.name.startswith("_"):
                yield f"{package}.{info.name}"
            if info.ispkg:
                yield from list_modules(f"{package}.{info.name}", [str(Path(folder, info.name))])


def take_first_sentence(text: str) -> str:
    """The first sentence of a text, on one line."""
    first = " ".join(text.strip().partition("\n\n")[0].split())
    return re.split(r"(?<=[.!?])\s+(?=[A-Z])", first)[0]


def _read_comment(file: Path) -> str:
    """The first sentence of the comment a file begins with, beyond Hydra's directives and the
    command it stands for.
    """
    lines = []
    for line in file.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        text = line.lstrip("# ")
        if not text.startswith(("@package", "python -m", "tractexp ")):
            lines.append(text)
    return take_first_sentence("\n".join(lines))


def list_declared_plugins(module: str) -> Iterator[tuple[str, str]]:
    """(group, first sentence) of the plugins that a module declares."""
    for node in _parse_module(module).body:
        if not (
            isinstance(node, ast.ClassDef)
            and any(_name_last_part(d) == "plugin" for d in node.decorator_list)
        ):
            continue
        if group := _find_group(node, module, ()):
            yield group, take_first_sentence(ast.get_docstring(node) or "")


def _find_group(node: ast.ClassDef, module: str, passed: tuple[ast.ClassDef, ...]) -> str:
    """The group that a class or its first base to know declares; "" where the bases
    lead nowhere.
    """
    for item in node.body:
        if isinstance(item, ast.AnnAssign | ast.Assign) and isinstance(item.value, ast.Constant):
            targets = item.targets if isinstance(item, ast.Assign) else [item.target]
            if "group" in map(_name_last_part, targets):
                return str(item.value.value)
    for base in node.bases:
        met, there = _find_class(_name_last_part(base), module, {module})
        if (
            met is not None
            and met not in (node, *passed)
            and (group := _find_group(met, there, (*passed, node)))
        ):
            return group
    return ""


def _find_class(name: str, module: str, visited: set[str]) -> tuple[ast.ClassDef | None, str]:
    """The class that a module calls by this name, and its module: followed through `from ...
    import`, as by Python.
    """
    for node in _parse_module(module).body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return node, module
        if isinstance(node, ast.ImportFrom):
            there = _resolve_import(node, module)
            for alias in node.names:
                if (alias.asname or alias.name) == name and there not in visited:
                    return _find_class(alias.name, there, visited | {there})
    return None, module


def _resolve_import(node: ast.ImportFrom, module: str) -> str:
    """The whole name of what a module imports from, relative or not."""
    if not node.level:
        return node.module or ""
    package = module.split(".")[: -node.level + bool(_find_folders(module)) or None]
    return ".".join([*package, *([node.module] if node.module else [])])


def _name_last_part(node: ast.expr) -> str:
    """`plugin` of `@plugin`, of `@extend.plugin` and of `@plugin()`."""
    if isinstance(node, ast.Call):
        node = node.func
    return (
        node.attr
        if isinstance(node, ast.Attribute)
        else node.id
        if isinstance(node, ast.Name)
        else ""
    )


@functools.cache
def _parse_module(module: str) -> ast.Module:
    """A module parsed; an empty one where it cannot be, for then Python says why when it is
    imported.
    """
    file = _find_source(module)
    try:
        return ast.parse(file.read_bytes()) if file else ast.Module([], [])
    except (SyntaxError, ValueError, OSError):
        return ast.Module([], [])


def _find_source(module: str) -> Path | None:
    """The file of a module; None where it is not there."""
    package, _, name = module.rpartition(".")
    own = [folder / "__init__.py" for folder in _find_folders(module)]
    return next(
        (
            f
            for f in (*own, *(folder / f"{name}.py" for folder in _find_folders(package)))
            if f.is_file()
        ),
        None,
    )


@functools.cache
def _find_folders(package: str) -> tuple[Path, ...]:
    """The folders of a package; none where there is none. Only the topmost is looked up, so that no
    code runs.
    """
    top, _, rest = package.partition(".")
    try:
        spec = importlib.util.find_spec(top) if top else None
    except (ImportError, ValueError):
        return ()
    paths = (
        Path(p, *rest.split(".")) if rest else Path(p)
        for p in (spec and spec.submodule_search_locations) or ()
    )
    return tuple(folder for folder in paths if folder.is_dir())
