"""Which kernel simulates which set of effects.

A set is fitted by a kernel of its own, no larger than it needs. What it leaves is tested by kernels
that have further effects beside it: one for all that are cheap, the same for all sets of them, one
for the pushes, and one for each effect that makes every other dear. All give the same response up
to rounding.
"""

import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.domain import find_domain
from tractexp.errors import RefusedEffect
from tractexp.inference.catalogue import Catalogue
from tractexp.inference.fit_problem import FitProblem
from tractexp.inference.injection import PUSHES, Injection
from tractexp.inference.problem import Problem
from tractexp.model.drive import Drive
from tractexp.model.model import Model
from tractexp.model.parts import Effect
from tractexp.record import Event

# Runge-Kutta steps of a search: as many as this share of the box needs, for the rest is stiff, and
# often no machine
STEP_SHARE = 0.95
LONGEST_SEARCH_STEP = 1e-3  # s: effects answer within a millisecond
Key = tuple[frozenset[str], frozenset[str]]  # load effects, and what is tested beside them


@dataclass(frozen=True, eq=False)
class Family:
    """A base model with all sets of effects of a catalogue."""

    model: Model
    catalogue: Catalogue

    def with_effects(self, names: Iterable[str]) -> Model:
        """The model with some load effects and with every fault of the measurement.

        Parameters
        ----------
        names : names
            Of effects, or of the injected perturbations.

        Returns
        -------
        Model
        """
        effects = [self._effect(name) for name in {*names, *self.catalogue.of_measurement}]
        return self.model.extend(effects)

    def _effect(self, name: str) -> Effect:
        """The effect of a name, or the injected perturbations of all balances."""
        return Injection() if name == PUSHES else self.catalogue[name].effect

    @functools.cached_property
    def whole(self) -> Model:
        """The model with every textbook effect and the injected perturbations; too large to be
        simulated.
        """
        return self.with_effects((*self.catalogue.of_load, PUSHES))

    @functools.cached_property
    def cheap(self) -> frozenset[str]:
        """The textbook effects of the load that one kernel may have side by side."""
        return frozenset(
            name for name in self.catalogue.of_load if not self.catalogue[name].effect.iterates
        )

    def key(self, names: Iterable[str], beside: str = "") -> Key:
        """The kernel that fits a set of effects, or that tests one more beside it.

        Parameters
        ----------
        names : names
            The effects of the fit.
        beside : str
            One more effect, or the injected perturbations; "": none.

        Returns
        -------
        (frozenset, frozenset)
            The fitted effects of the load, and what is tested beside them.
        """
        load = frozenset(names) - {*self.catalogue.of_measurement}
        tested = frozenset[str]()
        if beside:
            tested = self.cheap if beside in self.cheap else frozenset((beside,))
        return load - tested, tested

    def build_model(self, key: Key) -> Model:
        """The model of a kernel. An effect that a member of a family does not take beside it is not
        tested there.
        """
        names, tested = key
        model = self.with_effects(names | tested)
        try:
            if tested:
                model.compile()
        except RefusedEffect:
            beside = set(names)
            for name in sorted(tested):
                if self.with_effects(beside).acceptance(self._effect(name)).refusal is None:
                    beside.add(name)
            return self.with_effects(beside)
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
        *,
        priors: bool = False,
    ):
        """Prepare the kernels of a family of models on some events.

        Parameters
        ----------
        family : Family
            A base model with all sets of effects.
        events : sequence of Event
            What drives them.
        bounds : {name: (lower, upper)}
            Of the base model's parameters, in their units.
        fixed : {name: value}
            Parameters that are held.
        substeps : int or None
            Runge-Kutta steps per sample; None: as many as needed.
        priors : bool
            Whether there is a prior on the motor.
        """
        self.family = family
        self.events = tuple(events)
        self.bounds = bounds
        self.fixed = fixed
        self.bare = Problem(family.model, events, bounds, fixed, substeps, priors=priors)
        self.substeps = self.box_substeps = int(self.bare.step.substeps.max())
        if substeps is None:
            self.bare = self.bare.with_steps_of(STEP_SHARE)
            within = math.ceil(
                max(event.record.step for event in events) / LONGEST_SEARCH_STEP - 1e-9
            )
            own = max(int(self.bare.step.substeps.max()), min(within, self.box_substeps))
            self.substeps = max(own, self._fewest())
        # of all coordinates
        self.whole = Problem(family.whole, events, bounds, fixed, self.substeps)
        members = [p.name for member in family.catalogue.members for p in member.effect.parameters]
        self._column = {name: k for k, name in enumerate((*self.whole.space.names, *members))}
        self._fit_problems: dict[Key, tuple[FitProblem, np.ndarray]] = {}

    def too_coarse(self, values: np.ndarray) -> bool:
        """Whether fits of the base model's free values (n, d) lie where the steps are longer than
        in the whole box.
        """
        return self.substeps < self.box_substeps and self.substeps < self.bare.steps_at(values)

    def _fewest(self) -> int:
        """Steps that the models need by which effects are tested, every effect at its null: some
        are stiff.
        """
        domain = find_domain(self.family.model)
        family = self.family
        if not domain.stiff:
            return 1
        keys = {family.key((), name) for name in (*family.catalogue.of_load, PUSHES)}
        most = 1
        for problem in (self._problem(key, 1) for key in keys):
            null = np.array([p.default if p.null is None else p.null for p in problem.parameters])
            most = max(
                most, int(problem.model.substeps(problem.drive, null, domain.finest)[0].max())
            )
        return most

    def residuals(self, key: Key, unit: np.ndarray) -> np.ndarray:
        """Calculated minus measured (n, C, N) [pu] at coordinates (n, D)."""
        fit_problem, columns = self._build_fit_problem(key)
        return fit_problem.residuals(unit[:, columns])

    def select_problem(self, names: Iterable[str], unit: np.ndarray) -> tuple[Problem, np.ndarray]:
        """The problem of a set of effects, and its free values.

        Parameters
        ----------
        names : names
            The effects.
        unit : (..., D)
            Coordinates of the whole context.

        Returns
        -------
        Problem
        (..., d) array
            In physical units.
        """
        fit_problem, columns = self._build_fit_problem(self.family.key(names))
        return fit_problem.problem, fit_problem.values(unit[..., columns])

    def simulate(self, names: Iterable[str], unit: np.ndarray, drive: Drive) -> np.ndarray:
        """Simulate a set of effects under other voltages.

        Parameters
        ----------
        names : names
            The effects.
        unit : (n, D)
            Coordinates of the whole context.
        drive : Drive
            The other events.

        Returns
        -------
        (n, C, N) array [pu]
            What is compared.
        """
        problem, free = self.select_problem(names, unit)
        return problem.model.simulate(drive, problem.full(free), self.substeps).by_candidate

    def _build_fit_problem(self, key: Key) -> tuple[FitProblem, np.ndarray]:
        """The fit problem of one kernel, and where its coordinates stand among all."""
        if key not in self._fit_problems:
            problem = self._problem(key, self.substeps)
            own = [self._column[n] for n in problem.space.names]
            before = np.arange(2 * len(self.events))
            columns = np.r_[own, len(self._column) + before].astype(int)
            self._fit_problems[key] = (
                FitProblem(problem=problem, valid=problem.drive.weights > 0),
                columns,
            )
        return self._fit_problems[key]

    def _problem(self, key: Key, substeps: int) -> Problem:
        """The problem of the model with some effects, at so many substeps a sample."""
        model = self.family.build_model(key)
        bounds = {n: v for n, v in self.bounds.items() if n in model.names}
        fixed = {n: v for n, v in self.fixed.items() if n in model.names}
        return Problem(model, self.events, bounds, fixed, substeps)
