"""Which kernel simulates which set of effects: few kernels, so that they are soon compiled, and each no larger than
its set needs.

Two effects share a kernel nearly as fast as the base model's, for sets of one of them or of both. Larger sets share
one that holds every effect whose equations are short, and the pushes of the adequacy test; a set with a long one takes
the kernel of everything. All give the same response up to rounding.
"""

import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.catalogue import Catalogue
from tractexp.discrepancy.cores import side_by_side
from tractexp.discrepancy.effort import Effort
from tractexp.discrepancy.injection import Injection
from tractexp.domain import domain_of
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.problem import Problem
from tractexp.model.compiling import compile_missing
from tractexp.model.drive import Drive
from tractexp.model.model import Model, compose
from tractexp.record import Event
from tractexp.texts import ADDRESS

LONG = 2.0  # times the source of the base model
SHARED = 2  # effects of one kernel: one each would take longer to compile, more would be slower
_lengths: dict[str, int] = {}  # of kernels' texts, by their parts: families of one model ask for the same
Key = tuple[frozenset[str], bool] | None  # load effects and whether pushes are in; None: everything is


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
        """The model with everything."""
        return self.with_effects(self.catalogue.of_load, True)

    @functools.cached_property
    def short(self) -> frozenset[str]:
        """The load effects whose kernels are not much longer than the base model's."""
        most = LONG * self._length(())
        return frozenset(n for n in self.catalogue.of_load if self._length((n,)) <= most)

    @functools.cached_property
    def groups(self) -> tuple[frozenset[str], ...]:
        """Load effects that share a kernel: short ones of nearly the same length, long ones by themselves."""
        ranked = sorted(self.short, key=lambda n: (self._length((n,)), n))
        together = [frozenset(ranked[k : k + SHARED]) for k in range(0, len(ranked), SHARED)]
        return *together, *(frozenset((n,)) for n in self.catalogue.of_load if n not in self.short)

    def _length(self, names: Iterable[str]) -> int:
        model = self.with_effects(names)
        key = repr((model.motor, model.static, model.effects, model.domain))
        if key not in _lengths or ADDRESS.search(key):
            _lengths[key] = len(model.source)
        return _lengths[key]

    def key(self, names: Iterable[str], pushed: bool = False) -> Key:
        """The kernel that serves a set of names, with pushes or without.

        A member of a family has one by itself, and one with everything.
        """
        load = frozenset(names) - set(self.catalogue.of_measurement)
        if members := load - set(self.catalogue.of_load):
            return (load, False) if load == members and not pushed else (members.union(self.catalogue.of_load), True)
        if not pushed:
            for group in (frozenset(), *self.groups):
                if load <= group:
                    return group, False
        return (self.short, True) if load <= self.short else None

    def compile(self, effort: Effort) -> None:
        """Compile what is not in the cache yet, side by side; say what comes after it where it was long."""
        if compile_missing(
            self._models(),
            lambda: effort.say("compiling kernels, once for this base model and these channels"),
            effort.parts,
        ):
            effort.say("fitting the base model")

    def joins(self, name: str) -> bool:
        """Whether a member of a family goes with the model of everything, by which what it leaves is tested."""
        return self.whole.acceptance(self.catalogue[name].effect).refusal is None

    def compile_members(self, names: Iterable[str], effort: Effort, *, whole: bool = False) -> None:
        """Compile what members of families need, side by side: a kernel each, or with everything where `whole`."""
        load = self.catalogue.of_load
        models = (self.with_effects((n, *load), True) if whole else self.with_effects((n,)) for n in names)
        tell = lambda: effort.say("compiling kernels of families, once for this model")  # noqa: E731
        compile_missing(models, tell, effort.parts)

    def _models(self) -> Iterator[Model]:
        """The largest first."""
        yield self.whole
        yield self.with_effects(self.short, True)
        yield self.model
        yield self.with_effects(())
        for group in self.groups:
            yield self.with_effects(group)


class Kernels:
    """Simulates coordinates (n, D) by the kernel of a set of effects."""

    family: Family
    events: tuple[Event, ...]
    bounds: Mapping[str, Sequence[float]]
    fixed: Mapping[str, float]
    bare: Problem
    whole: Problem
    substeps: int

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
        self._likelihoods: dict[Key, tuple[Likelihood, np.ndarray]] = {None: self._simulator(self.whole)}

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
        if key not in self._likelihoods:
            assert key is not None
            model = self.family.with_effects(*key)
            bounds = {n: v for n, v in self.bounds.items() if n in model.names}
            fixed = {n: v for n, v in self.fixed.items() if n in model.names}
            self._likelihoods[key] = self._simulator(Problem(model, self.events, bounds, fixed, self.substeps))
        return self._likelihoods[key]

    def _simulator(self, problem: Problem) -> tuple[Likelihood, np.ndarray]:
        before = len(self._column) + np.arange(2 * len(self.events))
        return Likelihood.of(problem), np.r_[[self._column[n] for n in problem.space.names], before].astype(int)
