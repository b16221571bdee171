"""Plugins: one file, one class, one registered name.

A plugin subclasses one of the framework's bases (`Motor`, `Static`, `Optimizer`, `Reader`, ...), is
decorated with `@plugin`, and is chosen in YAML or on the command line by its file's name. Its
annotated fields are its settings: from them the Hydra schema is derived, so unknown keys and wrong
types are refused when the configuration is composed. Its `Parameter` attributes are what an
identification may estimate.

Packages are found through the entry point group `tractexp.plugins`; every module of such a package
that does not start with an underscore is imported, and its `conf/` folder, if any, joins Hydra's
search path. The built-in plugins come in by that same door.
"""

import dataclasses
import functools
import importlib
import inspect
import itertools
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, dataclass_transform, get_type_hints

from tractexp.configuration.choices import CONF as CONF
from tractexp.configuration.choices import (
    describe_nameless,
    list_declared_plugins,
    list_entry_points,
    list_modules,
    list_plugin_folders,
)
from tractexp.configuration.choices import (
    list_configuration_folders as list_configuration_folders,
)
from tractexp.errors import Unknown, UserError, list_allowed, name_setting
from tractexp.parameter import Parameter

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


class Plugin:
    """Base of all plugin bases. `group` is the Hydra group its plugins are chosen in."""

    group: ClassVar[str]
    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    chosen: ClassVar[bool] = True  # by a Hydra group; False: by names within a setting
    sourced: ClassVar[bool] = True  # the docstring must say where the equations come from
    members: "tuple[Plugin, ...]" = ()  # plugins that it is made of
    # its setting that takes the names, where a list is chosen in its group
    listed: ClassVar[str] = ""

    @property
    def label(self) -> str:
        """The plugin's name in sentences."""
        return self.name

    def check(self) -> None:
        """Raise `UserError` for a setting out of range. Called once, when the plugin is built."""

    @classmethod
    def check_class(cls, where: str) -> None:
        """Raise `UserError`, starting with `where`, for what is declared wrongly. Called at
        registration.
        """


# {group: {name of a method in version 0.2: its name now}}: a plugin that defines the old one is
# taken as if it defined the new one
RENAMED_METHODS: Mapping[str, Mapping[str, str]] = {
    "effect": {"shown": "describe_sign"},
    "model/static": {"damping": "compute_damping"},
    "format": {"simulated": "play_back_dip"},
    "data": {"of": "build_settings"},
    "task": {"logged": "collect_log"},
}

SETTING_TYPES = (bool, int, float, str, list)

Class = TypeVar("Class", bound=type[Plugin])
_registry: dict[str, dict[str, type[Plugin]]] = {}
_schemas: dict[type[Plugin], type] = {}
_refused: dict[str, str] = {}  # {package or module that cannot be used: the sentence on why}


@dataclass_transform(kw_only_default=True, frozen_default=True)
def plugin(cls: Class) -> Class:
    """Register a plugin class under its module's name, in its base's group; one that is defined in
    a program or a notebook itself goes by the class: `DrawAgain` is `draw_again`.

    Its annotated fields become its settings: the class is a frozen, keyword-only dataclass then.

    Parameters
    ----------
    cls : type
        A subclass of one of the framework's bases.

    Returns
    -------
    type
        The class, with `name` and `parameters`.

    Raises
    ------
    UserError
        When the name is taken, when the class belongs to no group or lacks a method its base leaves
        to it, when its docstring does not say where its equations come from (a line starting with
        "Source:"), and for what its base and its parameters find declared wrongly.
    """
    name = cls.__module__.rpartition(".")[2]
    if name == "__main__":
        name = re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()
    where = f"plugin {cls.__module__}.{cls.__qualname__}"
    if file := getattr(sys.modules.get(cls.__module__), "__file__", None):
        where += f" ({Path(file).name})"
    group = getattr(cls, "group", None)
    if group is None:
        raise UserError(
            f"{where} must subclass one of the framework's bases (Motor, Static, Optimizer, Reader,"
            " ...)"
        )
    _check_source(cls, where)
    for old, new in RENAMED_METHODS.get(group, {}).items():
        if old in vars(cls):
            setattr(cls, new, vars(cls)[old])
    others = _registry.setdefault(group, {})
    if name in others and others[name].__module__ != cls.__module__:
        raise UserError(
            f"{where}: the name '{name}' in group '{group}' is taken by {others[name].__module__};"
            " rename the file"
        )
    _check_complete(cls, where)
    _check_typed(cls, where)
    plugin_class = dataclasses.dataclass(frozen=True, kw_only=True)(cls)
    plugin_class.name = name
    plugin_class.parameters = _collect_parameters(plugin_class, where)
    plugin_class.check_class(where)
    others[name] = plugin_class
    return plugin_class


def _check_source(cls: type[Any], where: str) -> None:
    """Raise `UserError` for a class whose equations come from nowhere."""
    if not cls.sourced or "Source:" in (cls.__doc__ or ""):
        return
    if sys.flags.optimize > 1:
        raise UserError(
            "python -OO takes away the docstrings in which plugins name their sources; run without"
            " -OO"
        )
    raise UserError(f"{where} needs a docstring with a line 'Source: author year, equation'")


def _check_complete(cls: type[Any], where: str) -> None:
    """Raise `UserError` for a class that leaves a method of its base undefined."""
    methods = ((name, getattr(cls, name)) for name in dir(cls))
    missing = sorted(n for n, method in methods if getattr(method, "__isabstractmethod__", False))
    if missing:
        raise UserError(
            f"{where} lacks what every plugin of group '{cls.group}' must do: define"
            f" {' and '.join(missing)}"
        )


def _check_typed(cls: type[Any], where: str) -> None:
    """Raise `UserError` for a value that its author means as a setting and that has no type."""
    typed, *typed_above = map(inspect.get_annotations, cls.__mro__)
    base = cls.__mro__[1]
    settings = {f.name for f in dataclasses.fields(base)} if dataclasses.is_dataclass(base) else ()
    known = {*dir(base), *itertools.chain(*typed_above)} - {*settings}
    for name, value in vars(cls).items():
        if name in typed or name in known or name.startswith("_") or name.isupper():
            continue
        if isinstance(value, SETTING_TYPES):
            raise UserError(
                f"{where}: '{name} = {value!r:.40}' has no type, so it is no setting; write"
                f" '{name}: {type(value).__name__} = {value!r:.40}', or '_{name}' for what nobody"
                " sets"
            )


def _collect_parameters(cls: type[Plugin], where: str) -> tuple[Parameter, ...]:
    """The parameters of a class, inherited ones first, by name: its own replaces an inherited one
    of that name.

    Raises `UserError` for one that is declared wrongly.
    """
    parameters: dict[str, Parameter] = {}
    for base in reversed(cls.__mro__):
        for name, parameter in vars(base).items():
            if isinstance(parameter, Parameter):
                if parameter.name != name:
                    raise UserError(
                        f"{where}: '{name}' is the parameter '{parameter.name}' again, and a"
                        " parameter has one name; write it out a second time"
                    )
                parameter.check(f"{where}: {name}")
                parameters[name] = parameter
    return tuple(parameters.values())


def make_schema(cls: type[Plugin]) -> type:
    """The dataclass Hydra checks a plugin's configuration against: its name and its settings."""
    if cls not in _schemas:
        fields: list[Any] = [("name", str, dataclasses.field(default=cls.name))]
        types = get_type_hints(cls)
        for item in dataclasses.fields(cls):  # type: ignore[arg-type]
            default: Any = {"default": item.default, "default_factory": item.default_factory}
            fields.append((item.name, types[item.name], dataclasses.field(**default)))
        _schemas[cls] = dataclasses.make_dataclass(f"{cls.__name__}Config", fields)
    return _schemas[cls]


@functools.cache
def import_packages() -> tuple[Any, ...]:
    """The packages behind the entry points that can be imported, in order of name."""
    found = [
        package
        for point in list_entry_points()
        for package in _try_import(point.module, _import_package, point)
    ]
    return tuple(dict.fromkeys(found))


def place_in_plugin(error: BaseException) -> str:
    """File and line of the innermost traceback frame that lies in a plugin; "" if none does.

    Our own tasks are imported as plugins are, but what fails in them is our mistake.
    """
    foreign_packages = [
        package for package in import_packages() if not package.__name__.startswith("tractexp.")
    ]
    folders = [Path(path) for package in foreign_packages for path in package.__path__]
    frames = [
        (frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)
    ]
    inside = [
        (name, line)
        for name, line in frames
        if any(Path(name).is_relative_to(folder) for folder in folders)
    ]
    return f"{inside[-1][0]}, line {inside[-1][1]}" if inside else ""


@functools.cache
def discover() -> Mapping[str, Mapping[str, type[Plugin]]]:
    """Import every plugin module once and return {group: {name: class}}.

    A module that cannot be used hides none of the others: `list_refused` tells why it cannot, and
    so does `get` where its plugin is chosen.
    """
    names = [
        name
        for package in import_packages()
        for name in list_modules(package.__name__, package.__path__)
    ]
    for module in [module for name in names for module in _try_import(name, _import_module, name)]:
        _try_import(module.__name__, _check_decorated, module)
    return _registry


def list_refused() -> Mapping[str, str]:
    """{package or module: the sentence on why it cannot be used} of all that are installed."""
    discover()
    return _refused


def list_refused_choices() -> Iterator[tuple[str, str]]:
    """(group, name) of each plugin whose module cannot be used."""
    for module in list_refused():
        for group, _ in list_declared_plugins(module):
            yield group, module.rpartition(".")[2]


def _try_import(name: str, function: Callable[[Any], Any], argument: Any) -> list[Any]:
    """What a function returns of a package or module, in a list; an empty list where it refuses it,
    which `_refused` keeps.
    """
    try:
        return [function(argument)]
    except UserError as error:
        _refused[name] = str(error)
        return []


def list_registered() -> Mapping[str, Mapping[str, type[Plugin]]]:
    """{group: {name: class}} of what was imported so far."""
    return _registry


def import_all(packages: Iterable[ModuleType]) -> None:
    """Import every module of some packages that does not start with an underscore.

    Raises `UserError` with file and line for a module that cannot be imported, and for a class in
    it that is not decorated with `@plugin`.
    """
    imported = [
        _import_module(name)
        for package in packages
        for name in list_modules(package.__name__, package.__path__)
    ]
    for module in imported:
        _check_decorated(module)


def _import_package(point: "EntryPoint") -> ModuleType:
    """The package of an entry point. Raises `UserError` for one that cannot be imported, or is a
    single file.
    """
    what = f"the plugin package '{point.value}' (entry point '{point.name}')"
    with _import_error(what):
        package = point.load()
    if not hasattr(package, "__path__"):
        raise UserError(
            f"{what} is a single file; make it a folder with an __init__.py and a file for each"
            " plugin"
        )
    return package


def _import_module(name: str) -> ModuleType:
    """The module of a plugin. Raises `UserError` with the reason where it cannot be imported."""
    with _import_error(f"the plugin module '{name}'"):
        return importlib.import_module(name)


def _check_decorated(module: ModuleType) -> None:
    """Raise `UserError` for a class of a module that would be a plugin if it were decorated."""
    classes = tuple(cls for classes in _registry.values() for cls in classes.values())
    for cls in vars(module).values():
        if _is_unmarked_plugin(cls, module.__name__, classes):
            base = next(b for b in cls.__mro__ if "group" in vars(b))
            raise UserError(
                f"{module.__file__}, line {inspect.getsourcelines(cls)[1]}: the class"
                f" {cls.__name__}({base.__name__}) is not decorated with @plugin, so nothing can"
                " choose it; write @plugin above it, or let its name start with an underscore"
            )


def _is_unmarked_plugin(cls: Any, module: str, classes: tuple[type, ...]) -> bool:
    """Whether a class of a module is meant as a plugin and not marked as one: it is neither private
    nor a base of plugins.
    """
    if not (
        isinstance(cls, type)
        and issubclass(cls, Plugin)
        and cls.__module__ == module
        and hasattr(cls, "group")
    ):
        return False
    return not (
        cls.__name__.startswith("_")
        or "name" in vars(cls)
        or any(issubclass(k, cls) for k in classes)
    )


@contextmanager
def _import_error(what: str) -> Iterator[None]:
    """Tell in a sentence, with file and line, why an import failed."""
    try:
        yield
    except Exception as error:
        if isinstance(error, UserError) and not isinstance(error, Unknown):
            raise  # it names the class and the file by itself
        why = error.msg if isinstance(error, SyntaxError) else error
        raise UserError(
            f"{what} cannot be imported: {_locate_error(error)}{type(error).__name__}: {why}"
        ) from error


def _locate_error(error: Exception) -> str:
    """Where in the plugin's own files an import failed, as "FILE, line N: ", not in a library that
    the plugin called; "" where none of its files had begun to run.
    """
    if isinstance(error, SyntaxError):
        return f"{error.filename}, line {error.lineno}: "
    frames = traceback.extract_tb(error.__traceback__)
    folder = next((Path(f.filename).parent for f in frames if f.name == "<module>"), None)
    own = [f for f in frames if folder and folder in Path(f.filename).parents]
    return f"{own[-1].filename}, line {own[-1].lineno}: " if own else ""


def get(group: str, name: str) -> type[Any]:
    """The plugin class registered as `name` in `group`; raises `UserError` with the
    nearest name.
    """
    cls = find(group, name)
    if cls is None:
        raise UserError(
            f"there is no {group} '{name}'{list_allowed(name, discover().get(group, {}))}"
        )
    return cls


def find(group: str, name: str) -> type[Any] | None:
    """The plugin class registered as `name` in `group`; None where there is none.

    A plugin has its file's name: only files of this name are imported, and all where none holds it.
    Raises `UserError` with the reason for a plugin whose file cannot be used.
    """
    if name not in _registry.get(group, {}):
        for module in _find_modules_by_name().get(name, ()):
            _try_import(module, _import_module, module)
    _check_usable(group, name)
    return _registry.get(group, {}).get(name) or discover().get(group, {}).get(name)


def _check_usable(group: str, name: str) -> None:
    """Raise `UserError` where the file of a plugin was refused: one that declares it, or one of its
    name that declares none.
    """
    for module, sentence in _refused.items():
        groups = {declared for declared, _ in list_declared_plugins(module)}
        if module.rpartition(".")[2] == name and (not groups or group in groups):
            raise UserError(sentence)


@functools.cache
def _find_modules_by_name() -> Mapping[str, Sequence[str]]:
    """{name: modules of this name} of the plugin packages."""
    named: dict[str, list[str]] = {}
    for package, folder in list_plugin_folders():
        for module in list_modules(package, [str(folder)]):
            named.setdefault(module.rpartition(".")[2], []).append(module)
    return named


def build(group: str, settings: Mapping[str, Any]) -> Any:
    """The plugin described by a configuration node: `name` chooses the class, the rest are its
    settings.
    """
    chosen = dict(settings) if isinstance(settings, Mapping) else {}
    name = chosen.pop("name", None)
    if not isinstance(name, str):
        raise UserError(describe_nameless(group))
    cls = get(group, name)
    allowed = [item.name for item in dataclasses.fields(cls)]
    for key in chosen:
        if key not in allowed:
            raise UserError(
                f"{group} '{cls.name}' has no setting '{key}'"
                f"{list_allowed(key, allowed, 'Settings')}"
            )
    instance = cls(**chosen)
    instance.check()
    return instance


def join_choices(group: str, given: Sequence[Any]) -> dict[str, Any]:
    """The node that a list of choices in one group stands for. Raises `UserError` in a group of
    which one is chosen.
    """
    for name, cls in discover().get(group, {}).items():
        if cls.listed:
            return {"name": name, cls.listed: list(given)}
    raise UserError(f"{group}={list(given)} is a list; one name is chosen there")


def build_chosen(group: str, given: Any) -> Any:
    """The plugin of a setting that is a name, or a mapping of `name` and settings."""
    if isinstance(given, str):
        return build(group, {"name": given})
    if not isinstance(given, Mapping) or "name" not in given:
        raise UserError(
            f"{name_setting(f'data.{group}')}={given!r:.60} must be a name,"
            " or a mapping of 'name' and settings"
        )
    return build(group, given)
