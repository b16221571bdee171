"""Quantities as a text of arithmetic: read back from the store, it takes no symbols, which take a second to load."""

import math
from collections.abc import Mapping

VALUES = "at"  # what holds the numbers in such a text: at['T_m']


def evaluated(texts: Mapping[str, str], known: Mapping[str, float]) -> dict[str, float]:
    """What is known, and after it each quantity of what stands before it."""
    numbers = dict(known)
    for name, text in texts.items():
        numbers[name] = float(eval(text, {"math": math, VALUES: numbers}))
    return numbers
