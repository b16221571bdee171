"""Read a saved result back."""

import importlib.util
from pathlib import Path

from tractexp.api.arguments import public
from tractexp.errors import UserError, list_allowed
from tractexp.outcome import MARK, Outcome, read_saved_result
from tractexp.storage import files


@public
def load(path: str | Path) -> Outcome:
    """Read a saved result back.

    What a `result.json` of the command line gives holds no records: it predicts, simulates and
    exports, with the error and the grade that the run told, but cannot be judged again.

    Parameters
    ----------
    path : path
        A file that `save` wrote, a `result.json`, or the folder of a run; the folder of an
        investigation gives the model that it ended with.

    Returns
    -------
    Outcome
        What was saved, or the `Identification` of a `result.json`.

    Raises
    ------
    UserError
        Where the file is missing, damaged or of no kind known.
    """
    if Path(path).is_dir() or _is_bare_result(path):
        from tractexp.api.identification import Identification
        from tractexp.identification.result import load as read_result

        return Identification(read_result(Path(path)))
    content = read_saved_result(path)
    kinds = list_result_kinds()
    if content["kind"] not in kinds:
        why = list_allowed(content["kind"], kinds, "Kinds")
        raise UserError(
            f"{path} holds a result of kind '{content['kind']}', which is not known{why}"
        )
    return kinds[content["kind"]].from_saved(content)


def _is_bare_result(path: str | Path) -> bool:
    """Whether a file is a result.json rather than a saved result."""
    try:
        content = files.read_json(path)
    except (FileNotFoundError, UserError):
        return False
    return isinstance(content, dict) and MARK not in content and "parameters" in content


def list_result_kinds() -> dict[str, type[Outcome]]:
    """The kinds of results, by name; each is known once its module is imported."""
    from tractexp import PUBLIC

    for module in dict.fromkeys(PUBLIC.values()):
        if ".api." in module and importlib.util.find_spec(module):
            importlib.import_module(module)
    return Outcome.kinds
