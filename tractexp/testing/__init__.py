"""What every plugin must satisfy, as tests for pytest. In a package of your own, one line tests all
its plugins:

    TestAcme = tractexp.testing.contract("acme_loads")

Each check is a function of a plugin class in `loads`, `searches`, `readers`, `channels` and
`writers`, and says in a sentence what fails.
"""

import functools
import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tractexp.configuration.plugin import Plugin, discover, import_all
from tractexp.errors import UserError
from tractexp.testing import channels, loads, readers, searches, writers

SUITES = (*loads.SUITES, searches.SUITE, readers.SUITE, *channels.SUITES, writers.SUITE)


def contract(
    package: str, samples: Mapping[str, Sequence[Mapping[str, Any]]] | None = None
) -> type:
    """A pytest class with every check of every plugin in `package`, which need not be installed.

    `samples` {reader: [settings, ...]} are settings with which a reader reads files that are there.
    Raises `UserError` where the package has no plugin.
    """
    members = plugins_of(package)
    if not members:
        raise UserError(
            f"the package '{package}' has no plugin; each is a file with one class under @plugin"
        )
    tests = {}
    for base, without, checks in SUITES:
        chosen = [cls for cls in members if issubclass(cls, base) and not issubclass(cls, without)]
        for check in checks if chosen else ():
            test = (
                functools.partial(check, samples=samples or {}) if base is readers.Reader else check
            )
            tests[f"test_{base.__name__.lower()}_{check.__name__}"] = _test(
                test, check.__doc__, chosen
            )
    return type("Contract", (), tests)


def plugins_of(package: str) -> list[type[Plugin]]:
    """The plugin classes in a package, in order of group and name."""
    discover()
    import_all([importlib.import_module(package)])
    members = (
        cls for _, classes in sorted(discover().items()) for _, cls in sorted(classes.items())
    )
    return [cls for cls in members if cls.__module__.startswith(package + ".")]


def _test(
    check: Callable[..., None], about: str | None, members: Sequence[type[Plugin]]
) -> Callable[..., None]:
    """A test that runs one check on each plugin."""
    import pytest

    @pytest.mark.parametrize("cls", members, ids=lambda cls: cls.name)
    def test(self: object, cls: type[Plugin]) -> None:
        check(cls)

    test.__doc__ = about
    return test
