"""The page of the sites, the typed places of the equations that an effect may edit."""

from pathlib import Path

from site_pages.markdown import plain, table
from tractexp.model.sites import SITES
from tractexp.storage import files

HEAD = """# Sites

The typed places in the equations that [an effect](../plugins.md#an-effect) edits. A real site \
stays real.
`tractexp.sites(model)` prints those of a model, what stands there, which of its effects edit it \
and which others could.
"""


def write(folder: Path) -> Path:
    """Write the page into a folder and return its path."""
    rows = [
        [f"`{site.name}`", site.owner, site.kind, site.unit, plain(site.about)]
        for site in SITES.values()
    ]
    return files.write(
        folder / "sites.md", f"{HEAD}\n{table(['site', 'of', 'kind', 'unit', 'what'], rows)}"
    )
