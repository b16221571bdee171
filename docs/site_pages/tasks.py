"""A page for each task: what it does, its settings, and where the pages show it at work."""

from collections.abc import Iterable
from pathlib import Path

from site_pages import commands, markdown
from site_pages.commands import Command
from site_pages.markdown import plain, table
from tractexp.api.task import Task
from tractexp.configuration.choices import read_default_choices, take_first_sentence
from tractexp.configuration.plugin import discover
from tractexp.storage import files

DOCS = Path(__file__).parents[1]
MOST = 8  # examples on a page
SUBCOMMANDS = ("look", "again", "list", "new", "ui", "sync", "doctor")  # which are no tasks


def write(folder: Path) -> list[Path]:
    """Write the pages and one that lists them, and return their paths."""
    shown = [
        c
        for page in sorted(DOCS.glob("*.md"))
        for c in commands.of(page)
        if c.arguments is not None
    ]
    tasks = sorted(discover()["task"].items())
    pages = [files.write(folder / f"{name}.md", _page(cls, shown)) for name, cls in tasks]
    rows = [
        [f"[`{name}`]({name}.md)", plain(take_first_sentence(cls.__doc__ or ""))]
        for name, cls in tasks
    ]
    toctree = "```{toctree}\n:hidden:\n\n" + "\n".join(name for name, _ in tasks) + "\n```\n"
    intro = f"Chosen by `task=NAME`; `{read_default_choices()['task']}` where none is named.\n"
    listed = files.write(
        folder / "index.md",
        "\n".join(["# Tasks\n", intro, table(["task", "what it does"], rows), toctree]),
    )
    return [listed, *pages]


def _page(cls: type[Task], shown: Iterable[Command]) -> str:
    parts = [f"# task={cls.name}", markdown.docstring(cls)]
    if rows := markdown.settings(cls):
        rows = [[f"`task.{name[1:]}", *rest] for name, *rest in rows]
        parts += ["## Settings", table(["setting", "default", "meaning"], rows)]
    # settings without a comment of their own are arguments of the call
    if cls.function is not None:
        parts += [
            f"## The call `tractexp.{cls.function.__name__}`",
            markdown.docstring(cls.function),
        ]
    used = {(c.page, c.heading): c for c in shown if _task(c) == cls.name}  # the last of a section
    if used:
        parts += ["## Shown in", "\n\n".join(map(_example, [*used.values()][:MOST]))]
    return "\n\n".join(parts) + "\n"


def _task(command: Command) -> str:
    """The task of a command; "" where it is none."""
    arguments = command.arguments or []
    if arguments[:1] in ([word] for word in SUBCOMMANDS) or not any(
        "=" in word for word in arguments
    ):
        return ""
    named = [word.partition("=")[2] for word in arguments if word.startswith("task=")]
    return (
        named[0]
        if named
        else read_default_choices()["task"] * ("experiment=" not in " ".join(arguments))
    )


def _example(command: Command) -> str:
    anchor = "-".join(
        "".join(c for c in command.heading.lower() if c.isalnum() or c in " -_").split()
    )
    title = command.page.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ")
    label = title if title == command.heading else f"{title}: {command.heading}"
    where = f"[{plain(label)}](../../{command.page.name}#{anchor})"
    return f"{where}:\n\n```sh\n{command.line}\n```"
