"""A Bayesian check of the intervals."""

from tractexp.errors import check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.identify import report, track
from tractexp.tasks.task import Job, Task, call


@plugin
class Posterior(Task):
    """Identify, then sample the posterior under a flat prior within the bounds: posterior.html, .json and .npz."""

    walkers: int = 48
    steps: int = 2000

    def check(self) -> None:
        check_range("task.walkers", self.walkers, 4)
        check_range("task.steps", self.steps, 100)

    def run(self, job: Job) -> None:
        from tractexp.api.posterior import posterior

        fit = job.identified(say)
        sampled = call(posterior, fit, walkers=self.walkers, steps=self.steps)
        paths = sampled.write_results(job.folder)
        report(fit)
        shown, drawn = sampled.table(), sampled.drawn
        table(shown.columns, shown.rows)
        say(
            f"{drawn.steps} steps of {drawn.simulations // (drawn.steps + 2)} walkers in"
            f" {sampled.content['seconds']:.1f} s, acceptance {drawn.acceptance:.2f}, autocorrelation time"
            f" {drawn.autocorrelation:.0f} steps"
        )
        if not drawn.converged:
            say("  note: the chain is shorter than 50 autocorrelation times; raise task.steps")
        say()
        paths += sampled.write_drawings(job.folder)
        listed(paths)
        track(job, fit, paths, predictor=False)
