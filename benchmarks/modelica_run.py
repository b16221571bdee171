"""A Modelica model played by the package `modelica` (MIT), in an interpreter that has it."""

import json
import sys

import numpy as np
from modelica.lang import parse
from modelica.sim import causalize, flatten, simulate


def play() -> None:
    """Read two models as JSON, simulate the second, print P and Q of its load (N,) each as JSON."""
    told = json.load(sys.stdin)
    system = causalize(flatten([parse(text) for text in told["texts"]], "Played"))
    accurate = {"tolerance": 1e-9, "absolute": 1e-11}
    played = simulate(system, stop=told["times"][-1], times=told["times"], **accurate)
    at = {
        power: np.interp(told["times"], played.time, played[f"load.{power}"]).tolist()
        for power in "PQ"
    }
    json.dump(at, sys.stdout)


if __name__ == "__main__":
    play()
