"""`tractexp look FILE...`: what files hold, which loads they show, what happened, and the command
that fits it.
"""

import argparse
import re
import time
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.storage import files
from tractexp.text.progress import build_console, find_text_width

FOLDER = Path("outputs", "looks")
DOES = (
    "Look at files without saying which channels they have: loads, events, what is worth fitting,"
    " and the command."
)
EVERYTHING = "  everything: the same command with --all"
SETTING = re.compile(r"(?:data\.)?([a-z_]+)=(.*)", re.DOTALL)


def look(arguments: list[str]) -> int:
    """Print and write a look at files; returns the exit code. Raises `UserError` for what cannot be
    read.
    """
    parser = argparse.ArgumentParser(prog="tractexp look", description=DOES)
    parser.add_argument("file", nargs="+", metavar="FILE", help="any file that can be read")
    parser.add_argument(
        "--folder", type=Path, help=f"where the page is written; default: a new one in {FOLDER}"
    )
    parser.add_argument(
        "--all",
        action="store_true",
        help="print channels, reasons, all events and all commands too",
    )
    parser.epilog = (
        "Settings of the reader are given as KEY=VALUE, such as 'voltages=[4,5,6]' or encoding=gbk."
    )
    chosen = parser.parse_args(arguments)
    settings = {}
    paths = []
    for each in chosen.file:
        setting = None if files.exists(each) else SETTING.fullmatch(each)
        if setting:
            settings[setting[1]] = _parse_value(setting[2])
        else:
            paths.append(each)
    if not paths:
        raise UserError(
            "tractexp look: give a file beside the settings, e.g. tractexp look station.cfg"
        )
    from tractexp.api.look import look as looked
    from tractexp.api.task import call, print_written
    from tractexp.blocks.terminal import show

    view = call(looked, *paths, **settings)
    show(
        view.build_full_report() if chosen.all else view.screen().text(EVERYTHING),
        build_console(),
        find_text_width(),
    )
    usual = FOLDER / f"{Path(paths[0]).stem}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
    print_written(view.write(chosen.folder or files.make_new_folder(usual)), view.page)
    return 0


def _parse_value(text: str) -> Any:
    """A setting's value as YAML reads it; what YAML does not read is a text."""
    import yaml

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return text
