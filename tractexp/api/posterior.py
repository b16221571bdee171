"""A Bayesian check of the intervals."""

import functools
import io
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.api.arguments import public
from tractexp.api.identification import Identification
from tractexp.api.job import Job
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import plugin
from tractexp.errors import UserError, check_range
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.text.progress import Progress, make_counter

if TYPE_CHECKING:
    import arviz  # pyright: ignore[reportMissingImports]

    from tractexp.identification.posterior import PosteriorSample


@dataclass(frozen=True, eq=False, repr=False)
class Sampled(Written):
    """A sample of the posterior under a flat prior within the bounds. `content` is that of
    `posterior.json`.
    """

    kind = "posterior"
    page = "posterior.html"

    fit: Identification
    settings: Mapping[str, int]  # walkers, steps, seed
    content: Mapping[str, Any]
    behind: "PosteriorSample | None" = None  # None where it was loaded

    @functools.cached_property
    def sample(self) -> "PosteriorSample":
        """The sample; of a loaded result it is drawn again, from the same seed."""
        from tractexp.identification.posterior import sample

        s = self.settings
        return self.behind or sample(
            self.fit.details.uncertainty, s["walkers"], s["steps"], s["seed"]
        )

    @property
    def draws(self) -> dict[str, np.ndarray]:
        """Draws (n,) of each free parameter, by name."""
        return dict(zip(self.sample.names, self.sample.draws.T, strict=True))

    def to_inference_data(self) -> "arviz.InferenceData":
        """The draws as an `arviz.InferenceData`: group `posterior`, a variable for each free
        parameter, (chain, draw) with a chain for each walker.

        Raises `UserError` without the extra [arviz].
        """
        try:
            import arviz  # pyright: ignore[reportMissingImports]
        except ImportError:
            raise UserError(
                "to_inference_data() needs ArviZ; install it by: pip install 'tractexp[arviz]'"
            ) from None
        walkers = self.settings["walkers"]
        chains = {name: draws.reshape(-1, walkers).T for name, draws in self.draws.items()}
        return arviz.from_dict(posterior=chains, attrs={"sampler": "emcee"})

    def table(self) -> Table:
        """The intervals by curvature and by the posterior, side by side."""
        span, r = "{:.4g} .. {:.4g}".format, self.fit.result
        rows = [
            [name, f"{r.free[name]:.4g}", span(*r.intervals[name]), span(*interval)]
            for name, interval in self.content["intervals"].items()
        ]
        columns = ["parameter", "most likely", "by curvature", "by posterior"]
        return Table(columns, rows, "95 % intervals")

    def summary(self) -> Report:
        """The intervals, and how well the chains have mixed."""
        return self.fit.summary().add(self.table()).text(*self._describe_effort())

    def _describe_effort(self) -> list[str]:
        """Sentences on the time that the draws took, and whether they are enough."""
        c, s = self.content, self.settings
        effort = (
            f"{s['steps']} steps of {s['walkers']} walkers in {c['seconds']:.1f} s, acceptance"
            f" {c['acceptance']:.2f}, autocorrelation time {c['autocorrelation']:.0f} steps"
        )
        short = "note: the chain is shorter than 50 autocorrelation times; raise steps"
        return [effort] if c["converged"] else [effort, short]

    def screen(self) -> Report:
        """The load, and each interval by curvature and by posterior."""
        from tractexp.report.screen import describe_judged_load

        told = describe_judged_load(self.fit)
        return told.add(self.table()).text(*self._describe_effort())

    @property
    def next_step(self) -> str:
        """The next step of the identification."""
        return next(iter(self.fit.next_steps), "")

    def report(self) -> Report:
        """The page: marginals and pairs."""
        from tractexp.report import posterior

        return posterior.report(self.fit.details.uncertainty, self.sample, self.fit.headline)

    def write_results(self, folder: Path) -> list[Path]:
        """Write `posterior.json`, the draws in `posterior.npz`, and what an identification
        writes.
        """
        packed = io.BytesIO()
        np.savez_compressed(packed, **self.draws)  # type: ignore[arg-type]
        path = files.write_json(folder / "posterior.json", self.content)
        draws = files.write(folder / "posterior.npz", packed.getvalue())
        result = replace(self.fit.result, **self.fit.details.uncertainty.fields())
        return [path, draws, *replace(self.fit, result=result).write_results(folder)]


@public
def posterior(
    fit: Identification,
    *,
    walkers: int = 48,
    steps: int = 2000,
    seed: int | None = None,
    progress: Progress = None,
) -> Sampled:
    """Sample the posterior of an identification's free parameters under a flat prior within their
    bounds.

    Parameters
    ----------
    fit : Identification
        Made by `tractexp.identify`, or loaded from what it saved.
    walkers : int, at least 4
        Chains that move together, more than twice the coordinates.
    steps : int, at least 100
        Of each walker; the first 30 % are thrown away.
    seed : int
        None: that of the identification.
    progress : None, False or callable
        None shows how far it is, False does not.

    Returns
    -------
    Sampled
        `draws` {name: values in the parameter's unit}, intervals, the autocorrelation of the chains
        and whether they have converged.

    Raises
    ------
    UserError
        Without the extra [posterior], for fewer walkers than twice the coordinates, and for an
        identification of which only a `result.json` is known.
    """
    from tractexp.identification.posterior import sample

    check_range("task.walkers", walkers, 4)
    check_range("task.steps", steps, 100)
    settings = {"walkers": walkers, "steps": steps, "seed": fit.spec.seed if seed is None else seed}
    uncertainty = fit.details.uncertainty
    started = time.perf_counter()
    count = make_counter("steps of the walkers", progress)
    drawn = sample(uncertainty, settings["walkers"], settings["steps"], settings["seed"], count)
    content = {
        "intervals": dict(zip(drawn.names, drawn.intervals.tolist(), strict=True)),
        "autocorrelation": drawn.autocorrelation,
        "acceptance": drawn.acceptance,
        "converged": drawn.has_converged,
        "seconds": time.perf_counter() - started,
    }
    return Sampled(fit, settings, files.make_plain(content), drawn)


@plugin
class Posterior(Task, call=posterior):
    """Identify, then sample the posterior under a flat prior within the bounds: posterior.html,
    .json and .npz.
    """

    def collect_log(self, job: Job, result: Sampled) -> dict[str, Any]:
        """The fields that an identification logs."""
        from tractexp.api.logged import build_logged_fit

        return build_logged_fit(job, result.fit)
