"""From a case and a seed to records: the load and the dips are drawn, the effects hidden, the noise
added.
"""

import json
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from hidden_effects import devices
from hidden_effects.effects import CATALOG, NUISANCES
from hidden_effects.hidden import Hidden
from hidden_effects.imperfections import IMPERFECTIONS
from hidden_effects.laws import LAWS
from hidden_effects.motor import Motor
from hidden_effects.noise import Noise
from hidden_effects.outside import OUTSIDE
from hidden_effects.recorder import Recorder
from hidden_effects.site import Response, Site
from independent import Dip, Load, Machine, Static

EFFECTS: dict[str, type[Hidden]] = CATALOG | OUTSIDE | LAWS | NUISANCES | IMPERFECTIONS
SLOWEST = 0.75  # pu: a base case whose motors get slower than this is drawn anew


@dataclass(frozen=True)
class Case:
    """What to make. `size` counts references of each effect (`hidden_effects.sizes()`); `nuisances`
    likewise, and `imperfections`: the load's own departures from any model, which are there beside
    whatever is hidden.

    `events`: dips, or how many to draw; a drawn dip swings in frequency or is unbalanced where
    `swing` or `negative` say so, or where an effect needs it. `load`: None draws one. `spread`: how
    far the static load differs from event to event, relative. f is recorded where it swings, U2
    where there is any.
    """

    effect: str | tuple[str, ...] | None = None
    size: float | tuple[float, ...] = 1.0
    events: int | tuple[Dip, ...] = 1
    noise: Noise = field(default_factory=Noise)
    nuisances: tuple[tuple[str, float], ...] = ()
    imperfections: tuple[tuple[str, float], ...] = ()
    load: Load | None = None
    recorder: Recorder = field(default_factory=Recorder)
    spread: float = 0.05
    swing: bool = False
    negative: bool = False

    @property
    def hidden(self) -> tuple[tuple[str, float], ...]:
        """(name, size) of each effect; ValueError for an unknown name or sizes that
        do not match.
        """
        names = (
            ()
            if self.effect is None
            else (self.effect,)
            if isinstance(self.effect, str)
            else self.effect
        )
        sizes = self.size if isinstance(self.size, tuple) else (self.size,) * len(names)
        for name in (*names, *(name for name, _ in (*self.nuisances, *self.imperfections))):
            if name not in EFFECTS:
                raise ValueError(f"there is no effect '{name}'; there are {', '.join(EFFECTS)}")
        if len(sizes) != len(names):
            raise ValueError(
                f"{len(names)} effects have {len(sizes)} sizes; give one size, or one of each"
            )
        return tuple(zip(names, sizes, strict=True))

    def needs(self, what: str) -> bool:
        """Whether its drawn dips swing in frequency ("swing") or are unbalanced ("negative")."""
        return getattr(self, what) or any(EFFECTS[name].needs == what for name, _ in self.hidden)


@dataclass(frozen=True)
class Scene:
    """A case with everything drawn but the noise."""

    load: Load
    dips: tuple[Dip, ...]
    static: tuple[complex, ...]  # pu, what the static load draws before each event
    effects: tuple[tuple[str, Hidden], ...]
    nuisances: tuple[tuple[str, Hidden], ...]
    imperfections: tuple[tuple[str, Hidden], ...]
    recorder: Recorder

    def power(self, event: int) -> complex:
        """P0 + j Q0 [pu] of one event."""
        return self.load.steady_power(self.dips[event].before) + self.static[event]

    def site(self, event: int) -> Site:
        """The site of one event, effects and nuisances in place."""
        load, dip = self.load, self.dips[event]
        motor = Motor(load.machine, load.rating, load.torque)
        site = Site(
            dip,
            self.power(event),
            (motor,),
            devices.Static(load.static.p_v, load.static.q_v),
            self.recorder,
        )
        for _, effect in (*self.imperfections, *self.effects, *self.nuisances):
            site = effect.apply(site)
        return site

    def responses(self) -> list[Response]:
        """The solved events; raises `Stall` or `ValueError` where there is no steady state."""
        return [self.site(k).response() for k in range(len(self.dips))]

    def records(self) -> list[dict[str, np.ndarray]]:
        """The clean records: t [s], U, P, Q [pu] and, where there are any, f [Hz] and U2 [pu]; each
        (samples,).
        """
        return [self._record(response) for response in self.responses()]

    def _record(self, response: Response) -> dict[str, np.ndarray]:
        dip, recorder = response.site.dip, response.site.recorder
        record = {"t": recorder.t, **recorder.read(response.at, dip)}
        if any(d.swing for d in self.dips):
            record["f"] = dip.frequency(recorder.t)
        if any(d.negative for d in self.dips):
            record["U2"] = dip.negative * dip.shape(recorder.t)
        return record


def scene(case: Case, seed: int) -> Scene:
    """Everything the seed draws, the same for every size: load, dips, static powers, details of the
    effects.
    """
    count = case.events if isinstance(case.events, int) else len(case.events)
    load, dips = _drawn(
        seed, case.events, case.load, case.recorder, case.needs("swing"), case.needs("negative")
    )
    levels = 1 + case.spread * np.random.default_rng([seed, 3]).uniform(-1, 1, (count, 2))
    static = tuple(complex(load.static.P * P, load.static.Q * Q) for P, Q in levels)

    def instances(named: tuple[tuple[str, float], ...]) -> tuple[tuple[str, Hidden], ...]:
        rngs = {name: np.random.default_rng([seed, crc32(name.encode())]) for name, _ in named}
        return tuple((name, EFFECTS[name].of(size, rngs[name], dips)) for name, size in named)

    hidden, faults, own = (
        instances(named) for named in (case.hidden, case.nuisances, case.imperfections)
    )
    return Scene(load, dips, static, hidden, faults, own, case.recorder)


@lru_cache(maxsize=256)
def _drawn(
    seed: int,
    events: int | tuple[Dip, ...],
    load: Load | None,
    recorder: Recorder,
    swing: bool,
    negative: bool,
) -> tuple[Load, tuple[Dip, ...]]:
    """Load and dips that the base case survives."""
    rng = np.random.default_rng([seed, 1])
    given = load is not None and not isinstance(events, int)
    for _ in range(40):
        chosen = draw_load(rng) if load is None else load
        dips = (
            draw_dips(rng, events, recorder, swing, negative) if isinstance(events, int) else events
        )
        if given:
            return chosen, dips
        base = Scene(
            chosen,
            dips,
            (complex(chosen.static.P, chosen.static.Q),) * len(dips),
            (),
            (),
            (),
            recorder,
        )
        if all(response.lowest_speed > SLOWEST for response in base.responses()):
            return chosen, dips
    raise ValueError(
        f"seed {seed}: no load was drawn whose motors survive these dips; give shallower or shorter"
        " ones"
    )


def draw_load(rng: np.random.Generator) -> Load:
    """A load of the third-order class: a motor without stator resistance beside an exponential
    static load.
    """
    machine = Machine(
        Rs=0.0,
        Xs=rng.uniform(0.07, 0.13),
        Xm=rng.uniform(2.5, 4.0),
        Rr=rng.uniform(0.012, 0.03),
        Xr=rng.uniform(0.08, 0.18),
        H=rng.uniform(0.4, 1.5),
    )
    P0, share, torque = rng.uniform(0.6, 1.0), rng.uniform(0.3, 0.6), rng.uniform(0.5, 0.8)
    static = Static(
        (1 - share) * P0, rng.uniform(0.05, 0.25) * P0, rng.uniform(0.8, 2.0), rng.uniform(1.5, 4.0)
    )
    return Load(machine, share * P0 / torque, torque, static)


def draw_dips(
    rng: np.random.Generator,
    count: int,
    recorder: Recorder,
    swing: bool = False,
    negative: bool = False,
) -> tuple[Dip, ...]:
    """Dips of 5-60 % and 60-600 ms, half a second into the record; several are spread over the
    range of depths.
    """
    strata = rng.permutation(count) if count > 1 else [0]
    step = 1 / recorder.rate
    return tuple(
        _draw_dip(rng, 0.05 + 0.55 * (k + rng.random()) / count, step, swing, negative)
        for k in strata
    )


def _draw_dip(
    rng: np.random.Generator, depth: float, step: float, swing: bool, negative: bool
) -> Dip:
    """A dip whose edges take at least three steps of the record: a phasor's window would not let
    faster ones pass.
    """
    fall = rng.uniform(max(0.02, 3 * step), max(0.04, 6 * step))
    return Dip(
        depth=depth,
        start=rng.uniform(0.45, 0.55),
        duration=fall + float(np.exp(rng.uniform(np.log(0.06), np.log(0.6)))),
        fall=fall,
        rise=rng.uniform(max(0.03, 3 * step), max(0.06, 6 * step)),
        sag=rng.uniform(0.0, 0.4),
        settle=rng.uniform(0.08, 0.3),
        before=rng.uniform(0.97, 1.03),
        negative=float(negative) * rng.uniform(0.3, 0.8) * depth,
        swing=float(swing) * rng.choice([-1, 1]) * rng.uniform(0.4, 1.2),
        swing_rate=rng.uniform(0.5, 1.5),
        swing_decay=rng.uniform(0.5, 1.5),
    )


def make(case: Case, seed: int) -> list[dict[str, np.ndarray]]:
    """The records of a case, one of each event: t, U, P, Q [, f] [, U2], each (samples,).

    Raises ValueError for an unknown effect, one too large to make sense, or a load that has no
    steady state.
    """
    records = scene(case, seed).records()
    return [
        case.noise.add(record, np.random.default_rng([seed, 2, k]))
        for k, record in enumerate(records)
    ]


def truth(case: Case, seed: int) -> dict[str, Any]:
    """What was hidden: effects and nuisances with amounts, the load in the third-order model's
    names, dips, noise.

    `where` [{event, channel, start, end}] are the intervals in which the effects change a channel
    by a tenth of the most they change it, or more; the load itself the same.
    """
    made = scene(case, seed)
    return {
        "note": "synthetic: hidden by an independent generator, see tests/oracle/hidden_effects",
        "seed": seed,
        "effects": [{"name": name, **effect.truth()} for name, effect in made.effects],
        "nuisances": [{"name": name, **effect.truth()} for name, effect in made.nuisances],
        "imperfections": [{"name": name, **effect.truth()} for name, effect in made.imperfections],
        "load": made.load.truth(),
        "events": [
            {"P_s0": S.real, "Q_s0": S.imag, **asdict(dip)}
            for S, dip in zip(made.static, made.dips, strict=True)
        ],
        "noise": asdict(case.noise),
        "where": _where(made),
    }


def _where(made: Scene) -> list[dict[str, Any]]:
    if not made.effects:
        return []
    without = replace(made, effects=())
    found = []
    for k, (record, base) in enumerate(zip(made.records(), without.records(), strict=True)):
        for channel in ("P", "Q"):
            change = np.abs(record[channel] - base[channel])
            seen = record["t"][change >= max(0.1 * change.max(), 1e-9)]
            if len(seen):
                found.append(
                    {
                        "event": k,
                        "channel": channel,
                        "start": float(seen[0]),
                        "end": float(seen[-1]),
                    }
                )
    return found


def write(case: Case, seed: int, folder: Path) -> list[Path]:
    """Write `event1.csv`, ... and, beside them, `truth.json` to a folder; returns the paths of the
    records.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for k, record in enumerate(make(case, seed), 1):
        paths.append(folder / f"event{k}.csv")
        np.savetxt(
            paths[-1],
            np.column_stack(list(record.values())),
            "%.9g",
            ",",
            header=",".join(record),
            comments="",
        )
    (folder / "truth.json").write_text(
        json.dumps(truth(case, seed), indent=1) + "\n", encoding="utf-8"
    )
    return paths
