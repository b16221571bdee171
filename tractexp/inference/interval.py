"""The 95 % interval of an estimate: one rule for identifications, investigations and plans."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.parameter import Parameter
from tractexp.storage import files
from tractexp.text.wording import format_with_error

INTERVAL_LEVEL = 0.95


def compute_interval_factor(freedom: float = np.inf) -> float:
    """Half of a 95 % interval over the standard error: Student's t at 97.5 %.

    Parameters
    ----------
    freedom : float
        Degrees of freedom that the error stands on: samples less what was fitted, or blocks less
        one. By default the error is known, as that of a forecast.

    Returns
    -------
    float

    Examples
    --------
    >>> round(compute_interval_factor(), 2), round(compute_interval_factor(4), 2)
    (1.96, 2.78)
    """
    from scipy.special import stdtrit

    return float(stdtrit(max(freedom, 1), (1 + INTERVAL_LEVEL) / 2))


@dataclass(frozen=True, eq=False)
class ParameterEstimate:
    """One parameter at a fit.

    Attributes
    ----------
    parameter : Parameter
        Its name, unit and bounds.
    value : float
        The estimate, in the parameter's unit.
    error : float
        Its standard error; nan where the estimate rests on a bound, or where it is not computed.
    verdict : str
        What is said of it, "" where nothing is.
    freedom : float
        Degrees of freedom of the error.
    ends : (lower, upper) or None
        The interval, where it is not that of the error alone.
    """

    parameter: Parameter
    value: float
    error: float
    verdict: str = ""
    freedom: float = np.inf
    ends: tuple[float, float] | None = None

    def __str__(self) -> str:
        """ "T_prime 0.1234 ± 0.0012 s", with the digits that the error leaves."""
        unit = "" if self.parameter.unit == "1" else f" {self.parameter.unit}"
        return f"{self.parameter.name} {format_with_error(self.value, self.error)}{unit}"

    @property
    def half(self) -> float:
        """Half of the 95 % interval, in the parameter's unit; nan without a standard error."""
        return compute_interval_factor(self.freedom) * self.error

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval (lower, upper), cut to the bounds; nan without a standard error."""
        if self.ends is not None:
            return self.ends
        ends = np.clip([self.value - self.half, self.value + self.half], *self.parameter.bounds)
        return float(ends[0]), float(ends[1])

    def plain(self) -> dict[str, Any]:
        """{value, standard_error, interval} as `discrepancy.json` holds them."""
        return files.make_plain(
            {"value": self.value, "standard_error": self.error, "interval": self.interval}
        )
