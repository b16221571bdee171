"""The whole library as two effects, each one kernel: parameters choose which signal acts, and how
much in each balance.

So a shortlist of any terms is simulated side by side, and nothing is compiled for a data set.
"""

from typing import Any

from tractexp.discrepancy.proposal.library import (
    BALANCES,
    CLOCKS,
    SIGNALS,
    SOURCE,
    TIMED,
    Signal,
    name_shape,
    name_size,
    pick_of,
)
from tractexp.errors import Unfit
from tractexp.model.parts import Effect
from tractexp.parameter import Parameter


class Library(Effect):
    """All signals of one kind in all balances that take them. Every size has the null 0."""

    order = 2

    def __init__(self, kind: str):
        """All terms of one kind of signal, in one model."""
        self.name = kind  # type: ignore[misc]
        self.signals = tuple(s for s in SIGNALS if s.kind == kind)
        self.clocks = CLOCKS if kind == TIMED else ()
        self.balances = tuple(b for b in BALANCES if kind in b.kinds and len(b.sizes) == 1)
        self.parameters = tuple(self._parameters())  # type: ignore[misc]

    def __repr__(self) -> str:
        """ "Library('static')"."""
        return f"Library({self.name!r})"

    def _parameters(self) -> Any:
        """A size for each balance, and a switch for each signal and clock."""
        for balance in self.balances:
            for size in balance.sizes:
                yield size.parameter(
                    name_size(self.name, balance, size), f"size in {balance.words}"
                )
        for chosen in (*self.signals, *self.clocks):
            name = pick_of(self.name, chosen.name)
            yield Parameter(
                0.0, (0.0, 1.0), "1", f"whether it is {chosen.words}", SOURCE, name=name
            )
        for signal in self.signals:
            for shape in signal.shapes:
                yield shape.parameter(name_shape(signal, shape))

    def edit(self, eq: Any, **parameters: Any) -> None:
        """Add to each balance its size times the signals that are switched on."""
        clock = {"clock": self._clock(eq, parameters)} if self.clocks else {}
        total = 0
        for signal in self.signals:
            own = {s.name: parameters[name_shape(signal, s)] for s in signal.shapes}
            if is_present(eq, signal):
                total += parameters[pick_of(self.name, signal.name)] * signal.build(
                    eq, **clock, **own
                )
        g = eq.define(f"{self.name}_signal", total, "g")
        for balance in self.balances:
            if all(site in eq for site in balance.places_in(eq)):
                own = {s.name: parameters[name_size(self.name, balance, s)] for s in balance.sizes}
                balance.build(eq, g, **own)

    def _clock(self, eq: Any, parameters: dict[str, Any]) -> Any:
        """The time since what the chosen clock begins with."""
        times = (parameters[pick_of(self.name, c.name)] * c.build(eq) for c in self.clocks)
        return eq.define(f"{self.name}_clock", sum(times), "t")


def is_present(eq: Any, signal: Signal) -> bool:
    """Whether the equations have what a signal follows."""
    if signal.needs == "omega":
        try:
            return bool(eq.omega)
        except Unfit:
            return False
    return not signal.needs or signal.needs in eq
