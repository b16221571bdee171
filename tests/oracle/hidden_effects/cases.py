"""The suites of the study: what is hidden where, under which noise. Each trial is a case and a
seed.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, cycle
from typing import Any
from zlib import crc32

import numpy as np

from hidden_effects.effects import NUISANCES, PHYSICAL
from hidden_effects.generator import EFFECTS, Case, scene
from hidden_effects.imperfections import FOREIGN, IMPERFECTIONS
from hidden_effects.limits import detection_limit, joint_limit, misfit, size_of_error
from hidden_effects.noise import Noise
from hidden_effects.recorder import Recorder

MULTIPLES = (0.5, 1.0, 2.0, 4.0, 8.0)  # of the detection limit
RATES = (50.0, 100.0, 200.0, 500.0, 1000.0)  # Hz, of records in the field
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
    """One data set of the study: `label` names its row, `multiples` says how many detection limits
    are hidden.
    """

    label: str
    case: Case
    seed: int
    multiples: tuple[float, ...] = ()


@dataclass(frozen=True)
class Planned:
    """A trial that is not made yet: limits and sizes take longer than the rest of a study's
    book-keeping.
    """

    label: str
    seed: int
    make: Callable[[], Trial]


def seeds(label: str, salt: int | None = None) -> Iterator[int]:
    """An endless series of seeds of its own for each label, and for each salt where
    one is given.
    """
    own = crc32(label.encode())
    rng = np.random.default_rng(own if salt is None else [salt, own])
    while True:
        yield int(rng.integers(2**31))


def nulls(noise: str, salt: int | None = None, **settings: Any) -> Iterator[Planned]:
    """Nothing hidden, under one of `NOISES`; `settings` are fields of `Case`."""
    case = Case(noise=NOISES[noise], **settings)
    return (
        Planned(noise, seed, partial(Trial, noise, case, seed))
        for seed in seeds(f"null {noise}", salt)
    )


def nuisances(salt: int | None = None, **settings: Any) -> Iterator[Planned]:
    """Nothing hidden but faults of measurement: skew up to 3 ms, windows of one to four cycles,
    drift.
    """
    for seed in seeds("nuisances", salt):
        rng = np.random.default_rng([seed, 4])
        chosen = {
            "time_skew": rng.uniform(0.0, 0.003),
            str(rng.choice(["measurement_window", "phasor_window"])): 0.02 * rng.integers(1, 5),
            "load_change": rng.uniform(-0.005, 0.005),
        }
        faults = tuple(
            (name, float(amount / NUISANCES[name].reference)) for name, amount in chosen.items()
        )
        yield Planned(
            "nuisances", seed, partial(Trial, "nuisances", Case(nuisances=faults, **settings), seed)
        )


def imperfect(
    case: Case, seed: int, error: float, kinds: Sequence[str] = tuple(IMPERFECTIONS)
) -> Case:
    """The case with a load of which the base model, once fitted, misses about `error` of the
    response in S.

    All kinds of imperfection are there at once, in drawn proportions.
    """
    if not error:
        return case
    case = replace(case, swing=case.needs("swing"), negative=case.needs("negative"))
    parts = np.random.default_rng([seed, 5]).dirichlet(np.ones(len(kinds)))
    most = [EFFECTS[name].largest / EFFECTS[name].reference for name in kinds]
    size = 1.0
    for _ in range(3):  # nearly linear
        sizes = np.minimum(size * parts, most).tolist()
        case = replace(case, imperfections=tuple(zip(kinds, sizes, strict=True)))
        try:
            size *= min(error / misfit(case, seed), 4.0)
        except (ValueError, ArithmeticError):  # no steady state
            size *= 0.5
    return case


def inexact(
    error: float, salt: int | None = None, is_foreign: bool = False, **settings: Any
) -> Iterator[Planned]:
    """Nothing hidden in a load that no model is exact for, under each of `NOISES` in turn; foreign
    where what makes it inexact is of no family of the catalogue.
    """
    series, kinds = ("foreign", FOREIGN) if is_foreign else ("inexact", tuple(IMPERFECTIONS))
    label = f"{'foreign ' if is_foreign else ''}error {error:.0%}"

    def made(noise: str, seed: int) -> Trial:
        case = Case(noise=NOISES[noise], **settings)
        return Trial(label, imperfect(case, seed, error, kinds), seed)

    for noise, seed in zip(cycle(NOISES), seeds(series, salt), strict=False):
        yield Planned(label, seed, partial(made, noise, seed))


def in_the_field(
    name: str, multiple: float, salt: int | None = None, **settings: Any
) -> Iterator[Planned]:
    """One effect under a drawn recorder and noise, in a load of which no model is exact to 0.5 % in
    every second set.

    Its size is a multiple of its detection limit, and of the size at which it leaves as much as the
    load's own error.
    """

    def made(seed: int) -> Trial:
        rng = np.random.default_rng([seed, 6])
        rate, window = float(rng.choice(RATES)), str(rng.choice(["", "cycle", "P", "M"]))
        recorder = Recorder(
            rate,
            int(2 * rate) if rate > 50 else 150,
            phasor_window=0.02 * (window == "cycle"),
            pmu=window if window in ("P", "M") else "",
        )
        noise = NOISES[str(rng.choice(list(NOISES)))]
        error = float(rng.choice([0.0, 0.005]))
        return in_an_inexact_load(
            name, multiple, seed, error, **settings | {"noise": noise, "recorder": recorder}
        )

    return (Planned(name, seed, partial(made, seed)) for seed in seeds(f"field {name}", salt))


def loud(name: str, multiple: float, salt: int | None = None, **settings: Any) -> Iterator[Planned]:
    """One effect in noise of 0.1 %, twenty times less than any model of the load leaves, as in
    records of faults.
    """
    own = settings | {"noise": Noise(0.001)}
    made = partial(in_an_inexact_load, name, multiple, error=0.02, **own)
    return (Planned(name, seed, partial(made, seed)) for seed in seeds(f"loud {name}", salt))


def in_an_inexact_load(
    name: str, multiple: float, seed: int, error: float, **settings: Any
) -> Trial:
    """One effect in a load of which no model is exact to `error` of the response."""
    case = imperfect(Case(effect=name, **settings), seed, error)
    return at_limit((name,), multiple, seed, imperfections=case.imperfections, **settings)


def single(
    name: str, multiple: float, salt: int | None = None, **settings: Any
) -> Iterator[Planned]:
    """One effect, of the catalogue or not, at a multiple of its detection limit on
    each data set.
    """
    return (
        Planned(name, seed, partial(at_limit, (name,), multiple, seed, **settings))
        for seed in seeds(name, salt)
    )


def several(
    together: int, multiple: float, salt: int | None = None, **settings: Any
) -> Iterator[Planned]:
    """So many physical effects at once, at a multiple of their joint limit; every set comes before
    one comes again.
    """
    every = list(combinations(PHYSICAL, together))
    order = np.random.default_rng(0 if salt is None else salt).permutation(len(every))
    for k, seed in zip(
        cycle(order), seeds("pairs" if together == 2 else f"{together} at once", salt), strict=False
    ):
        yield Planned(
            " + ".join(every[k]), seed, partial(at_limit, every[k], multiple, seed, **settings)
        )


def at_limit(names: tuple[str, ...], multiple: float, seed: int, **settings: Any) -> Trial:
    """A data set with effects at a multiple of their (joint) detection limit, or, in a load with
    imperfections, of the size at which each leaves as much as those; less where that makes no
    sense.
    """
    needed = {
        what: any(EFFECTS[name].needs == what for name in names) for what in ("swing", "negative")
    }
    case = Case(**needed | settings)
    hidden = replace(case, effect=names if len(names) > 1 else names[0])
    alone = [replace(hidden, effect=name) for name in names]
    limits = np.array(
        joint_limit(hidden, seed) if len(names) > 1 else [detection_limit(hidden, seed)]
    )
    # 0 where the load is exact
    limits = np.maximum(limits, [size_of_error(one, seed) for one in alone])
    most = np.array([EFFECTS[name].largest / EFFECTS[name].reference for name in names])
    sizes = np.minimum(multiple * limits, most)
    while True:
        made = replace(case, effect=names, size=tuple(sizes.tolist()))
        try:
            scene(made, seed).responses()
        # no static load left, a stall, a collapse behind the feeder
        except (ValueError, ArithmeticError):
            sizes = 0.8 * sizes
            continue
        return Trial(" + ".join(names), made, seed, tuple((sizes / limits).tolist()))
