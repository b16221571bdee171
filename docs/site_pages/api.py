"""The page of public calls, and of what a plugin imports."""

import importlib
import inspect
from pathlib import Path

from tractexp import PUBLIC, extend, files

TITLE = """# Public calls

What `import tractexp` offers; [From Python](../python.md) shows them at work. Where a call takes a `model`, an
`optimizer` or records, it takes what the command line takes.
"""
EXTEND = """
# What a plugin imports

`from tractexp.extend import ...`; [A plugin of your own](../plugins.md) tells what each is for.
"""


def write(folder: Path) -> Path:
    """Write the page into a folder and return its path."""
    calls = [_entry(getattr(importlib.import_module(module), name), name, module) for name, module in PUBLIC.items()]
    bases = [
        _entry(getattr(extend, name), name, "")
        for name in extend.__all__
        if _told(getattr(extend, name)) and name not in PUBLIC
    ]
    return files.write(folder / "api.md", "\n".join([TITLE, *calls, EXTEND, *bases]))


def _told(what: object) -> bool:
    return inspect.isclass(what) or inspect.isfunction(what)


def _entry(what: object, name: str, module: str) -> str:
    kind = "autoexception" if _is_error(what) else "autoclass" if inspect.isclass(what) else "autofunction"
    where = module or what.__module__  # type: ignore[attr-defined]
    return f"## {name}\n\n```{{eval-rst}}\n.. {kind}:: {where}.{name}\n```\n"


def _is_error(what: object) -> bool:
    return inspect.isclass(what) and issubclass(what, Exception)
