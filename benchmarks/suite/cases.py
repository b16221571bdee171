"""The numbered cases of the benchmark: loads with dips to fit and dips that no method sees.

1 to 20 are public: what is hidden in each stands in `RECIPES`, and their seeds are fixed. 21 to 50
follow the same recipes with loads, dips and noise from a seed that is chosen when the benchmark is
run. 51 to 60 are records: shipped ones, whose truth is known, and of the files beside the
repository, whose truth is not. All made ones come from the independent generator in `tests/oracle`,
which never imports the product's model or effects.
"""

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "oracle"))
SHARED = Path(os.environ.get("TRACTEXP_SHARED", ROOT.parent / "shared"))

EVENTS, FITTED = 5, 3  # dips of a made case, and those that a method is given
MULTIPLE = 4.0  # of the detection limit, of a hidden effect
PUBLIC_SEED = 0
NOTHING, INEXACT = "", "inexact"
RECIPES = (
    *[NOTHING] * 4,
    *[INEXACT] * 4,
    "stator_resistance",
    "feeder_impedance",
    "undervoltage_trip",
    "second_motor_group",
    "speed_dependent_torque",
    "magnetic_saturation",
    "stator_transients",
    "exponential_recovery",
    "constant_power_converter",
    "low_frequency_oscillation",
    "dc_link_lag",
    "voltage_dependent_power_limit",
)
INEXACT_ERROR = 0.01  # of the response, that no model describes
MADE = range(1, 51)
RECORDS = range(51, 61)
ANDES_POWER = 5.05  # of its load before the dip, on the base of its file


@dataclass(frozen=True, eq=False)
class Event:
    """A dip as a method sees it: t [s], U, P, Q [pu], (N,) each, f (N,) [Hz] where it was recorded;
    the first sample of the dip and the nominal frequency [Hz].

    Of a dip that is to be predicted P and Q are nan from `start` on.
    """

    name: str
    t: np.ndarray
    U: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    start: int
    frequency: float
    f: np.ndarray | None = None

    @property
    def power_before(self) -> complex:
        """S before the dip [pu]."""
        return complex(np.nanmean(self.P[: self.start]), np.nanmean(self.Q[: self.start]))

    def hide(self) -> "Event":
        """The event without what the load does in it."""
        before = np.arange(len(self.t)) < self.start
        return replace(self, P=np.where(before, self.P, np.nan), Q=np.where(before, self.Q, np.nan))


@dataclass(frozen=True, eq=False)
class SuiteCase:
    """Dips to fit and dips that judge, and the effects that are hidden; None where nobody knows.

    Of an `inexact` load no model is exact.
    """

    number: int
    fitted: Sequence[Event]
    unused: Sequence[Event]
    truth: tuple[str, ...] | None
    inexact: bool = False


def make_cases(numbers: Sequence[int], seed: int) -> Iterator[SuiteCase]:
    """The cases of these numbers; a record whose file is not there is left out."""
    for number in numbers:
        if number in MADE:
            yield make_case(number, PUBLIC_SEED if number <= len(RECIPES) else 1 + seed)
        elif (record := read_record(number)) is not None:
            yield record


def make_case(number: int, series: int) -> SuiteCase:
    """A case by the generator, from the first seed of its own that has a steady state."""
    from hidden_effects import cases
    from hidden_effects.generator import Case, make
    from hidden_effects.noise import Noise

    recipe = RECIPES[(number - 1) % len(RECIPES)]
    settings: dict[str, Any] = {"noise": Noise(0.003), "events": EVENTS}
    for seed in cases.seeds(f"suite {series} {number}"):
        try:
            if recipe == NOTHING:
                case = Case(**settings)
            elif recipe == INEXACT:
                case = cases.imperfect(Case(**settings), seed, INEXACT_ERROR)
            else:
                case = cases.at_limit((recipe,), MULTIPLE, seed, **settings).case
            dips = [read_event(f"dip{k}", **one) for k, one in enumerate(make(case, seed), 1)]
        except (ValueError, ArithmeticError):
            continue
        truth = () if recipe in (NOTHING, INEXACT) else (recipe,)
        return SuiteCase(number, dips[:FITTED], dips[FITTED:], truth, recipe == INEXACT)
    raise AssertionError("the series of seeds has no end")


def read_event(name: str, frequency: float = 50.0, **columns: np.ndarray) -> Event:
    """The dip in columns t, U, P, Q and, where there is one, f."""
    import tractexp

    (dip, *_) = tractexp.read(**columns, name=name, frequency=frequency)
    return convert_event(dip)


def convert_event(dip: Any) -> Event:
    """A dip of the product as a method sees it."""
    record = dip.record
    return Event(
        record.name,
        record.t,
        record.U,
        record.P,
        record.Q,
        dip.start,
        record.base.frequency,
        record.f,
    )


def read_record(number: int) -> SuiteCase | None:
    """A case of recorded dips; None where its file is not there."""
    import tractexp

    station, andes = SHARED / "data" / "dfr220kv-shandong" / "xtz.cfg", SHARED / "cases" / "andes"
    place = number - RECORDS[0]
    if place in (0, 1):
        dips = tractexp.read(("tibet", "contactors")[place])
        truth = (("stator_transients",), ("undervoltage_trip",))[place]
        return split_case(number, dips, (0, 1), truth)
    if place in (2, 3, 4, 5) and station.is_file():
        transformer, fitted = divmod(place - 2, 2)
        channels = (([0, 1, 2], [16, 17, 18]), ([4, 5, 6], [8, 9, 10]))[transformer]
        dips = tractexp.read(str(station), voltages=channels[0], currents=channels[1])
        return split_case(number, dips, (fitted,), None)
    if place in (6, 7, 8, 9) and (andes / "dip_a.csv").is_file():
        dips = []
        for letter in "abc":
            t, U, P, Q, f = np.loadtxt(andes / f"dip_{letter}.csv", delimiter=",", skiprows=1).T
            power = {"P": P / ANDES_POWER, "Q": Q / ANDES_POWER}
            dips += tractexp.read(t=t, U=U, **power, f=f, name=f"dip_{letter}", frequency=60.0)
        return split_case(number, dips, ((0,), (1,), (2,), (0, 1))[place - 6], None)
    return None


def split_case(
    number: int, dips: Sequence[Any], fitted: Sequence[int], truth: tuple[str, ...] | None
) -> SuiteCase:
    """The dips of these places are fitted, the others judge."""
    events = [convert_event(dip) for dip in dips]
    given = [events[k] for k in fitted]
    return SuiteCase(number, given, [one for one in events if one not in given], truth)
