"""What an investigation has spent so far, and the lines that say how far it is."""

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Event, Thread

from tractexp.text.progress import STILL, describe_remaining_time

SILENCE = 4.0  # s after which a line says that a step goes on


class Parts:
    """How many parts of a step have ended, and how long the rest will take."""

    def __init__(self, total: int):
        """Count from now on to `total` parts."""
        self.total, self.ended, self._begun = total, 0, time.perf_counter()

    def end(self) -> None:
        """Count one part more as ended."""
        self.ended += 1

    def __str__(self) -> str:
        """ "3 of 12", with the time that the rest will take where that is long."""
        rest = describe_remaining_time(time.perf_counter() - self._begun, self.ended / self.total)
        return f"{self.ended} of {self.total}{rest}"


class Effort:
    """Counts simulations, and tells a listener which step is at work.

    Attributes
    ----------
    simulations : int
        Those of this part of the work.
    """

    def __init__(self, tell: Callable[[str], None] = lambda line: None):
        """Count simulations from 0 and tell the stages to `tell`."""
        self.simulations, self._tell, self._all = 0, tell, list[Effort]((self,))
        self._step, self._said, self._parts = "", time.perf_counter(), list[Parts]()

    def anew(self) -> "Effort":
        """A count of its own for a part of the work, which tells the same listener."""
        part = Effort(self.say)
        part._all = self._all
        part._parts = self._parts
        self._all.append(part)
        return part

    def say(self, line: str) -> None:
        """Tell the listener the step that begins."""
        self._step = line
        self._said = time.perf_counter()
        self._tell(line)

    @contextmanager
    def parts(self, total: int) -> Iterator[Callable[[], None]]:
        """Count the parts of the step at hand: yield what is to be called at the end of each. Parts
        may have parts.
        """
        counted = Parts(total)
        self._parts.append(counted)
        try:
            yield counted.end
        finally:
            self._parts.remove(counted)

    @property
    def counts(self) -> list[int]:
        """The simulations of each part of the work."""
        return [effort.simulations for effort in self._all]

    def spent_since(self, counts: Sequence[int]) -> list[int]:
        """The simulations of each part since given `counts`, also of parts that have begun
        since.
        """
        return [
            now - before for now, before in itertools.zip_longest(self.counts, counts, fillvalue=0)
        ]

    def add(self, spent: Sequence[int]) -> None:
        """Count what another process has spent.

        Parameters
        ----------
        spent : simulations of each part
            In the order of `counts`; parts that this process does not know were begun for this part
            of the work, and count for it.
        """
        known = tuple(self._all)
        for effort, simulations in zip(known, spent, strict=False):
            effort.spend(simulations)
        self.spend(sum(spent[len(known) :]))

    def spend(self, simulations: int) -> None:
        """Count simulations that were made."""
        self.simulations += simulations

    @property
    def total(self) -> int:
        """Simulations of all parts of the work."""
        return sum(effort.simulations for effort in self._all)

    @contextmanager
    def tell_when_silent(self) -> Iterator["Effort"]:
        """While entered, tell the listener that a step still runs after every `SILENCE` seconds
        without a message.
        """
        ended = Event()

        def watch() -> None:
            last_count = 0
            while not ended.wait(SILENCE / 4):
                now = time.perf_counter()
                if now - self._said >= SILENCE:
                    # the outermost part only: those within it change too fast to be told
                    progress = [str(part) for part in self._parts if part.total > 1][:1]
                    if self.total > last_count:
                        progress.append(f"{self.total} simulations")
                    self._said = now
                    last_count = self.total
                    reached = f": {', '.join(progress)}" if progress else ""
                    self._tell(f"{STILL} {self._step or 'at work'}{reached}")

        watcher = Thread(target=watch, name="progress", daemon=True)
        watcher.start()
        try:
            yield self
        finally:
            ended.set()
            watcher.join()
