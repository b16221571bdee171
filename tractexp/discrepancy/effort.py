"""What an investigation has spent so far, and the lines that say how far it is."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Lock, Thread

SILENCE = 4.0  # s after which a line says that a step goes on


class Effort:
    """Counts simulations and passes on what each step says. Used by many threads at once."""

    simulations: int

    def __init__(self, tell: Callable[[str], None] = lambda line: None):
        self.simulations, self._lock = 0, Lock()
        self._tell, self._all = tell, list[Effort]((self,))
        self._step, self._begun, self._said = "", time.perf_counter(), time.perf_counter()

    def anew(self) -> "Effort":
        """A count of its own for a part of the work, which tells the same listener."""
        part = Effort(self.say)
        part._all = self._all
        self._all.append(part)
        return part

    def say(self, line: str) -> None:
        """Name the step that begins."""
        self._step, self._begun, self._said = line, time.perf_counter(), time.perf_counter()
        self._tell(line)

    def spend(self, simulations: int) -> None:
        """Count simulations that are about to run."""
        with self._lock:
            self.simulations += simulations

    @property
    def total(self) -> int:
        """Simulations of all parts of the work."""
        return sum(effort.simulations for effort in self._all)

    @contextmanager
    def audible(self) -> Iterator["Effort"]:
        """While this is entered no step is silent for long."""
        ended = Event()

        def watch() -> None:
            counted = 0
            while not ended.wait(SILENCE / 4):
                now = time.perf_counter()
                if now - self._said >= SILENCE:
                    more = f"{self.total} simulations, " if self.total > counted else ""
                    self._said, counted = now, self.total
                    self._tell(f"  still {self._step or 'at work'}: {more}{now - self._begun:.0f} s")

        watcher = Thread(target=watch, name="progress", daemon=True)
        watcher.start()
        try:
            yield self
        finally:
            ended.set()
            watcher.join()
