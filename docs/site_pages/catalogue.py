"""The catalogues: a page for each group of plugins, generated from the plugins that
are installed.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

from site_pages import markdown, pictures
from site_pages.markdown import folded, plain, table
from tractexp.configuration.choices import read_default_choices, take_first_sentence
from tractexp.configuration.plugin import Plugin, discover
from tractexp.model import sites
from tractexp.model.declaration import declare_motor_alone
from tractexp.model.parts import Effect, Motor, Part
from tractexp.model.printed import list_changed_lines
from tractexp.parameter import Parameter
from tractexp.storage import files

GROUPS = {  # group of plugins: the title of its page, and how one of it is chosen
    "model/motor": ("Motors", "model/motor=NAME"),
    "model/static": ("Static loads", "model/static=NAME"),
    "effect": ("Effects", "model.effects=[NAME]"),
    "optimizer": ("Optimizers", "optimizer=NAME"),
    "objective": ("Objectives", "objective=NAME"),
    "data": ("Readers", "data=NAME"),
    "connection": ("Connections", "data.connection=NAME"),
    "estimator": ("Estimators of phasors", "data.estimator=NAME"),
    "writer": ("Writers", "task=convert task.to=NAME"),
    "format": ("Formats of models", "task=export task.format=NAME"),
}


def write(folder: Path) -> list[Path]:
    """Write the page and the pictures of every group into a folder and return the pages."""
    return [_page(group, folder) for group in GROUPS if discover().get(group)]


def _page(group: str, folder: Path) -> Path:
    title, how = GROUPS[group]
    classes = [cls for _, cls in sorted(discover()[group].items())]
    chosen = (
        f"`{read_default_choices()[group]}` is chosen by default."
        if read_default_choices().get(group)
        else ""
    )
    items = [
        f"- [`{cls.name}`](#{_anchor(cls)}): {plain(take_first_sentence(cls.__doc__ or ''))}"
        for cls in classes
    ]
    head = "\n\n".join([f"# {title}", f"Chosen by `{how}`. {chosen}", "\n".join(items)])
    sections = [_section(cls, folder) for cls in classes]
    path = folder / f"{title.lower().replace(' ', '-')}.md"
    return files.write(path, "\n\n".join([head, *sections]) + "\n")


def _anchor(cls: type[Plugin]) -> str:
    return f"{cls.group.replace('/', '-')}-{cls.name}".replace("_", "-")


def _section(cls: type[Plugin], folder: Path) -> str:
    head = f"({_anchor(cls)})=\n## `{cls.name}`"
    parts = [head, markdown.docstring(cls)]
    if issubclass(cls, Part):
        parts += [_picture(cls, folder), _facts(cls), _parameters(cls), _equations(cls)]
    if rows := markdown.settings(cls):
        parts.append(table(["setting", "default", "meaning"], rows))
    return "\n\n".join(filter(None, parts))


def _picture(cls: type[Part], folder: Path) -> str:
    path = folder / "pictures" / f"{_anchor(cls)}.svg"
    path.parent.mkdir(parents=True, exist_ok=True)
    caption = pictures.draw(cls, path)
    return (
        f"```{{figure}} pictures/{path.name}\n:alt: what {cls.name} does in a dip\n\n{caption}\n```"
        if caption
        else ""
    )


def _facts(cls: type[Part]) -> str:
    rows = [
        [
            "domains",
            "waveforms"
            if cls.waves_only
            else "phasors"
            if cls.phasors_only
            else "phasors, waveforms",
        ]
    ]
    if why := cls.waves_only or cls.phasors_only:
        rows.append(["of no other, for", plain(why)])
    if cls.reads:
        rows.append(["reads", ", ".join(f"`{channel}`" for channel in cls.reads)])
    if issubclass(cls, Effect):
        rows += [["acts on", ", ".join(cls.places)], ["what it does there", sites.KINDS[cls.kind]]]
        alike = [discover()["effect"][name] for name in cls.confused_with]
        rows += [["looks like", _links(alike)]] * bool(alike)
        if cls.family:
            rows.append(
                [
                    "of the family of",
                    f"{_links([discover()['effect'][cls.family]])}; {plain(cls.differs)}",
                ]
            )
    return table(["", ""], rows)


def _links(classes: Iterable[type[Plugin]]) -> str:
    return ", ".join(f"[`{cls.name}`](#{_anchor(cls)})" for cls in classes)


def _parameters(cls: type[Part]) -> str:
    columns: dict[str, Callable[[Parameter], str]] = {
        "": lambda p: f"${p.symbol}$",
        "parameter": lambda p: f"`{p.name}`",
        "meaning": lambda p: plain(p.about),
        "unit": lambda p: plain(p.unit),
        "default": lambda p: f"{p.default:g}",
        "bounds": lambda p: f"{p.bounds[0]:g} to {p.bounds[1]:g}",
    }
    if issubclass(cls, Effect):
        columns["null"] = lambda p: "" if p.null is None else f"{p.null:g}"
        columns["matters from"] = lambda p: (
            f"{cls.relevant[p.name]:g}" if p.name in cls.relevant else ""
        )
        columns["looked for at"] = lambda p: ", ".join(f"{v:g}" for v in cls.grid.get(p.name, ()))
    if len(sources := {p.source for p in cls.parameters}) > 1:
        columns["source"] = lambda p: plain(p.source)
    used = {name: [cell(p) for p in cls.parameters] for name, cell in columns.items()}
    used = {name: cells for name, cells in used.items() if any(cells)}
    below = f"\nDefaults and bounds: {plain(*sources)}." if len(sources) == 1 else ""
    return table([*used], [list(row) for row in zip(*used.values(), strict=True)]) + below


def _equations(cls: type[Part]) -> str:
    """The equations of a motor by itself; of any other part those that it changes or brings in."""
    base, of = pictures.pair(cls)
    if issubclass(cls, Motor):
        edits = (
            [(None, line) for line in declare_motor_alone(cls()).latex()]
            if not cls.waves_only
            else list_changed_lines([], of.latex())
        )
    elif issubclass(cls, Effect):
        edits = list_changed_lines(base.latex(), of.latex())
    else:
        edits = [
            (was, line)
            for was, line in list_changed_lines(declare_motor_alone(of.motor).latex(), of.latex())
            if was is None
        ]
    if not edits:
        return ""
    lines = [
        line if was is None else rf"{line} \quad \text{{instead of}} \quad {was}"
        for was, line in edits
    ]
    summary = "Equations" if not issubclass(cls, Effect) else "Equations that changed or came in"
    return folded(summary, "\n\n".join(f"$$\n{line}\n$$" for line in lines))
