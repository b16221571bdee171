"""`tractexp sync`: log what could not be logged when it was made, or what a lost store had."""

import argparse
from collections import Counter
from pathlib import Path

from tractexp import tracking
from tractexp.errors import UserError
from tractexp.text.progress import say

FOLDER = Path("outputs")
OWN = "outputs/mlflow.db of the current folder, for the runs that name it"
DOES = (
    "Log the runs whose results are in files but not in MLflow; what is there already is left as it"
    " is."
)


def sync(arguments: list[str]) -> int:
    """Send what folders keep to the store that is named, to no other; the exit code, 2 where
    something could not be.
    """
    parser = argparse.ArgumentParser(prog="tractexp sync", description=DOES)
    parser.add_argument(
        "folder", nargs="?", type=Path, default=FOLDER, help=f"of runs; default: {FOLDER}"
    )
    parser.add_argument("--uri", help=f"the MLflow store to send them to; default: {OWN}")
    chosen = parser.parse_args(arguments)
    if not chosen.folder.is_dir():
        raise UserError(
            f"tractexp sync: there is no folder {chosen.folder}; name the folder of the runs"
        )
    counts = send_folder(chosen.folder, chosen.uri)
    return 2 if counts["not logged"] else 0


def send_folder(folder: Path, uri: str | None) -> Counter[str]:
    """Send what is kept below a folder and say what became of it."""
    from tractexp.tracking.sync import sync

    counts = sync(
        folder.absolute(),
        uri,
        own=tracking.resolve_address(uri),
        tell=lambda line: say(f"  {line}"),
    )
    numbers = (
        ", ".join(f"{count} {what}" for what, count in counts.items()) or "none are kept there"
    )
    say(f"runs in {folder}: {numbers}")
    return counts
