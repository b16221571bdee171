"""Quantities as a text of arithmetic: read back from the store, it takes no symbols, which take a
second to load.
"""

import math
from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np

# NumPy's, which overflow to infinity where Python's raise
FUNCTIONS = SimpleNamespace(
    **{name: getattr(np, name, getattr(math, name)) for name in dir(math) if name[0] != "_"}
)
VALUES = "at"  # what holds the numbers in such a text: at['T_m']


def evaluate_texts(texts: Mapping[str, str], numbers: Mapping[str, float]) -> dict[str, float]:
    """The values of quantities that are written as arithmetic.

    Parameters
    ----------
    texts : {name: expression}
        Each of what is known and of the quantities before it.
    numbers : {name: value}
        What is known.

    Returns
    -------
    {name: value}
        Of both; infinite or nan as IEEE 754 has it.
    """
    values = {name: np.float64(value) for name, value in numbers.items()}
    with np.errstate(all="ignore"):
        for name, text in texts.items():
            values[name] = np.float64(eval(text, {"math": FUNCTIONS, VALUES: values}))
    return {name: float(value) for name, value in values.items()}
