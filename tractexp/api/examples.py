"""Shipped dips to try things on."""

from pathlib import Path

from tractexp import files
from tractexp.api.arguments import public
from tractexp.api.read import Dips, read

SHIPPED = ("tibet_50pct", "tibet_30pct", "tibet_65pct")
FILES = "pkg://tractexp.data/{name}.csv"


@public
def examples(folder: Path | str | None = None) -> Dips:
    """Three shipped dips of one synthetic load, of 50, 30 and 65 %, and their files where asked.

    Parameters
    ----------
    folder : path
        Where they are written as dip1.csv, dip2.csv and dip3.csv, so that the examples of the pages
        run there; None: nowhere.

    Returns
    -------
    Dips
        The three events, as `tractexp.read` gives them.

    Raises
    ------
    UserError
        Where the files cannot be written.

    Examples
    --------
    >>> import tractexp
    >>> [f"{dip.depth:.2f}" for dip in tractexp.examples()]
    ['0.50', '0.30', '0.65']
    """
    paths = [files.locate_file(FILES.format(name=name)) for name in SHIPPED]
    if folder is not None:
        for k, path in enumerate(paths, start=1):
            files.copy(path, Path(folder, f"dip{k}.csv"))
    return read(*SHIPPED)
