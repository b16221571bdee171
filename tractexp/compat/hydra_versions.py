"""Names by which Hydra 1.3 and 1.4 and OmegaConf 2.3 and 2.4 call the same things, each without a
warning.

What: OmegaConf 2.4 calls `register_new_resolver` `register_resolver`, which in 2.3 is the one of
OmegaConf 1; `hydra.main` of Hydra 1.4 deprecates `version_base`, without which 1.3 warns and
changes the working directory; and `ConfigStore.store` of Hydra 1.4 warns of a name that is there
(1.5 is to refuse it) unless it is told `replace`, which 1.3 does not know. Since: looked at in
Hydra 1.3.4 to 1.4.0rc3, OmegaConf 2.3.0 to 2.4.1rc1. When mended: once the oldest versions allowed
are Hydra 1.4 and OmegaConf 2.4, call the new names.
"""

import inspect
from collections.abc import Callable
from typing import Any

import hydra
from hydra.core.config_store import ConfigStore
from omegaconf import OmegaConf

NEW = (1, 4)  # the version of Hydra from which on `version_base` is deprecated


def register_resolver() -> Callable[..., None]:
    """`OmegaConf.register_resolver(name, resolver, replace=...)`, by the name that the installed
    version takes.
    """
    renamed: Any = getattr(OmegaConf, "register_resolver", None)
    if renamed is not None and "replace" in inspect.signature(renamed).parameters:
        return renamed
    return OmegaConf.register_new_resolver


def store_schema(group: str | None, name: str, schema: type) -> None:
    """`ConfigStore.store`, in place of what has that name: a process may run several commands."""
    store: Any = ConfigStore.instance().store
    known = "replace" in inspect.signature(store).parameters
    store(name=name, node=schema, group=group, **({"replace": True} if known else {}))


def choose_behavior() -> dict[str, str]:
    """The keywords of `hydra.main` that ask for the behavior of Hydra 1.3."""
    installed = tuple(map(int, hydra.__version__.split(".")[:2]))
    return {} if installed >= NEW else {"version_base": "1.3"}
