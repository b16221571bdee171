"""`tractexp FOLDER`: the page of a run that is in it; of a folder of recordings, the table of what
happened.
"""

from pathlib import Path

from tractexp.configuration.overrides import format_assignment
from tractexp.errors import UserError
from tractexp.storage.run_folder import CONFIGURATION, RESULT, RESULTS
from tractexp.text import quoting
from tractexp.text.progress import say

PAGES = tuple(name for name in (*RESULTS, "look.html") if name.endswith(".html"))


def choose_command(folder: str, *settings: str) -> list[str]:
    """The arguments that survey a folder by these settings; [] where it holds a run's pages, which
    are told instead. Raises `UserError` for a run without a page.
    """
    pages = [path for name in PAGES if (path := Path(folder, name).absolute()).is_file()]
    for page in pages:
        say(f"page: {page}")
    if pages:
        return []
    if Path(folder, CONFIGURATION).is_dir() and Path(folder, RESULT).is_file():
        again = quoting.shell("tractexp", "again", folder)
        raise UserError(
            f"{folder} holds a run that drew no page, as the jobs of a sweep do; {again} repeats it"
            " and draws one"
        )
    arguments = ["task=survey", format_assignment("data.path", folder), *settings]
    say(f"that is: {quoting.shell('tractexp', *arguments)}")
    return arguments
