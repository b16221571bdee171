"""The base model and the extended one, graded as an identification grades them.

The fits of an investigation rank effects. What a model is good for is told by
`tractexp.identification.grade` alone: on the same events, in the same roles, with the bounds that
the user set, and behind the recorder's window where the investigation takes one into account.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tractexp.identification.grade import GradedModel, grade_model
from tractexp.inference.catalogue import Catalogue
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.problem import Problem
from tractexp.model.model import Model, compose
from tractexp.noise import Noise
from tractexp.record import Event


def fit_as_graded(context: Context, noise: Noise, graded: GradedModel) -> Refit:
    """The base model as it is graded, as a fit of a context whose powers before events are those
    measured: so it has one error, whoever asks.
    """
    at = context.coordinates
    values = dict(zip(graded.problem.space.names, graded.values.tolist(), strict=True))
    unit = at.place_values(at.null, values)
    rows = context.rows(unit[None], noise, (), [()])
    return Refit((), unit, float(np.sum(rows**2)), 0)


@dataclass(frozen=True, eq=False)
class Grader:
    """What an investigation was asked, as far as grades hang on it; models that were graded once
    are kept.
    """

    base: Model
    catalogue: Catalogue
    train: tuple[Event, ...]
    validate: tuple[Event, ...]
    bounds: Mapping[str, Sequence[float]]
    fixed: Mapping[str, float]
    substeps: int | None = None
    priors: bool = False
    shown: Collection[str] = ()  # effects that the base model has because its records show them
    # where an identification's search ends, (d,) free values
    search: Callable[[Problem], np.ndarray] | None = None
    known: dict[str, GradedModel] = field(default_factory=dict)

    def grade(
        self,
        names: Sequence[str],
        window: float | str | None,
        held: Mapping[str, float] | None = None,
        found: Mapping[str, float] | None = None,
        *,
        fit_all: bool = False,
    ) -> GradedModel:
        """The base model with the named effects, behind a recorder's `window`, some parameters held
        at values.

        `found` are values where a fit of the investigation ended: a relay's times have hardly a
        slope, and a search alone may end far from them. With `fit_all` the held-out events are
        fitted like the others.
        """
        fixed = {**self.fixed, **(held or {})}
        key = repr((sorted(names), window, sorted(fixed.items()), fit_all))
        if key not in self.known:
            fitted, judged = (
                ((*self.train, *self.validate), ()) if fit_all else (self.train, self.validate)
            )
            model = self._extend_base(names, window)
            problem = Problem(
                model,
                fitted,
                self.bounds,
                fixed,
                self.substeps,
                priors=self.priors,
            )
            start = self._choose_start(problem, found or {})
            self.known[key] = grade_model(problem, judged, start, self.shown)
        return self.known[key]

    def _choose_start(self, problem: Problem, found: Mapping[str, float]) -> np.ndarray | None:
        """Free values (d,): where a search ends, or those found where they fit better; None without
        either.
        """
        starts = [] if self.search is None else [self.search(problem)]
        if all(name in found for name in problem.space.names):
            values = np.array([found[name] for name in problem.space.names])
            starts.append(np.clip(values, problem.lower, problem.upper))
        if not starts:
            return None
        return starts[int(np.argmin(problem.objective(np.array(starts))))]

    def _extend_base(self, names: Sequence[str], window: float | str | None) -> Model:
        """The base model with further effects, behind a recorder's window."""
        base = self.base
        own = {effect.name for effect in self.base.effects}
        added = [self.catalogue[name].effect for name in names if name not in own]
        return compose(
            base.motor, base.static, [*base.effects, *added], base.integration, base.domain, window
        )
