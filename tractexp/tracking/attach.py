"""Files added to a run that ended before they were made."""

from collections.abc import Sequence
from pathlib import Path

from tractexp.tracking.store import open_store, sentences


def attach(run_id: str, uri: str, paths: Sequence[Path]) -> bool:
    """Copy files to the artifacts of a run; False where the store has no such run (any more)."""
    client = open_store(uri)
    from mlflow.exceptions import MlflowException

    with sentences(uri):
        try:
            found = client.get_run(run_id)
        except MlflowException as error:
            if error.error_code != "RESOURCE_DOES_NOT_EXIST":
                raise
            return False
        if found.info.lifecycle_stage == "deleted":
            return False
        for path in paths:
            client.log_artifact(run_id, str(path))
    return True
