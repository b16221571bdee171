"""Recorded waveforms of known loads: drawn, simulated by `independent.circuit`, and made records of
the product.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import oracle  # noqa: F401

from independent import Machine, Stall
from independent.circuit import Branch, Device, Group, Shunt, drawn
from independent.fault import Fault
from independent.sampler import Sampler

BASE_VOLTAGE, BASE_POWER, NOMINAL = 110.0, 20.0, 50.0  # kV line to line, MVA, Hz
RATES = (1200.0, 1600.0, 3200.0, 4800.0, 6400.0)  # Hz
KINDS = ("phase to earth", "two phases", "three phases")
AFTER = 0.4  # s of record after the fault
ESTIMATOR = {"name": "one_cycle"}


@dataclass(frozen=True)
class Site:
    """A load of devices: `group` the motors whose parameters are known, `more` what may be hidden
    beside.
    """

    group: Group
    branch: Branch
    shunt: Shunt
    more: tuple[Device, ...] = ()

    @property
    def devices(self) -> tuple[Device, ...]:
        return self.group, self.branch, self.shunt, *self.more

    def truth(self, power: float = BASE_POWER) -> dict[str, float]:
        """What the model `fifth_order_branch` calls it, per unit of so many MVA."""
        there = power / BASE_POWER
        on_base = {"X_prime": there, "R_s": there, "M": 1 / there, "T_m": 1 / there}
        truth = {name: value * on_base.get(name, 1.0) for name, value in self.group.truth().items()}
        return truth | {"branch_resistance": self.branch.R / self.branch.X}


@dataclass(frozen=True)
class Case:
    """A site, what happens to it, and who records that."""

    site: Site
    faults: tuple[Fault, ...]
    sampler: Sampler
    kinds: tuple[str, ...] = field(default=())


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def site(rng: np.random.Generator) -> Site:
    """A motor group that takes 30 to 80 % of the power, a branch and a conductance for the rest."""
    machine = Machine(
        Rs=_log(rng, 0.01, 0.05),
        Xs=rng.uniform(0.08, 0.15),
        Xm=rng.uniform(2.0, 3.5),
        Rr=_log(rng, 0.01, 0.03),
        Xr=rng.uniform(0.08, 0.18),
        H=_log(rng, 0.3, 1.2),
    )
    rating, torque = rng.uniform(0.35, 0.9), rng.uniform(0.5, 0.85)
    left, X = 1 - rating * torque, rng.uniform(2.0, 6.0)
    R = X * _log(rng, 0.1, 1.0)
    return Site(
        Group(machine, rating, torque), Branch(R, X), Shunt(max(left - R / (R**2 + X**2), 0.02))
    )


def fault(rng: np.random.Generator, kind: str | None = None) -> tuple[Fault, str]:
    """A fault of two to eight cycles with a jump of phase, on a voltage with a fifth and a seventh
    harmonic.
    """
    kind = kind or str(rng.choice(KINDS))
    share, turn = rng.uniform(0.05, 0.7), rng.uniform(-0.35, 0.15)
    kept = share * np.exp(1j * turn)
    slight = 1 + rng.uniform(-0.08, 0.03, 3) * np.exp(1j * rng.uniform(-1, 1, 3))
    if kind == "phase to earth":
        left = (kept, *slight[1:])
    elif kind == "two phases":  # they meet half-way between their phasors
        a = np.exp(2j * np.pi / 3)
        b, c = a**2, a
        middle, gap = (b + c) / 2, share * (b - c) / 2 * np.exp(1j * turn)
        left = slight[0], (middle + gap) / b, (middle - gap) / c
    else:
        left = (kept * slight[0], kept * slight[1], kept * slight[2])
    made = Fault(
        tuple(map(complex, left)),
        start=rng.uniform(0.12, 0.2),
        duration=rng.integers(4, 17) / 2 / NOMINAL,
        voltage=rng.uniform(0.97, 1.04),
        frequency=NOMINAL + rng.uniform(-0.1, 0.1),
        angle=rng.uniform(-np.pi, np.pi),
        edge=rng.uniform(0.6e-3, 2e-3),
        sag=rng.uniform(0, 0.25),
        settle=rng.uniform(0.04, 0.15),
        harmonics=tuple(
            (h, rng.uniform(0.3, 1) * 0.01, rng.uniform(-np.pi, np.pi)) for h in (5, 7)
        ),
    )
    return made, kind


def sampler(rng: np.random.Generator) -> Sampler:
    """Any common rate, noise 60 dB below the signal, offsets of half a percent, 14 to 16 bits."""
    rate, bits = float(rng.choice(RATES)), int(rng.integers(14, 17))
    return Sampler(
        rate, 1e-3, tuple((0.005 * rng.uniform(-1, 1, 6)).tolist()), bits, current_span=12.0
    )


def case(seed: Sequence[int], dips: int = 1, kind: str | None = None) -> Case:
    """A drawn case; one whose motors have no steady state, or stall, is drawn anew
    by `recorded`.
    """
    rng = np.random.default_rng(list(seed))
    of = site(rng)
    faults = [fault(rng, kind) for _ in range(dips)]
    return Case(of, tuple(f for f, _ in faults), sampler(rng), tuple(k for _, k in faults))


def samples(case: Case, seed: Sequence[int]) -> list[np.ndarray]:
    """Samples (6, n) [pu] of each fault of a case, from 0 s on."""
    made = []
    for k, happened in enumerate(case.faults):
        t = case.sampler.instants(0.0, happened.end + AFTER)
        rng = np.random.default_rng([*seed, 77, k])
        made.append(case.sampler.read(drawn(case.site.devices, happened, t), 0.0, rng))
    return made


def record(x: np.ndarray, rate: float, name: str):
    """The product's record of samples (6, n) [pu]: phasors by its estimator, and the waveforms
    beside them.
    """
    from tractexp.record import Record
    from tractexp.record.phasor_measurement import measure
    from tractexp.record.record import Base
    from tractexp.record.waves import Waves
    from tractexp.recording.estimator import estimator_of

    base, peak = Base(BASE_VOLTAGE, BASE_POWER, NOMINAL), BASE_VOLTAGE * np.sqrt(2 / 3)
    waves = x * np.repeat([peak, 2 * BASE_POWER / (3 * peak)], 3)[:, None]
    seen = measure(waves, rate, NOMINAL, 0.0, window=estimator_of(ESTIMATOR).averager)
    made = base.per_unit({"U": seen.U, "P": seen.S.real, "Q": seen.S.imag, "U2": seen.U2})
    kept = Waves(waves, 0.0, rate, ESTIMATOR)
    return Record(name, t=seen.t, f=seen.f, base=base, source=name, waves=kept, **made).check()


def events(case: Case, seed: Sequence[int]) -> list:
    """The product's events of a case."""
    from tractexp.record import detect

    return [
        detect(record(x, case.sampler.rate, f"dip {k}"))
        for k, x in enumerate(samples(case, seed), start=1)
    ]


def drawn_events(seed: Sequence[int], dips: int = 1, **changes) -> tuple[Case, list]:
    """A case and its events; draws that have no steady state or hold no dip are taken anew."""
    from tractexp.errors import UserError

    for attempt in range(50):
        made = case([*seed, attempt], dips)
        made = replace(made, **changes)
        try:
            return made, events(made, [*seed, attempt])
        except (Stall, UserError):
            continue
    raise RuntimeError(f"nothing can be drawn from seed {list(seed)}")
