"""Shipped dips to try things on."""

from pathlib import Path

from tractexp.api.arguments import public
from tractexp.api.read import Dips, read
from tractexp.storage import files

SHIPPED = [f"pkg://tractexp.data/tibet_{depth}pct.csv" for depth in (50, 30, 65)]


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
    if folder is not None:
        for k, file in enumerate(SHIPPED, start=1):
            files.copy(files.locate_file(file), Path(folder, f"dip{k}.csv"))
    return read(*SHIPPED)
