"""What another structure would make of the parameters: the bias that no scatter of residuals holds.

A model that lacks a stator resistance, or whose static load follows another law, is fitted again
with it, from where its own fit ended. Where that fits as well or better, each parameter that both
have moves. The move is told beside the estimate, and where more than noise is left the interval
reaches over it (docs/coverage.md has how often that holds). Which structures are tried the
plugins say (`Part.rival`); an effect that the equations refuse is none, and neither is a static
load that refuses an effect of the model.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.configuration.plugin import discover, get
from tractexp.errors import UserError
from tractexp.identification.uncertainty import Uncertainty, compute_threshold
from tractexp.identification.verdict import (
    IDENTIFIED,
    IDENTIFIED_SHARE,
    ParameterVerdict,
    choose_scale,
)
from tractexp.inference.problem import Problem
from tractexp.model.model import Model, compose
from tractexp.parameter import spread_evenly
from tractexp.text.progress import Counting, make_silent_counter

STARTS = 5  # of the parameters that the rival alone has


@dataclass(frozen=True, eq=False)
class RivalStructure:
    """Another structure that fits as well as the model.

    Attributes
    ----------
    name : str
        The static load or the effect that it has.
    squares : float
        Its objective over the model's.
    values : {name: value}
        The parameters that both have, in their units.
    problem : Problem
        Its own problem.
    free : (d,)
        All its free values.
    """

    name: str
    squares: float  # its objective over the model's
    values: dict[str, float]
    problem: Problem
    free: np.ndarray

    def to_dict(self) -> dict[str, Any]:
        """As `result.json` has it."""
        return {"name": self.name, "objective_ratio": self.squares, "parameters": self.values}


def add_rivals(
    uncertainty: Uncertainty, parts: Callable[[int], Counting] = make_silent_counter
) -> Uncertainty:
    """The judgement with the structures that fit as well as the model, or better.

    Parameters
    ----------
    uncertainty : Uncertainty
        The judgement so far.
    parts : int -> counter
        Counts the structures that were tried.

    Returns
    -------
    Uncertainty
        A parameter that a rival moves beyond its interval has the objection in its verdict.
    """
    structures = list(_list_structures(uncertainty.likelihood.problem.model))
    candidates = list[RivalStructure | None]()
    with parts(len(structures)) as ended:
        for name, model in structures:
            candidates.append(_fit_rival(uncertainty, name, model))
            ended()
    beside = replace(uncertainty, rivals=tuple(rival for rival in candidates if rival is not None))
    return replace(
        beside, verdicts=uncertainty.verdicts | dict(_find_moved_parameters(uncertainty, beside))
    )


def _find_moved_parameters(
    own: Uncertainty, beside: Uncertainty
) -> Iterator[tuple[str, ParameterVerdict]]:
    """Yield the verdicts of the parameters that a rival moves beyond their interval, or so far that
    the interval is wide.
    """
    for j, (name, (low, high)) in enumerate(zip(own.names, own.intervals.tolist(), strict=True)):
        value = float(own.values[j])
        verdict = own.verdicts[name]
        there = [
            (rival.values[name], rival.name) for rival in beside.rivals if name in rival.values
        ]
        far, by = max(there, key=lambda one: abs(one[0] - value), default=(value, ""))
        half = max(abs(far - value), float(np.ptp(beside.intervals[j])) / 2)
        wide = half > IDENTIFIED_SHARE * choose_scale(value, own.lower[j], own.upper[j])
        if by and ((wide and verdict.word == IDENTIFIED) or not low <= far <= high):
            yield name, verdict.add_objection(f"with {by} it is {far:.4g}", enough=wide)


def _list_structures(model: Model) -> Iterator[tuple[str, Model]]:
    """Yield names of rivals and the models with them: another static load, or one effect more."""
    registered = discover()
    beside = model.integration, model.domain, model.window
    for name in sorted(registered.get("model/static", {})):
        cls = get("model/static", name)
        if cls.rival and type(model.static).rival and name != model.static.name:
            other = compose(model.motor, cls(), model.effects, *beside)
            if _can_compose(other):
                yield name, other
    there = {effect.name for effect in model.effects}
    for name in sorted(registered.get("effect", {}).keys() - there):
        cls = get("effect", name)
        if cls.rival and model.acceptance(cls()).refusal is None:
            yield name, model.extend([cls()])


def _can_compose(model: Model) -> bool:
    """Whether the equations take all effects of the model: another static load may refuse one."""
    if not model.effects:
        return True
    *others, last = model.effects
    return (
        compose(model.motor, model.static, others, domain=model.domain).acceptance(last).refusal
        is None
    )


def _fit_rival(uncertainty: Uncertainty, name: str, model: Model) -> RivalStructure | None:
    """A rival fitted from where the model's own fit ended; None where it cannot be,
    or fits worse.
    """
    problem = uncertainty.likelihood.problem
    own = {p.name: p.bounds for p in problem.parameters if p.name in model.names}
    try:
        other = problem.vary(model, own)
    except UserError:
        return None
    starts = _place_starts(uncertainty, other)
    likelihood, ended = uncertainty.descend_in(other, starts)
    least = float(ended.deviance.min())
    if not least < uncertainty.deviance + compute_threshold():
        return None
    free = likelihood.values(ended.best)
    values = dict(zip(other.space.names, free.tolist(), strict=True))
    shared = {n: value for n, value in values.items() if n in uncertainty.names}
    squares = least / max(uncertainty.deviance, 1e-30)
    return RivalStructure(name, squares, shared, other, free)


def _place_starts(uncertainty: Uncertainty, other: Problem) -> np.ndarray:
    """Points (n, free) of a rival's box: the shared parameters as estimated, its own as usual and
    all over.
    """
    names = other.space.names
    parameters = {p.name: p for p in other.parameters}
    shared = dict(zip(uncertainty.names, uncertainty.values, strict=True))
    alone = [k for k, n in enumerate(names) if n not in shared]
    usual = np.array([shared.get(n, parameters[n.partition("[")[0]].default) for n in names])
    start = np.tile(other.space.to_unit(usual), (STARTS + 1, 1))
    start[1:, alone] = spread_evenly(STARTS, max(len(alone), 1))[:, : len(alone)]
    return start
