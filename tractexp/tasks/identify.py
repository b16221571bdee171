"""Identify a load model's parameters from recorded dips."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tractexp.identification.search import REFUSED
from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import Job, Task

if TYPE_CHECKING:
    from tractexp.api.identify import Identification


@plugin
class Identify(Task):
    """Fit the model's free parameters to the training events, judge it on all events, show and log the outcome."""

    figures: bool | None = None  # draw the fit and the search; null: in single runs, not in sweeps
    predictor: bool | None = None  # log the model for mlflow.pyfunc; null: in single runs, not in sweeps

    def run(self, job: Job) -> None:
        fit = job.identified(say)
        report(fit)
        explain(fit)
        paths = fit.write(job.folder) if _wanted(self.figures, job) else fit.write_result(job.folder)
        listed(paths)
        track(job, fit, paths, _wanted(self.predictor, job))


def _wanted(setting: bool | None, job: Job) -> bool:
    return not job.in_sweep if setting is None else setting


def report(fit: "Identification") -> None:
    """Print the parameters and how well they fit."""
    result, fixed, rows = fit.result, fit.asked.problem.fixed, []
    for name, value in result.parameters.items():
        low, high = result.bounds[name]
        mark = "fixed" if name in fixed else "at its bound" if name in result.at_bound else ""
        rows.append([name, f"{value:.5g}", result.units[name], f"{low:g} .. {high:g}", mark])
    say()
    table(["parameter", "value", "unit", "bounds", ""], rows)
    rows = [[e["name"], e["role"], f"{e['epsilon_p']:.3%}", f"{e['epsilon_q']:.3%}"] for e in result.events]
    table(["event", "role", "epsilon_p", "epsilon_q"], rows)
    verdict = "holds" if result.acceptable else "does NOT hold"
    say(f"objective {result.objective:.4e} pu², {result.simulations} simulations in {result.seconds:.2f} s")
    if result.refused:
        say(f"  {result.refused} of them had no steady state or diverged and were refused")
    say(f"the search {result.status}")
    say(f"acceptance of Eq. (20), epsilon_p and epsilon_q below 5 %: {verdict}")
    say()


def explain(fit: "Identification") -> None:
    """Print how sure each parameter is, what is odd, and what to do next."""
    from tractexp.identification.verdict import IDENTIFIED
    from tractexp.report.identify import headline, rows

    known, brief = fit.judged.known, []
    for name, value, _, interval, error, _ in rows(known, fit.result.units):
        verdict = known.verdicts[name]
        word = f"{verdict.word} {verdict.detail.partition(';')[0]}" if verdict.word == IDENTIFIED else verdict.word
        brief.append([name, value, interval, error, word])
    table(["parameter", "most likely", "95 % interval", "error", "verdict"], brief)
    say(headline(known))
    for name, verdict in known.verdicts.items():
        if verdict.word != IDENTIFIED:
            say(f"  {name}: {verdict}")
    for label, sentences in (("note", fit.result.uncertainty["notes"]), ("next", fit.advice)):
        for sentence in sentences:
            say(f"  {label}: {sentence}")
    say()


def track(job: Job, fit: "Identification", paths: list[Path], predictor: bool) -> None:
    """Log figures, metrics, the fitness curve and, as a predictor, the identified model."""
    result = fit.result
    metrics = {key: getattr(result, key) for key in ("objective", "epsilon_p", "epsilon_q", "simulations", "seconds")}
    for k, event in enumerate(result.events, start=1):
        metrics |= {f"{event['role']}_{k}_{e}": event[e] for e in ("epsilon_p", "epsilon_q")}
    history = fit.ended.history
    known = history.objective < REFUSED
    best = history.objective[known]
    job.log(
        name=f"{job.choices['optimizer']} seed {job.seed}",
        values=result.parameters,
        metrics=metrics,
        curves={
            "fitness": (np.flatnonzero(known), best),
            "fitness_by_simulations": (history.simulations[known], best),
        },
        artifacts=[*paths, job.folder / ".hydra"],
        seconds=result.seconds,
        model=job.folder / "result.json" if predictor else None,
    )
