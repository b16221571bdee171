"""How files are read that belong together: those of one event, and what a .zip holds."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tractexp.configuration.overrides import format_assignment
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.record import find_reader, list_endings
from tractexp.recording.event_files import MOST_FILES, PART, name_one_event, say_several
from tractexp.recording.overview import View, view_of
from tractexp.recording.proposal import propose
from tractexp.recording.reader import WaveformReader
from tractexp.recording.record_files import find_packed
from tractexp.storage import files
from tractexp.text.quoting import shell
from tractexp.text.wording import join_words

EMPTY = "it is empty, or its files are hidden or named as if they lay elsewhere: extract it"
MOST_UNNAMED = 6  # files that are tried together although their names do not say so


def find_settings(path: str, *join: str) -> dict[str, Any]:
    """The reader, and its settings, that reads all of a file, or of the files of one event, or of
    what a .zip holds.

    Raises `UserError` for a folder, for an ending that no reader takes, and for a .zip of none or
    several records.
    """
    if files.is_archive(path):
        return _find_settings_of_archive(Path(path))
    if files.is_called_archive(path):
        files.check_there(Path(path))
    cls = find_reader(path, *join)
    return {"name": cls.name, **cls.build_settings(path)} | ({"join": list(join)} if join else {})


def _find_settings_of_archive(archive: Path) -> dict[str, Any]:
    """The settings that read what a packed archive holds. Raises `UserError` where it holds no
    record.
    """
    inside = [str(path) for path in find_packed(archive)]
    if not inside:
        names = [str(path.relative_to(archive)) for path in files.list_packed(archive)]
        more = " and more" if len(names) > 5 else ""
        held = f"it holds {join_words(names[:5])}{more}" if names else EMPTY
        raise UserError(
            f"there is no record in {archive}: {held}; endings that can be read:"
            f" {', '.join(list_endings())}"
        )
    together = find_settings(*inside) if len(inside) == 1 else join_event(inside)
    if together is None:
        why = f"; {_explain_apart(inside)}" if name_one_event(inside) else ""
        raise UserError(f"{say_several(str(archive), inside)}{why}")
    return together


def _explain_apart(paths: Sequence[str]) -> str:
    """Why files whose names are those of one event are not read together."""
    try:
        view_of(paths[0], find_settings(*paths))
    except UserError as error:
        return f"they are not read as one event: {error}"
    return "together they show no load"


def join_event(paths: Sequence[str]) -> dict[str, Any] | None:
    """How files are read as those of one event; None where they are not.

    They are where their names say so, or where each of them alone shows no load, and they show one
    together.
    """
    alike = len({Path(path).suffix.lower() for path in paths}) == 1
    named = name_one_event(paths)
    if not (alike and 1 < len(paths) <= (MOST_FILES if named else MOST_UNNAMED)):
        return None
    if not named and any(_show_load(path) for path in paths):
        return None
    return find_settings(*paths) if _show_load(*paths) else None


def _show_load(*paths: str) -> bool:
    """Whether files can be read together, and show a load."""
    try:
        node = find_settings(*paths)
        reader = build("data", node)
        if isinstance(reader, WaveformReader):
            return any(feeder.currents for feeder in propose(reader.open_recording()))
        return shows_load(view_of(paths[0], node))
    except UserError:
        return False


def shows_load(view: View) -> bool:
    """Whether a file shows a load by itself: voltages with currents, or a table of powers."""
    return any(s.has_powers for s in view.sights)


def propose_joining(path: str, view: View | None = None) -> str:
    """That files beside one belong to its event, with the command that looks at them together; ""
    where none do.

    `view` is what the file shows alone: where that is a load, names alone say that others belong
    to it.
    """
    alone = view is not None and shows_load(view)
    for group in _find_named_alike(path):
        if alone and not name_one_event(group):
            continue
        node = join_event(group)
        if node is not None:
            names = join_words([Path(one).name for one in node["join"]])
            command = shell("tractexp", "look", path, format_assignment("join", node["join"]))
            shown = "more of the event is shown" if alone else "it shows a load"
            return f"with {names} beside it, of the same event, {shown}: {command}"
    return ""


def _find_named_alike(path: str) -> Iterator[list[str]]:
    """The file, first, with those of its folder whose names differ from its own in one word alone;
    for each word.
    """
    own = Path(path)
    words = PART.findall(own.stem)
    try:
        beside = files.list_folder(own.parent)
    except (UserError, OSError):
        return
    others = [
        (str(each), PART.findall(each.stem))
        for each in beside
        if each.suffix.lower() == own.suffix.lower() and each != own
    ]
    for k in range(len(words)):
        rest = words[:k] + words[k + 1 :]
        group = [o for o, w in others if len(w) == len(words) and w[:k] + w[k + 1 :] == rest]
        if group:
            yield [path, *group]


def list_within(path: Path) -> list[Path]:
    """The paths by which a file is looked at: its own; of a .zip with several records, theirs."""
    inside = find_packed(path) if files.is_archive(path) else []
    together = len(inside) < 2 or join_event([str(one) for one in inside])
    return [path] if together else inside
