"""What cells of the page say: numbers, and names of readings."""

from collections.abc import Sequence

import numpy as np

from tractexp.studies.paper.claims import number
from tractexp.studies.paper.printed import LABELS, READINGS


def percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def middle(values: Sequence[float] | np.ndarray) -> str:
    """The median and, in brackets, lowest and highest."""
    low, middle, high = np.quantile(values, (0, 0.5, 1))
    return f"{number(middle)} ({number(low)} .. {number(high)})"


def label(name: str) -> str:
    """ "issa_10_perceivers" -> "ISSA, 10 perceivers (section 4.2)"; the three of the tables are named alone."""
    reading = READINGS[name]
    return LABELS[name] if name in LABELS else f"{LABELS[reading.optimizer]}, {reading.words}"
