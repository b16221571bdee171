"""The page of public calls, and of what a plugin imports."""

import inspect
from pathlib import Path

import tractexp
from tractexp import PUBLIC, extend
from tractexp.storage import files

TITLE = """# Public calls

What `import tractexp` offers; [From Python](../python.md) shows them at work. Where a call takes \
a `model`, an
`optimizer` or records, it takes what the command line takes.
"""
EXTEND = """
# What a plugin imports

`from tractexp.extend import ...`; [A plugin of your own](../plugins.md) tells what each is for.
"""


def write(folder: Path) -> Path:
    """Write the page into a folder and return its path."""
    calls = [_entry(getattr(tractexp, name), f"tractexp.{name}") for name in PUBLIC]
    others = {name: getattr(extend, name) for name in extend.__all__ if name not in PUBLIC}
    bases = [
        _entry(what, f"tractexp.extend.{name}") for name, what in others.items() if _told(what)
    ]
    return files.write(folder / "api.md", "\n".join([TITLE, *calls, EXTEND, *bases]))


def _told(what: object) -> bool:
    return inspect.isclass(what) or inspect.isfunction(what)


def _entry(what: object, name: str) -> str:
    kind = (
        "autoexception"
        if _is_error(what)
        else "autoclass"
        if inspect.isclass(what)
        else "autofunction"
    )
    return f"## {name.rpartition('.')[2]}\n\n```{{eval-rst}}\n.. {kind}:: {name}\n```\n"


def _is_error(what: object) -> bool:
    return inspect.isclass(what) and issubclass(what, Exception)
