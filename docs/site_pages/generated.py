"""Everything generated, written into one folder; stale pages are deleted."""

from pathlib import Path

from site_pages import api, catalogue, criteria, gallery, sites, tasks


def write(folder: Path) -> None:
    """Write the catalogues, the pages of the tasks, the lists of calls, criteria and sites, and the
    gallery.
    """
    pages = [
        *catalogue.write(folder / "catalogue"),
        *tasks.write(folder / "tasks"),
        api.write(folder),
        criteria.write(folder),
        sites.write(folder),
        gallery.write(folder),
    ]
    for stale in set(folder.rglob("*.md")) - set(pages):
        stale.unlink()
