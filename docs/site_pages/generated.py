"""Everything generated, written into one folder; what is no longer made is deleted."""

from pathlib import Path

from site_pages import api, catalogue, tasks


def write(folder: Path) -> None:
    """Write the catalogues, the pages of the tasks and the list of public calls."""
    made = [*catalogue.write(folder / "catalogue"), *tasks.write(folder / "tasks"), api.write(folder)]
    for stale in set(folder.rglob("*.md")) - set(made):
        stale.unlink()
