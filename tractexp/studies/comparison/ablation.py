"""What each switch of an optimizer does, alone and with the others, from whichever variants were
run.

Effects are contrasts within a block, of runs with the same seed or on the same function, in log10
of the objective: variants that differ in one switch give its main effect, four that differ in two
give an interaction. No model is fitted, so what no contrast shows is said to be unknown rather than
guessed.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tractexp.studies.comparison.runs import Variant
from tractexp.studies.comparison.statistics import bootstrap_interval

On = frozenset[str]  # the switches that are on


@dataclass(frozen=True)
class SwitchEffect:
    """By what factor switching on multiplies the objective; below 1 it helps. With a 95 % bootstrap
    interval.

    For an interaction, the factor by which one switch's factor changes when the other is on.
    """

    switches: tuple[str, ...]
    factor: float
    low: float
    high: float
    # the variants behind it: (with, without) or (both, first, second, neither)
    contrasts: tuple[tuple[str, ...], ...]
    seeds: int  # or other blocks
    # of a main effect: share of pairs in which it helps, interval
    better: tuple[float, float, float] | None = None

    @property
    def is_significant(self) -> bool:
        """Whether the interval leaves out 1, which is no effect."""
        return not self.low <= 1.0 <= self.high


@dataclass(frozen=True)
class Ablation:
    """The effects of the switches of one optimizer."""

    switches: tuple[str, ...]
    variants: tuple[str, ...]
    effects: tuple[SwitchEffect, ...]
    company: tuple[SwitchEffect, ...]  # of each switch with most others on, against with fewest
    interactions: tuple[SwitchEffect, ...]
    unknown: tuple[tuple[str, ...], ...]  # switches, or pairs, that these variants cannot tell


@dataclass(frozen=True)
class VariantFamily:
    """Variants of one optimizer that share all settings but switches, by the switches
    that are on.
    """

    switches: tuple[str, ...]
    members: Mapping[On, str]  # names of variants

    def ablation(self, values: Mapping[str, np.ndarray]) -> Ablation | None:
        """Effects from log10 of the objectives of each variant, (blocks,); None where no contrast
        can be made.
        """
        logs = {on: values[name] for on, name in self.members.items()}
        ablation = _Contrasts(dict(self.members), logs, self.switches).ablation()
        return ablation if ablation.effects else None

    def cost(self, spent: Mapping[str, float]) -> dict[str, float]:
        """The simulations {switch: number} that each switch adds, on average over its pairs."""
        pairs = {
            s: [(on | {s}, on) for on in self.members if s not in on and on | {s} in self.members]
            for s in self.switches
        }
        name = self.members
        return {
            s: float(
                np.mean([spent[name[with_]] - spent[name[without]] for with_, without in rows])
            )
            for s, rows in pairs.items()
            if rows
        }


def find_family(variants: Sequence[Variant], plain: Mapping[str, str]) -> VariantFamily | None:
    """The largest family among the variants; None where there is none.

    `plain` says which optimizer another one is with all its switches off.
    """
    families = [
        members
        for optimizer, without in plain.items()
        for members in _list_families(variants, optimizer, without)
    ]
    largest = max(families, key=len, default={})
    if len(largest) < 2:
        return None
    switches = tuple(sorted({switch for on in largest for switch in on}))
    return VariantFamily(switches, {on: v.name for on, v in largest.items()})


def ablate(variants: Sequence[Variant], plain: Mapping[str, str], least: float) -> Ablation | None:
    """Effects from the variants of one optimizer that share all settings but switches; None where
    there are none.

    Objectives count from `least` upwards. Seeds that not all of the variants finished are left out.
    """
    chosen = find_family(variants, plain)
    if chosen is None:
        return None
    members = [v for v in variants if v.name in chosen.members.values()]
    seeds = sorted(set.intersection(*({run.seed for run in v.finished_runs} for v in members)))
    if not seeds:
        return None
    return chosen.ablation(
        {v.name: np.log10([max(v.objectives[s], least) for s in seeds]) for v in members}
    )


def _list_families(
    variants: Sequence[Variant], optimizer: str, plain: str
) -> list[dict[On, Variant]]:
    """Variants of `optimizer` by the switches that are on, one dictionary for each set of other
    settings.
    """
    own = _select_optimizer(variants, optimizer)
    own.sort(key=lambda v: v.name)
    without = _select_optimizer(variants, plain) if plain else []
    switches = _find_switches(own, without)
    groups: dict[frozenset[tuple[str, str]], dict[On, Variant]] = defaultdict(dict)
    for v in own:
        settings = frozenset(_list_other_settings(v, switches))
        groups[settings].setdefault(_list_switches_on(v, switches), v)
    for v in without:
        for settings, family in groups.items():
            if _list_other_settings(v, switches) <= settings:
                family.setdefault(_list_switches_on(v, switches), v)
    return list(groups.values())


def _select_optimizer(variants: Sequence[Variant], optimizer: str) -> list[Variant]:
    """The variants of an optimizer, by its name."""
    return [v for v in variants if v.settings.get("name") == optimizer]


def _find_switches(own: Sequence[Variant], without: Sequence[Variant]) -> set[str]:
    """The switches that differ among variants; beside an optimizer `without` them all that it
    lacks.
    """
    flags: set[str] = set()
    for v in own:
        flags |= {k for k, value in v.settings.items() if isinstance(value, bool)}
    switches = {k for k in flags if len({v.settings.get(k) for v in own}) > 1}
    if without:
        known = {k for v in without for k in v.settings}
        switches |= flags - known
    return switches


def _list_switches_on(variant: Variant, switches: set[str]) -> On:
    """The switches that are on in a variant."""
    return frozenset(k for k in switches if variant.settings.get(k))


def _list_other_settings(variant: Variant, switches: set[str]) -> set[tuple[str, str]]:
    """(setting, value) of a variant without its switches and its name."""
    others = {*variant.settings} - switches - {"name"}
    return {(k, repr(variant.settings[k])) for k in others}


@dataclass(frozen=True)
class _Contrasts:
    """Which variants differ in a switch, or in two, and by how much their objectives."""

    names: dict[On, str]
    logs: dict[On, np.ndarray]  # log10 of the objective, by seed
    switches: tuple[str, ...]

    def ablation(self) -> Ablation:
        """The effects of switches, alone, in company and in pairs."""
        single = {(s,): self._pairs(s) for s in self.switches}
        double = {pair: self._squares(*pair) for pair in combinations(self.switches, 2)}
        company = {(s,): self._ends(s) for s in self.switches}
        effects, changes, interactions = (
            tuple(self._effect(key, rows) for key, rows in contrasts.items() if rows)
            for contrasts in (single, company, double)
        )
        unknown = tuple(key for key, rows in (single | double).items() if not rows)
        return Ablation(
            self.switches, tuple(self.names.values()), effects, changes, interactions, unknown
        )

    def _effect(self, switches: tuple[str, ...], contrasts: list[tuple[On, ...]]) -> SwitchEffect:
        """Signs alternate as in a factorial design: with - without, or both - first - second +
        neither.
        """
        simple = len(contrasts[0]) == 2
        signs = np.array((1.0, -1.0) if simple else (1.0, -1.0, -1.0, 1.0))
        shifts = np.array([signs @ [self.logs[on] for on in row] for row in contrasts])
        logs = shifts.mean(axis=0)
        low, high = bootstrap_interval(logs)
        names = tuple(tuple(self.names[on] for on in row) for row in contrasts)
        effect = SwitchEffect(
            switches, 10.0 ** float(logs.mean()), 10.0**low, 10.0**high, names, len(logs)
        )
        if not simple:
            return effect
        wins = np.mean((shifts < 0) + 0.5 * (shifts == 0), axis=0)
        return replace(effect, better=(float(wins.mean()), *bootstrap_interval(wins)))

    def _pairs(self, switch: str) -> list[tuple[On, ...]]:
        """(with, without) of a switch, all else alike."""
        return self._select_existing([(on | {switch}, on) for on in self.logs if switch not in on])

    def _squares(self, a: str, b: str) -> list[tuple[On, ...]]:
        """(both, first, second, neither) of two switches, all else alike."""
        return self._select_existing(
            [(on | {a, b}, on | {a}, on | {b}, on) for on in self.logs if not {a, b} & on]
        )

    def _ends(self, switch: str) -> list[tuple[On, ...]]:
        """The pair with most other switches on, then the pair with fewest; nothing where there is
        one company only.
        """
        pairs = sorted(self._pairs(switch), key=lambda pair: (len(pair[1]), sorted(pair[1])))
        return [(*pairs[-1], *pairs[0])] if pairs and len(pairs[-1][1]) > len(pairs[0][1]) else []

    def _select_existing(self, rows: list[tuple[On, ...]]) -> list[tuple[On, ...]]:
        """Those contrasts of which every variant is there."""
        return [row for row in rows if all(on in self.logs for on in row)]
