"""Records of random loads in random dips, by the simulator in `independent`: what optimizers are
compared on.

Machine, rating, torque, static load, dip and noise are drawn; a draw is taken again where the load
has no steady state or what the fitted model calls its parameters lies outside that model's default
bounds. The stator has a resistance, which the model does not know, so its lowest objective is above
the noise, as with a record from the field.
"""

from collections.abc import Sequence

import numpy as np
import oracle  # noqa: F401

from independent import Dip, Load, Machine, Recorder, Stall, Static, record
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.identification.result import build_parts
from tractexp.inference.problem import Problem
from tractexp.model.model import Model, compose
from tractexp.record import Event, Record, detect

MODEL = {"motor": {"name": "electromechanical"}, "static": {"name": "exponential"}}
DRAWS = 1000  # before giving up


def model() -> Model:
    """The third-order motor with the exponential static load: seven parameters."""
    return compose(*build_parts(MODEL))


def load(rng: np.random.Generator) -> Load:
    """A machine that takes between a tenth and eight tenths of the active power, and a static load
    for the rest.
    """

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    machine = Machine(
        Rs=rng.uniform(0.0, 0.02),
        Xs=rng.uniform(0.08, 0.2),
        Xm=rng.uniform(1.8, 3.5),
        Rr=log(0.008, 0.035),
        Xr=rng.uniform(0.1, 0.25),
        H=log(0.2, 1.5),
    )
    rating, torque = rng.uniform(0.2, 0.9), rng.uniform(0.5, 0.9)
    static = Static(
        P=1 - rating * torque,
        Q=rng.uniform(0.1, 0.5),
        p_v=rng.uniform(0.5, 2.5),
        q_v=rng.uniform(1.5, 6),
    )
    return Load(machine, rating, torque, static)


def dip(rng: np.random.Generator) -> Dip:
    """From shallow to deep enough to stall some machines."""
    return Dip(
        depth=rng.uniform(0.12, 0.75),
        start=0.3,
        duration=rng.uniform(0.08, 0.4),
        fall=rng.uniform(0.03, 0.06),
        rise=rng.uniform(0.04, 0.1),
        sag=rng.uniform(0.0, 0.5),
        settle=rng.uniform(0.1, 0.3),
    )


def recorder(rng: np.random.Generator) -> Recorder:
    """That of the shipped records, with noise between a third of theirs and three times."""
    noise = float(np.exp(rng.uniform(np.log(1 / 3), np.log(3))))
    return Recorder(step=0.002, voltage_noise=0.01 * noise, current_noise=0.02 * noise, bits=14)


def drawn(seed: Sequence[int]) -> tuple[Event, Load]:
    """The dip of one random record with the load behind it; the same seed gives the same record."""
    rng, known = np.random.default_rng(list(seed)), model().parameters
    for _ in range(DRAWS):
        of, event, by = load(rng), dip(rng), recorder(rng)
        truth = of.truth()
        if not all(p.bounds[0] < truth[p.name] < p.bounds[1] for p in known):
            continue
        try:
            made = record(of, event, by, rng)
            return detect(Record("drawn", *(made[name] for name in ("t", "U", "P", "Q")))), of
        except (Stall, UserError):  # no steady state, or a dip that the noise hides
            continue
    raise RuntimeError(f"no record after {DRAWS} draws from seed {list(seed)}")


def shipped(name: str) -> Event:
    """The dip of a shipped record."""
    train = [f"pkg://tractexp.data/{name}.csv"]
    return detect(build("data", {"name": "csv", "train": train}).read().train[0])


def problem(event: Event) -> Problem:
    """Its identification: seven parameters within their default bounds."""
    return Problem(model(), [event])
