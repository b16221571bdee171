"""Identify a load model's parameters from recorded dips."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tractexp.identification.search import REFUSED, Limits, search
from tractexp.plugin import plugin
from tractexp.tasks.console import say, searching, table
from tractexp.tasks.task import Job, Task

if TYPE_CHECKING:
    from tractexp.identification.problem import Problem
    from tractexp.identification.result import Fit, Result
    from tractexp.identification.search import Found
    from tractexp.identification.uncertainty import Together, Uncertainty

ASTRAY = 0.99  # of the search's objective: least squares that get below it have left its valley or finished its work


@plugin
class Identify(Task):
    """Fit the model's free parameters to the training events, judge it on all events, show and log the outcome."""

    figures: bool | None = None  # draw the fit and the search; null: in single runs, not in sweeps
    predictor: bool | None = None  # log the model for mlflow.pyfunc; null: in single runs, not in sweeps

    def run(self, job: Job) -> None:
        from tractexp.identification.result import write_history
        from tractexp.identification.uncertainty import compare_events

        problem, found, result, fits, known = identified(job)
        together = compare_events(known) if len(problem.events) > 1 else None
        result = replace(result, **known.fields(together, astray(problem, found, known)))

        report(problem, result)
        advice = explain(known, together, result)
        paths = draw(job, found, fits) if _wanted(self.figures, job) else []
        if paths:
            paths += explained(job, result, known, together, advice, paths[:-1])
        paths.append(write_history(job.folder / "history.csv", found.history))
        paths.append(result.write(job.folder / "result.json"))
        for path in paths:
            say(f"  {path}")
        track(job, found, result, paths, _wanted(self.predictor, job))


class Identified(NamedTuple):
    """What a search found and how sure it is: where every task begins that looks closer."""

    problem: "Problem"
    found: "Found"
    result: "Result"
    fits: "list[Fit]"
    known: "Uncertainty"


def identified(job: Job) -> Identified:
    """Read the records, search, judge the outcome; says what is read and how far the search is."""
    from tractexp.identification.profile import checked
    from tractexp.identification.result import conclude
    from tractexp.identification.uncertainty import assess

    config, events, optimizer = job.config, job.events(), job.optimizer
    problem = job.problem(events.train)
    announce(job, events, problem)
    job.prepare_log()
    limits = Limits(config["budget"], config["time_limit"], config["target"])
    with searching(getattr(optimizer, "iterations", None), limits.simulations) as progress:
        found = search(problem, optimizer, job.seed, limits, progress)
    settings = {part: config["model"][part] for part in ("motor", "static", "effects")}
    result, fits = conclude(problem, found, events.validate, job.seed, settings, job.choices["optimizer"])
    known = assess(problem, found.values, robust=not problem.loss.quadratic)
    if not job.in_sweep:  # of many jobs nobody reads each profile; task=profile makes them for the one that matters
        known = checked(known)
    return Identified(problem, found, replace(result, **known.fields()), fits, known)


def _wanted(setting: bool | None, job: Job) -> bool:
    return not job.in_sweep if setting is None else setting


def announce(job: Job, events: Any, problem: Any) -> None:
    """Say what was read and what will be done."""
    from tractexp.record import describe

    for role, group in (("fit", events.train), ("validate", events.validate)):
        for event in group:
            say(f"{role}: {describe(event)}")
            for note in event.record.notes:
                say(f"  note: {note}")
    free = f"{problem.space.dimension} parameters"
    say(f"model: {problem.model.title}, {free}; Runge-Kutta steps: {problem.step.describe(problem.events)}")
    say(f"optimizer: {job.choices['optimizer']}, seed {job.seed}")


def report(problem: Any, result: Any) -> None:
    """Print the parameters and how well they fit."""
    rows = []
    for name, value in result.parameters.items():
        low, high = result.bounds[name]
        mark = "fixed" if name in problem.fixed else "at its bound" if name in result.at_bound else ""
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


def astray(problem: "Problem", found: "Found", known: "Uncertainty") -> list[str]:
    """A sentence where the search's own values lie far from the most likely ones: it ended in another valley."""
    better = float(problem.objective(known.values[None])[0])
    if better >= ASTRAY * found.objective:
        return []
    return [
        f"the search stopped short: least squares from where it ended lower the objective from {found.objective:.4g} to"
        f" {better:.4g}; take the most likely values, or optimizer.polish=true"
    ]


def explain(known: "Uncertainty", together: "Together | None", result: Any) -> list[str]:
    """Print how sure each parameter is, what is odd, and what to do next; return the advice."""
    from tractexp.identification.advice import advise
    from tractexp.identification.verdict import IDENTIFIED
    from tractexp.report.identify import headline, rows

    brief = [[name, value, interval, error, ""] for name, value, _, interval, error, _ in rows(known, result.units)]
    for row in brief:
        verdict = known.verdicts[row[0]]
        row[-1] = f"{verdict.word} {verdict.detail.partition(';')[0]}" if verdict.word == IDENTIFIED else verdict.word
    table(["parameter", "most likely", "95 % interval", "error", "verdict"], brief)
    say(headline(known))
    for name, verdict in known.verdicts.items():
        if verdict.word != IDENTIFIED:
            say(f"  {name}: {verdict}")
    advice = advise(known, together.odd if together else ())
    for label, sentences in (("note", result.uncertainty["notes"]), ("next", advice)):
        for sentence in sentences:
            say(f"  {label}: {sentence}")
    say()
    return advice


def explained(
    job: Job, result: Any, known: "Uncertainty", together: "Together | None", advice: list[str], fits: list[Path]
) -> list[Path]:
    """Write the figures of the uncertainty and the page an engineer reads."""
    from tractexp.report import identify, uncertainty

    correlation = uncertainty.correlation(job.folder / "correlation.svg", known)
    residuals = uncertainty.residuals(job.folder / "residuals.svg", known)
    page = identify.page(result, known, together, advice, fits, correlation, residuals)
    return [correlation, residuals, page.write(job.folder / "report.html")]


def draw(job: Job, found: Any, fits: Any) -> list[Path]:
    """Write fit.svg (fit_2.svg and so on for further events) and fitness.svg."""
    from tractexp.report import figures

    optimizer, paths = job.choices["optimizer"], []
    for k, fit in enumerate(fits, start=1):
        record, role = fit.event.record, "fitted" if fit.role == "train" else "held out"
        path = figures.fit(
            job.folder / ("fit.svg" if k == 1 else f"fit_{k}.svg"),
            record.t,
            record.U,
            (record.P, record.Q),
            (fit.P, fit.Q),
            title=f"{record.name} ({role}), {optimizer}",
            epsilon=(fit.epsilon_p, fit.epsilon_q),
            notes=record.notes,
        )
        paths.append(path)
    history = found.history
    by_iteration = {optimizer: (np.arange(len(history.objective)), history.objective)}
    by_simulations = {optimizer: (history.simulations, history.objective)}
    title = f"search of {optimizer}, seed {job.seed}, on {job.choices['data']}"
    return [*paths, figures.fitness(job.folder / "fitness.svg", by_iteration, by_simulations, title=title)]


def track(job: Job, found: Any, result: Any, paths: list[Path], predictor: bool) -> None:
    """Log figures, metrics, the fitness curve and, as a predictor, the identified model."""
    metrics = {key: getattr(result, key) for key in ("objective", "epsilon_p", "epsilon_q", "simulations", "seconds")}
    for k, event in enumerate(result.events, start=1):
        metrics |= {f"{event['role']}_{k}_{e}": event[e] for e in ("epsilon_p", "epsilon_q")}
    history = found.history
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
