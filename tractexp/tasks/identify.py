"""Identify a load model's parameters from recorded dips."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.identification.model_error import in_percent
from tractexp.identification.search import REFUSED
from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import Job, Task
from tractexp.wording import as_sentence

if TYPE_CHECKING:
    from tractexp.api.identify import Identification


@plugin
class Identify(Task):
    """Fit free parameters to the training events, judge on all, show and log the outcome."""

    figures: bool | None = None  # write the page; null: in single runs, not in sweeps
    predictor: bool | None = None  # log the model for mlflow.pyfunc; null: in single runs, not in sweeps

    def run(self, job: Job) -> None:
        fit = job.identified(say)
        paths = fit.write_results(job.folder)
        report(fit)
        if _wanted(self.figures, job):
            paths += fit.write_drawings(job.folder)
        listed(paths)
        track(job, fit, paths, _wanted(self.predictor, job))


def _wanted(setting: bool | None, job: Job) -> bool:
    return not job.in_sweep if setting is None else setting


def report(fit: "Identification") -> None:
    """Print what the identification is good for, the estimate, how well it fits, and what to do next."""
    say()
    say(as_sentence(fit.headline))
    estimates(fit)
    if told := fit.result.on_given_base():
        say(told)
    events(fit)
    say(fit.result.acceptance)
    sure(fit)
    for sentence in fit.result.uncertainty["notes"]:
        say(f"note: {sentence}")
    say(fit.search_told())
    for sentence in fit.advice:
        say(f"next: {sentence}")
    say()


def events(fit: "Identification") -> None:
    """Print how well the model fits each event: its error beside the errors of Eq. (20)."""
    epsilons, errors = fit.result.epsilons, fit.result.model_error["events"]
    rows = [
        [e["name"], e["role"], in_percent(error["value"]), *(f"{e[key]:.3%}" for key in epsilons)]
        for e, error in zip(fit.result.events, errors, strict=True)
    ]
    table(["event", "role", "model error", *epsilons], rows)
    for event in fit.result.events:
        if told := unsettled_told(event):
            say(told)


def unsettled_told(event: dict[str, Any]) -> str:
    """How well a simulation in waveforms begins at rest, in a sentence; "" in phasors, which do so exactly."""
    if event.get("unsettled") is None:
        return ""
    change = f"the calculated currents still change by {event['unsettled']:.2g} of their size from cycle to cycle"
    return f"periodic steady state before {event['name']}: {change}"


def estimates(fit: "Identification") -> None:
    """Print the estimates; where the search ended outside an interval, that too."""
    from tractexp.report.identify import brief

    astray, rows = fit.astray, []
    for e in fit.parameters.values():
        interval = "{:.4g} .. {:.4g}".format(*e.interval) if e.interval else ""
        ended = [f"{e.search:.4g}" * (e.name in astray)] * bool(astray)
        rows.append([e.name, f"{e.value:.5g}", e.unit, interval, *ended, brief(e.verdict)])
    table(["parameter", "value", "unit", "95 % interval", *["search ended at"] * bool(astray), "verdict"], rows)
    for sentence in fit.structures:
        say(sentence)


def sure(fit: "Identification") -> None:
    """Print how many parameters are identified, and why others are not."""
    from tractexp.identification.verdict import IDENTIFIED
    from tractexp.report.identify import headline

    say(headline(fit.judged.known))
    for name, verdict in fit.judged.known.verdicts.items():
        if verdict.word != IDENTIFIED:
            say(f"  {name}: {verdict}")


def track(job: Job, fit: "Identification", paths: list[Path], predictor: bool) -> None:
    """Log figures, metrics, the fitness curve and, as a predictor, the identified model."""
    from tractexp.tracking import at_common_steps

    result = fit.result
    metrics = {key: getattr(result, key) for key in ("objective", "epsilon_p", "epsilon_q", "simulations", "seconds")}
    of_search = ("objective", "epsilon_p", "epsilon_q", "simulations", "seconds")
    metrics |= {f"search_{key}": result.search[key] for key in of_search}
    metrics["model_error"] = result.model_error["value"]
    if result.model_error["held_out"]:
        metrics["model_error_held_out"] = result.model_error["held_out"]["value"]
    for k, event in enumerate(result.events, start=1):
        metrics |= {f"{event['role']}_{k}_{e}": event[e] for e in result.epsilons}
    if "epsilon_i" in result.epsilons:
        metrics["epsilon_i"] = max(e["epsilon_i"] for e in result.events if e["role"] == "train")
    history = fit.ended.history
    known = history.objective < REFUSED
    best = history.objective[known]
    job.log(
        name=f"{job.variant}, {' and '.join(e.record.name for e in job.events.train)}, seed {job.seed}",
        values=result.parameters | {f"given_base.{n}": v for n, v in result.parameters_on_given_base.items()},
        metrics=metrics,
        curves={
            "fitness": (np.flatnonzero(known), best),
            "fitness_by_simulations": at_common_steps(history.simulations[known], best),
        },
        artifacts=[*paths, job.folder / ".hydra"],
        seconds=result.seconds,
        description=fit.headline,
        records=result.records,
        model=job.folder / "result.json" if predictor else None,
    )
