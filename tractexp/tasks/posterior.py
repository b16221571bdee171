"""A Bayesian check of the intervals."""

import json
import time
from typing import Any

import numpy as np

from tractexp.errors import check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import say, table
from tractexp.tasks.identify import identified, report, track
from tractexp.tasks.task import Job, Task


@plugin
class Posterior(Task):
    """Identify, then sample the posterior under a flat prior within the bounds: posterior.json and posterior.npz."""

    walkers: int = 48
    steps: int = 2000

    def check(self) -> None:
        check_range("task.walkers", self.walkers, 4)
        check_range("task.steps", self.steps, 100)

    def run(self, job: Job) -> None:
        from tractexp.identification.posterior import sample
        from tractexp.identification.result import write_history

        problem, found, result, _, known = identified(job)
        started = time.perf_counter()
        drawn = sample(known, self.walkers, self.steps, job.seed)
        seconds = time.perf_counter() - started
        report(problem, result)
        show(known, drawn, seconds)
        np.savez_compressed(job.folder / "posterior.npz", **dict(zip(drawn.names, drawn.draws.T, strict=True)))
        summary = {
            "intervals": dict(zip(drawn.names, drawn.intervals.tolist(), strict=True)),
            "autocorrelation": drawn.autocorrelation,
            "converged": drawn.converged,
            "seconds": seconds,
        }
        path = job.folder / "posterior.json"
        path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        paths = [path, job.folder / "posterior.npz", write_history(job.folder / "history.csv", found.history)]
        paths.append(result.write(job.folder / "result.json"))
        for path in paths:
            say(f"  {path}")
        track(job, found, result, paths, predictor=False)


def show(known: Any, drawn: Any, seconds: float) -> None:
    """Print the intervals by curvature and those of the sample side by side."""
    rows = [
        [name, f"{value:.4g}", f"{a:.4g} .. {b:.4g}", f"{low:.4g} .. {high:.4g}"]
        for name, value, (a, b), (low, high) in zip(
            known.names, known.values, known.intervals, drawn.intervals, strict=True
        )
    ]
    table(["parameter", "most likely", "by curvature", "by posterior"], rows)
    say(
        f"{drawn.steps} steps of {drawn.simulations // (drawn.steps + 2)} walkers in {seconds:.1f} s, acceptance"
        f" {drawn.acceptance:.2f}, autocorrelation time {drawn.autocorrelation:.0f} steps"
    )
    if not drawn.converged:
        say("  note: the chain is shorter than 50 autocorrelation times; raise task.steps")
    say()
