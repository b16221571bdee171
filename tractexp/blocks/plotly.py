"""Plotly.js with what our charts draw and nothing else: a quarter of it.

The library is one file of modules that esbuild has wrapped, each a top-level variable holding a
function that makes the module at its first call; the last one registers the kinds of traces. Where
that registers those of our charts alone, what nothing calls any more is left out. A file that is
made otherwise is taken whole.
"""

import hashlib
import importlib.util
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from tractexp.errors import UserError

# the kind that charts need beside lines, which are part of the core
TRACE = 'moduleType:"trace",name:"bar"'
COMMON = re.compile(
    r"[ ,]([\w$]+)=\([\w$]+,[\w$]+\)=>\(\)=>\{try\{return [\w$]+\|\|[\w$]+\(\([\w$]+=\{exports:"
)
LAZY = re.compile(r"[ ,]([\w$]+)=\([\w$]+,[\w$]+,[\w$]+\)=>\(\)=>\{if\([\w$]+\)throw")
REGISTERED = re.compile(r"\.register\(\[((?:[\w$]+\(\),?)+)\]\)")
CALLED = re.compile(r"([\w$]+)\(\)")


def find_library() -> Path:
    """Plotly.js, where the package plotly is installed. Raises `UserError` where it is not."""
    spec = importlib.util.find_spec("plotly")
    for folder in (spec and spec.submodule_search_locations) or ():
        if (path := Path(folder, "package_data", "plotly.min.js")).is_file():
            return path
    raise UserError(
        "pages need the package plotly, which is not installed whole; install it by: pip install"
        " plotly"
    )


def read_code() -> str:
    """The library as pages carry it."""
    return select_needed_modules(find_library().read_text(encoding="utf-8"))


def compute_digest() -> str:
    """SHA-256 of all that `code` hangs on."""
    return hashlib.sha256(find_library().read_bytes() + Path(__file__).read_bytes()).hexdigest()


def select_needed_modules(whole: str) -> str:
    """The modules of the library that our charts need; all of it where it is made otherwise than
    known.
    """
    common, lazy = COMMON.search(whole), LAZY.search(whole)
    if not (common and lazy):
        return whole
    wraps = f"{re.escape(common[1])}|{re.escape(lazy[1])}"
    begins = [
        m.start() for m in re.finditer(rf"(?<=[;\n])var [\w$]+={re.escape(common[1])}\(\(", whole)
    ]
    parts = [whole[a:b] for a, b in zip(begins, [*begins[1:], len(whole)], strict=True)]
    where: dict[str, int] = {}
    for k, part in enumerate(parts):
        where |= dict.fromkeys(re.findall(rf"([\w$]+)=(?:{wraps})\(", part), k)
    registered = REGISTERED.search(parts[-1]) if parts else None
    if registered is None:
        return whole
    calls = [_list_called_modules(part, where) for part in parts]
    bars = []
    for kind in registered[1].rstrip(",").split(","):
        called = calls[where[kind[:-2]]] if kind[:-2] in where else ()
        if any(TRACE in parts[k] for k in called):
            bars.append(kind)
    if len(bars) != 1:
        return whole
    parts[-1] = parts[-1].replace(registered[0], f".register([{bars[0]}])")
    calls[-1] = _list_called_modules(parts[-1], where)
    head = whole[: begins[0]]
    todo = {len(parts) - 1, *_list_called_modules(head, where)}
    return head + "".join(parts[k] for k in _list_needed_modules(calls, todo))


def _list_called_modules(part: str, where: Mapping[str, int]) -> set[int]:
    """The modules that a part of the library calls, by their places {name: place}."""
    return {where[name] for name in CALLED.findall(part) if name in where}


def _list_needed_modules(calls: Sequence[set[int]], first: set[int]) -> list[int]:
    """The modules that the first ones need, themselves among them, in order; `calls` are those that
    each one calls.
    """
    needed, todo = set[int](), {*first}
    while todo:
        k = todo.pop()
        needed.add(k)
        todo |= calls[k] - needed
    return sorted(needed)
