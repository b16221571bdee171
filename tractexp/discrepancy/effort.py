"""What an investigation has spent so far, and the lines that say how far it is."""

import time
from collections.abc import Callable
from threading import Lock

SILENCE = 4.0  # s after which a line says that work goes on


class Effort:
    """Counts simulations, passes on what each step says, and breaks long silences. Used by many threads at once."""

    def __init__(self, tell: Callable[[str], None] = lambda line: None):
        self._tell, self._lock = tell, Lock()
        self._step, self._begun, self._said = "", time.perf_counter(), time.perf_counter()
        self.simulations = 0

    def anew(self) -> "Effort":
        """Another count that tells the same listener."""
        return Effort(self._tell)

    def say(self, line: str) -> None:
        """Name the step that begins."""
        with self._lock:
            self._step, self._begun = line, time.perf_counter()
            self._said = self._begun
        self._tell(line)

    def spend(self, simulations: int) -> None:
        """Count simulations that are about to run."""
        with self._lock:
            self.simulations += simulations
            now = time.perf_counter()
            if now - self._said < SILENCE:
                return
            self._said, spent, total = now, now - self._begun, self.simulations
        self._tell(f"  still {self._step or 'at work'}: {total} simulations, {spent:.0f} s")
