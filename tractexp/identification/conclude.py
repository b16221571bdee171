"""The result of an identification, from where its search ended and what was estimated."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from tractexp.cache import provenance
from tractexp.errors import MODEL, UserError
from tractexp.identification.fit import TRAIN, Fit, play, tabulate_model_errors
from tractexp.identification.result import Result, name_by_event
from tractexp.identification.search import REFUSED, SearchResult
from tractexp.inference.bounds import BOUND_DISTANCE
from tractexp.inference.model_error import compute_relative_errors
from tractexp.inference.problem import Problem
from tractexp.record import OwnBase
from tractexp.record.identity import Identity


def conclude(
    problem: Problem,
    end: SearchResult,
    free: np.ndarray,
    fits: Sequence[Fit],
    seed: int,
    settings: Mapping[str, Any],
    optimizer: str,
) -> Result:
    """The result of free values (d,) and what they make of each event, `fits` of `play`; `end` is
    that of the search.

    Raises `UserError` where no candidate at all had a steady state.
    """
    refuse_failed(problem, end)
    epsilon_p, epsilon_q = compute_relative_errors([fit for fit in fits if fit.role == TRAIN])
    first = problem.events[0]
    estimates = _collect_values(problem, free)
    own = OwnBase.from_record(first.record)
    exponents = {p.name: p.power_exponent for p in problem.parameters}
    return Result(
        **estimates,
        **_list_costs(end),
        objective=float(problem.objective(free[None])[0]),
        epsilon_p=epsilon_p,
        epsilon_q=epsilon_q,
        seed=seed,
        events=[f.to_dict() for f in fits],
        model_error=tabulate_model_errors(fits),
        at_bound=list_at_bound(problem, free),
        units={p.name: p.unit for p in problem.parameters},
        bounds={p.name: list(p.bounds) for p in problem.parameters},
        model=dict(settings),
        before={
            "U0": first.U0,
            "P0": first.P0,
            "Q0": first.Q0,
            "frequency": first.record.base.frequency,
        },
        optimizer=optimizer,
        search=describe_search(problem, end),
        notes=[note for f in fits for note in f.event.record.notes],
        records=[
            {"name": f.event.record.name, "role": f.role}
            | Identity.from_record(f.event.record).to_dict()
            for f in fits
        ],
        own_base=asdict(own),
        parameters_on_given_base={}
        if own.ratio == 1
        else own.values(name_by_event(*estimates.values()), exponents),
        tractexp_version=provenance.read_version(),
        commit=provenance.find_commit(),
    )


def refuse_failed(problem: Problem, end: SearchResult) -> None:
    """Raise `UserError` where no candidate at all had a steady state."""
    if end.objective >= REFUSED:
        why = problem.model.refusal(problem.full(end.values)[0], problem.drive) or "all diverged"
        raise UserError(
            f"none of the {end.simulations} parameter sets tried could be simulated: {why};"
            f" widen {MODEL.bounds} or free {MODEL.fixed}{_describe_base(problem)}"
        )


def _describe_base(problem: Problem) -> str:
    """On which base bounds are meant, where that is not the file's."""
    own = OwnBase.from_record(problem.events[0].record)
    return "" if own.ratio == 1 else f", which are meant on the record's own base of {own}"


def describe_search(problem: Problem, end: SearchResult) -> dict[str, Any]:
    """Where the optimizer itself end, and what that took: what optimizers are compared by."""
    epsilon_p, epsilon_q = compute_relative_errors(play(problem, end.values))
    errors = {"objective": end.objective, "epsilon_p": epsilon_p, "epsilon_q": epsilon_q}
    return (
        _collect_values(problem, end.values)
        | errors
        | _list_costs(end)
        | {"at_bound": list_at_bound(problem, end.values)}
    )


def _list_costs(end: SearchResult) -> dict[str, Any]:
    """What a search took, and the sentence it ended with."""
    return {
        name: getattr(end, name)
        for name in ("simulations", "seconds", "refused", "iterations", "status")
    }


def _collect_values(problem: Problem, free: np.ndarray) -> dict[str, Any]:
    """Parameters by name, and those with a value of their own in each event."""
    names = problem.model.names
    own = problem.by_event(free)[:, 0]
    return {
        "parameters": {n: float(v) for n, v in zip(names, problem.full(free)[0], strict=True)},
        "per_event": {name: own[:, names.index(name)].tolist() for name in problem.per_event},
    }


def list_at_bound(problem: Problem, values: np.ndarray) -> list[str]:
    """Names of the free parameters within a thousandth of their range of a bound."""
    unit = problem.space.to_unit(values)
    return [
        n
        for n, z in zip(problem.space.names, unit, strict=True)
        if z < BOUND_DISTANCE or z > 1 - BOUND_DISTANCE
    ]


def describe_active_bounds(
    problem: Problem, values: np.ndarray, nuisances: Collection[str] = ()
) -> list[str]:
    """The same without nuisances, as a sentence tells them: 'T_m at 1'."""
    names = [name for name in list_at_bound(problem, values) if name not in nuisances]
    return [f"{name} at {values[problem.space.index(name)]:.4g}" for name in names]
