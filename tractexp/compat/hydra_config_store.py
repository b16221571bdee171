"""Hydra's store of schemas: one for all copies of what refers to it, and schemas that are made when
they are read.

What: `CachingConfigRepository` (in `hydra._internal`) deep-copies its sources to protect their
list, and with a source the one `ConfigStore` it refers to, with every schema in it. The store gets
a `__deepcopy__` that returns it as it is. That is safe because `ConfigStore.load` copies the schema
it hands out. And `ConfigStore.store` makes a node of every schema at once: in the tree
`ConfigStore.repo` a `Later` stands where a `ConfigNode` would, and makes its own. Why: 20 to 40 ms
a copy with our 42 schemas, two or three copies in each composition (a third of its time); 2 to 3 ms
a node, of which a command reads about ten. Since: Hydra 1.1 (facebookresearch/hydra#1541); looked
at in 1.3.2 to 1.3.8. Upstream: facebookresearch/hydra#1543, and mit-ll-responsible-ai/hydra-zen#769
with the same cure; facebookresearch/hydra#2928 (merged for the version after 1.3) no longer keeps
the store in the source. Of the nodes not reported yet. When mended: drop this module and its calls;
`ConfigStore.store` takes the schema itself.
"""

from collections.abc import Callable
from typing import Any

from hydra.core.config_store import ConfigNode, ConfigStore
from omegaconf import OmegaConf


def share() -> None:
    """Let copies of Hydra's sources refer to the one store."""
    ConfigStore.__deepcopy__ = lambda self, memo: self  # type: ignore[attr-defined]


def store_later(group: str, name: str, schema: Callable[[], type]) -> None:
    """Store the schema that `schema` gives when the node is read, as `ConfigStore.store` does at
    once.
    """
    level = ConfigStore.instance().repo
    for part in group.split("/"):
        level = level.setdefault(part, {})
    level[f"{name}.yaml"] = Later(f"{name}.yaml", group, schema)


class Later(ConfigNode):
    """A node of the store that is made when it is read."""

    def __init__(self, name: str, group: str, schema: Callable[[], type]):
        """A configuration whose schema is made when it is asked for."""
        self.name, self.group, self.package, self.provider, self.schema = (
            name,
            group,
            None,
            None,
            schema,
        )

    def __getattr__(self, name: str) -> Any:
        """The node, made at its first use."""
        if name != "node":
            raise AttributeError(name)
        self.node = OmegaConf.structured(self.schema())
        return self.node
