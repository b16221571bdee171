"""What is logged in MLflow of an identification: what it found as numbers, where its search ended,
the curves.

A name means one thing in the runs of every task: `T_prime` is an estimate, `search_T_prime` where
the optimizer ended.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.identification.adequacy import Grade
from tractexp.identification.search import REFUSED
from tractexp.text import quoting

if TYPE_CHECKING:
    from tractexp.api.estimate import Estimate
    from tractexp.api.identification import Identification
    from tractexp.api.job import Job
    from tractexp.identification.result import Result

FLOOR = 1.01  # times the estimate's objective: from there a search has found what the noise leaves
ENDED = ("objective", "epsilon_p", "epsilon_q", "simulations", "seconds")
# as the metric `grade` counts them
GRADES = (Grade.WRONG_MODEL, Grade.EFFECT_MISSING, Grade.ADEQUATE)


def build_logged_fit(job: "Job", fit: "Identification", predictor: bool = False) -> dict[str, Any]:
    """Fields of `tractexp.tracking.TrackedRun`: metrics, curves and, as a predictor, the model."""
    result, of_model = fit.result, measure_model(fit)
    searched = (
        f"{job.variant}, {' and '.join(e.record.name for e in job.events.train)}, seed {job.seed}"
    )
    if job.label:
        searched = ", ".join(
            [job.choices["model"], *[f"{job.variant}, seed {job.seed}"] * job.of_many]
        )
    return {
        "name": searched,
        # MLflow compares by the first
        "metrics": _describe_search_end(fit)
        | {key: getattr(result, key) for key in ("simulations", "seconds")}
        | of_model,
        "curves": _build_curves(fit),
        "tags": {"grade": fit.grade},
        "seconds": result.seconds,
        "description": quoting.markdown(fit.headline),
        "records": result.records,
        "model": job.folder / "result.json" if predictor else None,
        "model_metrics": [*of_model],
    }


def measure_model(fit: "Identification") -> dict[str, float]:
    """Metrics of a fitted model, whichever task fitted it: grade, errors and estimates, by name."""
    return _collect_errors(fit) | _collect_estimates(fit)


def _collect_estimates(fit: "Identification") -> dict[str, float]:
    """Each estimate with the ends of its interval, and on the base of the file where
    that differs.
    """
    metrics: dict[str, float] = {}
    for name, one in _name_for_tracking(fit.parameters).items():
        metrics[name] = one.value
        if one.interval is not None:
            metrics |= {f"{name}_low": one.interval[0], f"{name}_high": one.interval[1]}
    given = fit.result.parameters_on_given_base
    return metrics | {f"given_base.{name}": value for name, value in given.items()}


def _collect_errors(fit: "Identification") -> dict[str, float]:
    """How well the estimate fits, event by event too."""
    result = fit.result
    metrics = {key: getattr(result, key) for key in ("objective", "epsilon_p", "epsilon_q")}
    metrics["model_error"] = result.model_error["value"]
    if held_out := result.model_error["held_out"]:
        metrics["model_error_held_out"] = held_out["value"]
    if (ratio := result.linear_network.get("ratio")) is not None:
        metrics["model_error_over_linear_network"] = ratio
    for channel in "PQ":
        if (within := result.next_dip.get(channel)) is not None:
            metrics[f"next_dip_{channel}"] = within
    if "epsilon_i" in result.epsilons:
        metrics["epsilon_i"] = max(e["epsilon_i"] for e in result.events if e["role"] == "train")
    if fit.grade:
        metrics["grade"] = GRADES.index(fit.grade)
    return metrics | _collect_epsilons(result)


def _collect_epsilons(result: "Result") -> dict[str, float]:
    """The errors of each event, by its role and number."""
    return {
        f"{event['role']}_{k}_{name}": event[name]
        for k, event in enumerate(result.events, start=1)
        for name in result.epsilons
    }


def _describe_search_end(fit: "Identification") -> dict[str, float]:
    """Where the optimizer itself ended, and after how many simulations it was within 1 % of the
    estimate.
    """
    metrics = {f"search_{key}": fit.result.search[key] for key in ENDED}
    metrics |= {
        f"search_{name}": one.search for name, one in _name_for_tracking(fit.parameters).items()
    }
    history = fit.search_result.history
    there = np.flatnonzero(history.objective <= FLOOR * fit.result.objective)
    reached = float(history.simulations[there[0]]) if there.size else float("inf")
    return metrics | {"search_simulations_to_floor": reached}


def _build_curves(fit: "Identification") -> dict[str, Any]:
    """The best objective by iteration, and by simulations at steps that all runs share."""
    from tractexp.tracking import resample_to_common_steps

    history = fit.search_result.history
    valid = history.objective < REFUSED
    best = history.objective[valid]
    return {
        "fitness": (np.flatnonzero(valid), best),
        "fitness_by_simulations": resample_to_common_steps(history.simulations[valid], best),
    }


def _name_for_tracking(parameters: "Mapping[str, Estimate]") -> "dict[str, Estimate]":
    """Parameters by the names that MLflow takes: T_m[1] is T_m_1."""
    return {name.replace("[", "_").rstrip("]"): one for name, one in parameters.items()}
