"""Markdown from what plugins say of themselves."""

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

SPECIAL = re.compile(r"([\\*\[\]<>|$])")


def plain(text: str) -> str:
    """Text as Markdown shows it: nothing of it is markup but `code`."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(part if part.startswith("`") else SPECIAL.sub(r"\\\1", part) for part in parts)


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of cells that are Markdown already; "" where it has no rows."""
    if not rows:
        return ""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def folded(summary: str, inside: str) -> str:
    """What a reader opens."""
    return f"<details><summary>{summary}</summary>\n\n{inside}\n\n</details>\n"


def docstring(what: Any) -> str:
    """The docstring of a class or a call: paragraphs, indented lines, sections of numpydoc, and
    `Source:` and `Departures:` marked.
    """
    blocks = re.split(r"\n\s*\n", inspect.cleandoc(what.__doc__ or ""))
    return "\n\n".join(filter(None, map(_block, blocks)))


def _block(block: str) -> str:
    if block.startswith("    "):
        return f"```text\n{textwrap.dedent(block).rstrip()}\n```"
    if section := re.match(r"(\w+)\n-+\n", block):
        return _section(section[1], block[section.end() :])
    if block.startswith(">>> "):
        return f"```python\n{block}\n```"
    marked = re.split(r"(?m)^(Source|Departures): ", block)
    parts = [plain(marked[0])] if marked[0].strip() else []
    parts += [
        f"**{word}:** {plain(text)}" for word, text in zip(marked[1::2], marked[2::2], strict=True)
    ]
    return "\n\n".join(parts)


def _section(title: str, body: str) -> str:
    """A section of numpydoc: its title, then its paragraph, its example or a list of its terms."""
    if body.startswith(">>> ") or "\n    " not in body:
        return f"**{title}**\n\n{_block(body)}"
    terms = re.findall(r"(?m)^(\S.*)((?:\n    .*)*)", body)
    rows = [f"- **{plain(term)}**: {plain(about)}" for term, about in terms]
    return "\n".join([f"**{title}**\n", *rows])


def settings(cls: type) -> list[list[str]]:
    """A row for each setting: its name, its default, and what the comment beside it says."""
    comments = dict(_comments(cls))
    return [
        [f"`{item.name}`", f"`{_default(item)}`", plain(comments.get(item.name, ""))]
        for item in dataclasses.fields(cls)
        if item.init
    ]


def _default(item: dataclasses.Field) -> str:
    if item.default_factory is not dataclasses.MISSING:
        return repr(item.default_factory())
    if item.default is None or isinstance(item.default, bool):
        return "null" if item.default is None else str(item.default).lower()
    return str(item.default) or "''"


def _comments(cls: type) -> Iterator[tuple[str, str]]:
    """(setting, comment): of the arguments of a task's call, then of the class, those of its bases
    first.
    """
    if call := getattr(cls, "function", None):
        lines, node = _parsed(call)
        for item in (*node.args.args, *node.args.kwonlyargs):
            yield from _beside(lines, item, item.arg)
    for base in reversed(cls.__mro__):
        if dataclasses.is_dataclass(base):
            lines, node = _parsed(base)
            for item in node.body:
                if isinstance(item, ast.AnnAssign):
                    yield from _beside(lines, item, item.target.id)


def _parsed(thing: Any) -> tuple[list[str], Any]:
    """The lines of a class or function, and its node."""
    source = inspect.getsource(inspect.unwrap(thing))
    (node,) = ast.parse(textwrap.dedent(source)).body
    return source.splitlines(), node


def _beside(lines: list[str], item: ast.AST, name: str) -> Iterator[tuple[str, str]]:
    """(name, the comment at the end of a declaration, or else on the lines above it)."""
    if comment := re.search(r"#\s*(.+)$", lines[item.end_lineno - 1]):
        yield name, comment[1]
        return
    above: list[str] = []
    for line in reversed(lines[: item.lineno - 1]):
        if not line.lstrip().startswith("#"):
            break
        above.insert(0, line.lstrip("# "))
    if above:
        yield name, " ".join(above)
