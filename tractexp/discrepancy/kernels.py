"""Which kernel simulates which set of effects.

A set is fitted by a kernel of its own, no larger than it needs. What it leaves is tested by one that has every other
effect and the pushes beside it, for all sets of textbook effects the same. All give the same response up to rounding.
"""

import functools
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.catalogue import Catalogue
from tractexp.discrepancy.cores import side_by_side
from tractexp.discrepancy.injection import Injection
from tractexp.domain import domain_of
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.problem import Problem
from tractexp.model.declaration import Refused
from tractexp.model.drive import Drive
from tractexp.model.model import Model, compose
from tractexp.noise import Noise
from tractexp.record import Event

Key = tuple[frozenset[str], bool]  # load effects, and whether the other effects and the pushes are beside them


@dataclass(frozen=True, eq=False)
class Family:
    """A base model with all sets of effects of a catalogue."""

    model: Model
    catalogue: Catalogue

    def with_effects(self, names: Iterable[str], pushed: bool = False) -> Model:
        """The model with these load effects, every fault of the measurement and, where `pushed`, the pushes."""
        effects = [self.catalogue[n].effect for n in sorted({*names, *self.catalogue.of_measurement})]
        pushes = [Injection()] if pushed else []
        base = self.model
        model = compose(base.motor, base.static, [*base.effects, *effects, *pushes], base.integration, base.domain)
        return model.behind(base.recorder)

    @functools.cached_property
    def whole(self) -> Model:
        """The model with every textbook effect and the pushes."""
        return self.with_effects(self.catalogue.of_load, True)

    def key(self, names: Iterable[str], tested: bool = False) -> Key:
        """The kernel that fits a set of names, or by which what it leaves is tested."""
        load = frozenset(names) - set(self.catalogue.of_measurement)
        return (load.difference(self.catalogue.of_load) if tested else load), tested

    def of(self, key: Key) -> Model:
        """The model of a kernel. An effect that a member of a family does not take beside it is not tested there."""
        names, tested = key
        if not tested:
            return self.with_effects(names)
        model = self.with_effects({*names, *self.catalogue.of_load}, True)
        try:
            model.compile()
        except Refused:
            beside = set(names)
            for name in self.catalogue.of_load:
                if self.with_effects(beside, True).acceptance(self.catalogue[name].effect).refusal is None:
                    beside.add(name)
            return self.with_effects(beside, True)
        return model


class Kernels:
    """Simulates coordinates (n, D) by the kernel of a set of effects."""

    def __init__(
        self,
        family: Family,
        events: Sequence[Event],
        bounds: Mapping[str, Sequence[float]],
        fixed: Mapping[str, float],
        substeps: int | None = None,
    ):
        self.family, self.events, self.bounds, self.fixed = family, tuple(events), bounds, fixed
        self.bare = Problem(family.model, events, bounds, fixed, substeps)
        self.substeps = max(int(self.bare.step.substeps.max()), self._fewest() if substeps is None else 1)
        self.whole = Problem(family.whole, events, bounds, fixed, self.substeps)
        members = [p.name for member in family.catalogue.members for p in member.effect.parameters]
        self._column = {name: k for k, name in enumerate((*self.whole.space.names, *members))}
        self._likelihoods: dict[Key, tuple[Likelihood, np.ndarray]] = {}
        self._one_at_a_time = threading.Lock()

    def _fewest(self) -> int:
        """Steps that the model of everything needs where every effect is at its null: some are stiff."""
        domain = domain_of(self.family.model)
        if not domain.stiff:
            return 1
        whole = Problem(self.family.whole, self.events, self.bounds, self.fixed, 1)
        null = [p.default if p.null is None else p.null for p in whole.parameters]
        return int(whole.model.substeps(whole.drive, np.array(null), domain.finest)[0].max())

    def residuals(self, key: Key, unit: np.ndarray) -> np.ndarray:
        """Calculated minus measured (n, C, N) [pu] at coordinates (n, D)."""
        likelihood, columns = self._of(key)
        return likelihood.residuals(unit[:, columns])

    def simulate(self, names: Iterable[str], unit: np.ndarray, drive: Drive) -> np.ndarray:
        """What is compared (n, C, N) [pu] under other voltages, with these effects at coordinates (n, D)."""
        likelihood, columns = self._of(self.family.key(names))
        problem = likelihood.problem
        values = problem.full(likelihood.values(unit[:, columns]))

        def simulated(part: np.ndarray) -> np.ndarray:
            response = problem.model.simulate(drive, part, self.substeps)
            return response.by_candidate

        return side_by_side(simulated, values)

    def _of(self, key: Key) -> tuple[Likelihood, np.ndarray]:
        """The likelihood by one kernel, and where its coordinates stand among all."""
        with self._one_at_a_time:
            if key not in self._likelihoods:
                model = self.family.of(key)
                bounds = {n: v for n, v in self.bounds.items() if n in model.names}
                fixed = {n: v for n, v in self.fixed.items() if n in model.names}
                problem = Problem(model, self.events, bounds, fixed, self.substeps)
                unweighted = Noise.white(*np.ones(problem.drive.channels))  # residuals alone are asked for
                own, before = [self._column[n] for n in problem.space.names], np.arange(2 * len(self.events))
                columns = np.r_[own, len(self._column) + before].astype(int)
                self._likelihoods[key] = Likelihood.of(problem, unweighted), columns
            return self._likelihoods[key]
