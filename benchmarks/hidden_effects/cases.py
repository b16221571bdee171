"""The suites of the study: what is hidden where, under which noise. Each trial is a case and a seed."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, cycle, islice
from typing import Any
from zlib import crc32

import numpy as np

from hidden_effects.effects import CATALOG, NUISANCES, PHYSICAL
from hidden_effects.generator import EFFECTS, Case, scene
from hidden_effects.limits import detection_limit
from hidden_effects.noise import Noise
from hidden_effects.outside import OUTSIDE
from hidden_effects.recorder import Recorder

MULTIPLES = (0.5, 1.0, 2.0, 4.0, 8.0)  # of the detection limit
RECORDERS = {"500 Hz, 2 s": Recorder(500.0, 1000), "100 Hz, 3 s": Recorder(100.0, 300)}
NOISES = {
    "white 0.05 %": Noise(0.0005),
    "white 0.2 %": Noise(0.002),
    "white 0.5 %": Noise(0.005),
    "white 1 %": Noise(0.01),
    "white 2 %": Noise(0.02),
    "AR(1) 0.5": Noise(0.005, phi=0.5),
    "AR(1) 0.8": Noise(0.005, phi=0.8),
    "AR(1) 0.95": Noise(0.005, phi=0.95),
    "voltage 0.2 %": Noise(0.005, voltage=0.002),
    "voltage 0.5 %": Noise(0.005, voltage=0.005),
    "quantized": Noise(0.003, quantum=0.005),
    "heavy tails": Noise(0.005, tails=4.0),
    "wandering load": Noise(0.005, wander=0.004),
}


@dataclass(frozen=True)
class Trial:
    """One data set of the study: `label` names its row, `multiples` says how many detection limits are hidden."""

    label: str
    case: Case
    seed: int
    multiples: tuple[float, ...] = ()


def seeds(label: str) -> Iterator[int]:
    """An endless series of seeds of its own for each label."""
    rng = np.random.default_rng(crc32(label.encode()))
    while True:
        yield int(rng.integers(2**31))


def nulls(noise: str, count: int, **settings: Any) -> list[Trial]:
    """Nothing hidden, under one of `NOISES`; `settings` are fields of `Case`."""
    case = Case(noise=NOISES[noise], **settings)
    return [Trial(noise, case, seed) for seed in islice(seeds(f"null {noise}"), count)]


def nuisances(count: int, **settings: Any) -> list[Trial]:
    """Nothing hidden but faults of measurement: skew up to 3 ms, windows of one to four cycles, drift."""
    trials = []
    for seed in islice(seeds("nuisances"), count):
        rng = np.random.default_rng([seed, 4])
        chosen = {
            "time_skew": rng.uniform(0.0, 0.003),
            str(rng.choice(["measurement_window", "phasor_window"])): 0.02 * rng.integers(1, 5),
            "load_drift": rng.uniform(-0.005, 0.005),
        }
        faults = tuple((name, float(amount / NUISANCES[name].reference)) for name, amount in chosen.items())
        trials.append(Trial("nuisances", Case(nuisances=faults, **settings), seed))
    return trials


def single(name: str, multiple: float, count: int, **settings: Any) -> list[Trial]:
    """One effect, of the catalogue or outside it, at a multiple of its detection limit on each data set."""
    return [at_limit((name,), (multiple,), seed, **settings) for seed in islice(seeds(name), count)]


def pairs(multiple: float, count: int, **settings: Any) -> list[Trial]:
    """Two physical effects at once, both at a multiple of their limits; every pair comes before one comes again."""
    every = list(combinations(PHYSICAL, 2))
    order = np.random.default_rng(0).permutation(len(every))
    chosen = (every[k] for k in cycle(order))
    return [
        at_limit(names, (multiple, multiple), seed, **settings)
        for names, seed in zip(chosen, islice(seeds("pairs"), count), strict=False)
    ]


def at_limit(names: tuple[str, ...], multiples: tuple[float, ...], seed: int, **settings: Any) -> Trial:
    """A data set with effects at multiples of their own detection limits, less where that makes no physical sense."""
    needed = {what: any(EFFECTS[name].needs == what for name in names) for what in ("swing", "negative")}
    case = Case(**needed | settings)
    limits = np.array([detection_limit(replace(case, effect=name), seed) for name in names])
    most = np.array([EFFECTS[name].largest / EFFECTS[name].reference for name in names])
    sizes = np.minimum(np.array(multiples) * limits, most)
    while True:
        made = replace(case, effect=names, size=tuple(sizes.tolist()))
        try:
            scene(made, seed).responses()
        except (ValueError, ArithmeticError):  # no static load left, a stall, a collapse behind the feeder
            sizes = 0.8 * sizes
            continue
        return Trial(" + ".join(names), made, seed, tuple((sizes / limits).tolist()))


def catalog(multiple: float, count: int, **settings: Any) -> Iterator[Trial]:
    """`single` for every effect of the catalogue."""
    for name in CATALOG:
        yield from single(name, multiple, count, **settings)


def outside(multiple: float, count: int, **settings: Any) -> Iterator[Trial]:
    """`single` for every effect outside the catalogue."""
    for name in OUTSIDE:
        yield from single(name, multiple, count, **settings)
