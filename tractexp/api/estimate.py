"""The estimates of an identification: values with intervals, by name."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tractexp.errors import list_allowed

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value and how sure it is. Interval (95 %) and standard error are None
    where there is none.

    `search` is where the optimizer itself ended.
    """

    name: str
    value: float
    search: float
    unit: str
    interval: tuple[float, float] | None
    standard_error: float | None
    verdict: str
    bounds: tuple[float, float]
    about: str

    def times(self, factor: float) -> "Estimate":
        """The estimate in a unit of which one is a `factor`-th of its own."""
        low, high = self.bounds
        return replace(
            self,
            value=factor * self.value,
            search=factor * self.search,
            bounds=(factor * low, factor * high),
            interval=self.interval and (factor * self.interval[0], factor * self.interval[1]),
            standard_error=None if self.standard_error is None else factor * self.standard_error,
        )

    def __repr__(self) -> str:
        """ "M = 0.01 pu s2/rad, 95 % interval 0.009 .. 0.011: identified"."""
        span = (
            f", 95 % interval {self.interval[0]:.4g} .. {self.interval[1]:.4g}"
            if self.interval
            else ""
        )
        return f"{self.name} = {self.value:.5g} {self.unit}{span}: {self.verdict}"


class Estimates(dict[str, Estimate]):
    """Estimates by name, printed one a line."""

    def __repr__(self) -> str:
        """A line for each parameter."""
        return "\n".join(map(repr, self.values()))

    def __missing__(self, name: str) -> Estimate:
        """Raise KeyError with the nearest name."""
        raise KeyError(f"no parameter is called {name}{list_allowed(name, self, 'Parameters')}")

    @property
    def outside_interval(self) -> list[str]:
        """Parameters whose interval does not hold the value that the search ended at."""
        return [
            e.name
            for e in self.values()
            if e.interval and not e.interval[0] <= e.search <= e.interval[1]
        ]

    def to_frame(self) -> "pandas.DataFrame":
        """A pandas frame of numbers with a row for each estimate: parameter, value, unit, the ends
        `lower` and `upper` of the 95 % interval and the standard error (nan where there is none),
        search (where the optimizer ended), verdict.
        """
        import pandas

        rows = [
            {
                "parameter": e.name,
                "value": e.value,
                "unit": e.unit,
                "lower": e.interval[0] if e.interval else np.nan,
                "upper": e.interval[1] if e.interval else np.nan,
                "standard_error": np.nan if e.standard_error is None else e.standard_error,
                "search": e.search,
                "verdict": e.verdict,
            }
            for e in self.values()
        ]
        return pandas.DataFrame(rows)
