"""How configurations in YAML are read, which may come from anybody."""

import functools
import re
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.storage import files

MOST_NODES, DEEPEST = 100_000, 50  # values of a configuration, and how deep within one another


def read_yaml(path: Path | str, largest: int = files.CONFIGURATION) -> Any:
    """The content of a configuration in YAML: plain data, in which 1e-3 is a number. Raises
    `UserError` for what is none, and as `read`.

    An alias repeats what it stands for, so that a few lines of aliases of aliases fill any memory.
    What they come to is counted before anything is made of it.
    """
    import yaml

    text = files.read_text(path, largest)
    try:
        _count_nodes(text, path)
        return yaml.load(text, _build_loader())
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise UserError(
            f"{path}: {line}not valid YAML ({error.problem or error.context})"
        ) from error
    # a sign that YAML has not, a date that the calendar has not
    except (yaml.YAMLError, ValueError) as error:
        raise UserError(f"{path}: not valid YAML ({str(error).splitlines()[0]:.200})") from error


@functools.cache
def _build_loader() -> Any:
    """YAML's safe loader, for which 1e-3 is a number, as for people."""
    import yaml

    base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    loader: Any = type("Loader", (base,), {})
    number = re.compile(r"[-+]?\d[\d_]*[eE][-+]?\d+$")
    loader.add_implicit_resolver("tag:yaml.org,2002:float", number, list("-+0123456789"))
    return loader


def _count_nodes(text: str, path: Path | str) -> None:
    """Raise `UserError` where YAML holds more, or nests deeper, than any configuration, its aliases
    written out.
    """
    import yaml

    sizes: dict[str, int] = {}
    # collections that are open: anchor, nodes so far
    within: list[tuple[str | None, int]] = [(None, 0)]
    for event in yaml.parse(text, _build_loader()):
        if isinstance(event, yaml.CollectionStartEvent):
            within.append((event.anchor, 1))
        elif isinstance(event, yaml.NodeEvent | yaml.CollectionEndEvent):
            if isinstance(event, yaml.AliasEvent):
                # one that is open: it holds itself
                anchor, size = None, sizes.get(event.anchor, MOST_NODES + 1)
            else:
                anchor, size = (
                    within.pop()
                    if isinstance(event, yaml.CollectionEndEvent)
                    else (event.anchor, 1)
                )
            if anchor is not None:
                sizes[anchor] = size
            within[-1] = within[-1][0], within[-1][1] + size
        if len(within) > DEEPEST or within[-1][1] > MOST_NODES:
            raise UserError(
                f"{path} holds more than {MOST_NODES} values, aliases written out, or nests them"
                f" more than {DEEPEST} deep, which no configuration does"
            )
