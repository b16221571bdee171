"""The jobs of a sweep in MLflow: logged by the sweep's own process, while its workers go on.

So MLflow is imported once and not by each worker, and workers that reach neither store nor disk are
logged, too.
"""

from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

from tractexp import tracking
from tractexp.errors import UserError
from tractexp.text.progress import say
from tractexp.tracking import runfile


class Recorder:
    """Logs jobs that have ended. What cannot be logged stays in its folder, and is sent when the
    sweep ends.
    """

    def __init__(self, folder: Path, opening: "Future[str | None] | None" = None):
        """`opening` will be the id of the sweep's run, or None where that cannot be logged."""
        self.folder, self.opening = folder, opening
        self.refused = False  # the store cannot be used: nobody waits for it twice

    def parent(self) -> str | None:
        """The id of the sweep's run, once it is open; None where it is not logged."""
        return None if self.opening is None else self.opening.result()

    def log(self, folder: Path) -> None:
        """Log what a job has kept for the store, below the sweep's run. Does nothing if the job
        kept nothing, if the sweep's run could not be logged, or once the store was refused.
        """
        if self.refused:
            return
        parent = self.parent()
        if parent is None:
            return
        try:
            entry = runfile.read(folder)
            if entry is not None and not entry.run_id:
                entry.mark_logged(tracking.log(replace(entry.run, parent=parent), entry.uri))
        except UserError as error:
            self.refused = True
            say(f"not logged yet: {error}")
