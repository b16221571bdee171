"""Identify on some dips, judge on milder and deeper ones, for any optimizers."""

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.api.arguments import Choice, public
from tractexp.api.job import Job
from tractexp.api.setup import Setup
from tractexp.api.task import SEARCH, Task
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import build, plugin
from tractexp.configuration.run_command import OF_LOAD, build_again_command
from tractexp.errors import DATA, UserError, check_range, name_setting
from tractexp.outcome import Drawing, Written
from tractexp.storage import files
from tractexp.text.progress import Progress, tell

if TYPE_CHECKING:
    from tractexp.api.given import Chosen, ModelGiven, Records, Several
    from tractexp.identification.fit import Fit
    from tractexp.identification.result import Result

CAPTION = (
    "residuals: mean absolute value of Eq. (21), pu; medians over the seeds. estimate: the most"
    " likely parameters; beside it where each optimizer's search ended"
)
ARRAYS = ("t", "U", "P", "Q", "P_calculated", "Q_calculated")
SEEDS_COMPARED = 10  # of the sweep that is advised
OF_SEARCH = (*OF_LOAD, *SEARCH)  # the settings that it repeats
ESTIMATE = "estimate"  # stands for an optimizer in what is told of the most likely parameters
RESIDUALS = ("residual_P", "residual_Q")
ERRORS = (*RESIDUALS, "epsilon_p", "epsilon_q")


@dataclass(frozen=True, eq=False, repr=False)
class Generalised(Written):
    """Residuals on the held-out dips: a row for each optimizer, seed and dip; and the parameters
    they come from.

    The optimizer "estimate" is the most likely set; the others tell where their searches ended.
    """

    kind = "generalisation"

    residuals: Sequence[Mapping[str, Any]]
    identified: Sequence[Mapping[str, Any]]
    # what is drawn: each optimizer's first seed on each held-out dip
    curves: Sequence[Mapping[str, Any]]

    @property
    def errors(self) -> tuple[str, ...]:
        """The names of the errors told of each dip: residuals and relative errors of P and Q, and
        in waveforms of the currents.
        """
        return (
            *ERRORS,
            *(["epsilon_i"] if all("epsilon_i" in row for row in self.residuals) else []),
        )

    @property
    def medians(self) -> list[dict[str, Any]]:
        """Over the seeds: {event, kind, optimizer, residual_P, residual_Q, epsilon_p, epsilon_q
        ...}, by event.
        """
        groups: dict[Any, list[Mapping[str, Any]]] = {}
        for event, kind in dict.fromkeys((row["event"], row["kind"]) for row in self.residuals):
            for row in self.residuals:
                if row["event"] == event:
                    groups.setdefault((event, kind, row["optimizer"]), []).append(row)
        return [
            dict(zip(("event", "kind", "optimizer"), key, strict=True))
            | {error: float(median(row[error] for row in rows)) for error in self.errors}
            for key, rows in groups.items()
        ]

    def table(self) -> Table:
        """The median errors of each optimizer on each dip."""
        columns = ["event", "kind", "optimizer", *self.errors]
        return Table(
            columns,
            [[row[c] for c in columns] for row in self.medians],
            "on dips not fitted",
            CAPTION,
        )

    def summary(self) -> Report:
        """The table, and what its numbers are."""
        return Report().add(self.table()).text(CAPTION)

    @property
    def next_step(self) -> str:
        """The command that compares the searches under more seeds."""
        names = dict.fromkeys(row["optimizer"] for row in self.residuals)
        asked = f"optimizer={','.join(name for name in names if name != ESTIMATE)}"
        sweep = build_again_command("-m", asked, f"seed=range(0,{SEEDS_COMPARED})", of=OF_SEARCH)
        return f"compare the searches themselves: {sweep}"

    def write_results(self, folder: Path) -> list[Path]:
        """Write `generalise.json`: the residuals of every search, and what it identified."""
        content = {"residuals": self.residuals, "identified": self.identified}
        return [files.write_json(folder / "generalise.json", content)]

    def drawings(self) -> Mapping[str, Drawing]:
        """A figure for each optimizer and held-out dip, of curves and residuals:
        issa_interpolation.svg, ...
        """
        return {curve["file"]: functools.partial(_draw, curve) for curve in self.curves}


@public
def generalise(
    records: "Records",
    model: "ModelGiven | None" = None,
    *,
    validate: "Records",
    optimizers: "Several | None" = None,
    seeds: int = 1,  # searches of each optimizer: that seed and the ones after it
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    per_event: Sequence[str] | None = None,
    substeps: int | None = None,
    objective: "Chosen | None" = None,
    budget: int | None = None,
    time_limit: float | None = None,
    target: float | None = None,
    seed: int = 0,
    progress: Progress = None,
) -> Generalised:
    """Fit a model by each optimizer under several seeds, and judge it on dips that were not fitted.

    Parameters
    ----------
    records : events, or whatever `tractexp.read` reads
        The dips to fit, all together.
    model : as in `tractexp.identify`
    validate : as `records`
        The dips to judge on: a milder one to interpolate, a deeper one to extrapolate.
    optimizers : one as in `tractexp.identify`, a list, or {label: optimizer}
        All have the same limits.
    seeds : int
        Searches of each optimizer: `seed` and the ones after it.
    bounds, fixed, per_event, substeps, objective, budget, time_limit, target, seed
        As in `tractexp.identify`.
    progress : None, False or callable
        None shows how far each search is, False does not; a callable is told what is read, and
        which search begins.

    Returns
    -------
    Generalised
        `errors` of each search on each dip, and their `medians` by optimizer: the relative errors
        of Eq. (20) and the mean residuals [pu] of Eq. (21).

    Raises
    ------
    UserError
        For wrong names or values, and where no dip is held out.
    """
    check_range("task.seeds", seeds, 1)
    setup = Setup.from_arguments(
        records,
        model,
        validate,
        objective,
        bounds=bounds,
        fixed=fixed,
        per_event=per_event,
        substeps=substeps,
        seed=seed,
        budget=budget,
        time_limit=time_limit,
        target=target,
    )
    if not setup.validate:
        raise UserError(
            f"{name_setting('task=generalise')} needs dips that are not fitted: name them in"
            f" {DATA.validate}, a milder one to interpolate and a deeper one to extrapolate"
        )
    chosen = Choice.several("optimizer", optimizers)
    tell(progress, setup.lines())
    return _judge_generalization(setup, list(_run_searches(setup, chosen, seeds, progress)))


def _run_searches(
    setup: Setup, optimizers: Sequence[Choice], seeds: int, progress: Progress
) -> "Iterable[tuple[Result, list[Fit]]]":
    """The estimate, then where each search ended, with the fits of the held-out events."""
    from tractexp.identification.conclude import conclude, refuse_failed
    from tractexp.identification.estimate import estimate
    from tractexp.identification.fit import play

    problem, node, fitted = setup.problem, setup.model.node, len(setup.train)
    for optimizer in optimizers:
        for seed in range(setup.seed, setup.seed + seeds):
            tell(progress, [f"{optimizer.name}, seed {seed}"])
            end = setup.search(optimizer, seed, progress)
            refuse_failed(problem, end)
            ends = {optimizer.name: end.values}
            if (optimizer, seed) == (optimizers[0], setup.seed):
                ends = {ESTIMATE: estimate(problem, end.values).uncertainty.values, **ends}
            for name, values in ends.items():
                fits = play(problem, values, setup.validate)
                yield conclude(problem, end, values, fits, seed, node, name), fits[fitted:]


def _judge_generalization(
    setup: Setup, searched: "Sequence[tuple[Result, list[Fit]]]"
) -> Generalised:
    """The errors of all searches on the dips that none of them fitted."""
    from tractexp.identification.generalization import compare_depths

    kinds = compare_depths(setup.validate, setup.train)
    rows = [row for result, fits in searched for row in _compute_residuals(result, fits, kinds)]
    identified = [
        {
            key: getattr(result, key)
            for key in ("optimizer", "seed", "objective", "simulations", "parameters")
        }
        for result, _ in searched
    ]
    first = {result.optimizer: (result, fits) for result, fits in reversed(searched)}
    curves = [
        _build_curve(*first[name], kinds, k)
        for name in dict.fromkeys(r.optimizer for r, _ in searched)
        for k in range(len(kinds))
    ]
    return Generalised(rows, identified, curves)


def _compute_residuals(
    result: "Result", fits: "Sequence[Fit]", kinds: Sequence[str]
) -> Iterable[dict[str, Any]]:
    """Eq. (21) and Eq. (20) of P and Q on each held-out dip."""
    from tractexp.identification.generalization import compute_mean_residual

    for fit, kind in zip(fits, kinds, strict=True):
        yield {
            "optimizer": result.optimizer,
            "seed": result.seed,
            "event": fit.event.record.name,
            "kind": kind,
            "depth": fit.event.depth,
            "residual_P": compute_mean_residual(fit.event.record.P, fit.P),
            "residual_Q": compute_mean_residual(fit.event.record.Q, fit.Q),
            "epsilon_p": fit.epsilon_p,
            "epsilon_q": fit.epsilon_q,
        } | ({} if fit.epsilon_i is None else {"epsilon_i": fit.epsilon_i})


def _build_curve(
    result: "Result", fits: "Sequence[Fit]", kinds: Sequence[str], k: int
) -> dict[str, Any]:
    """Measured and calculated power of one held-out dip, (N,) each, and what its
    figure is called.
    """
    fit, record = fits[k], fits[k].event.record
    suffix = f"_{k + 1}" if kinds.count(kinds[k]) > 1 else ""
    return {
        "file": f"{result.optimizer}_{kinds[k]}{suffix}.svg",
        "title": f"{record.name} ({kinds[k]}), {result.optimizer}, seed {result.seed}",
        **{key: getattr(record, key) for key in ("t", "U", "P", "Q")},
        "P_calculated": fit.P,
        "Q_calculated": fit.Q,
        "epsilon": (fit.epsilon_p, fit.epsilon_q),
        "notes": record.notes,
    }


def _draw(curve: Mapping[str, Any], path: Path) -> Path:
    """Draw one dip as measured and as calculated."""
    from tractexp.report import figures

    t, U, P, Q, *calculated = (np.array(curve[key], dtype=float) for key in ARRAYS)
    epsilon_p, epsilon_q = curve["epsilon"]
    return figures.fit(
        path,
        t,
        U,
        (P, Q),
        (calculated[0], calculated[1]),
        title=curve["title"],
        epsilon=(epsilon_p, epsilon_q),
        notes=curve["notes"],
    )


@plugin
class Generalise(Task, call=generalise):
    """Mean absolute residuals of Eq. (21) on the held-out dips, by optimizer: generalise.json,
    curves and residuals.

    The optimizer chosen by `optimizer=` is always among those compared, with its settings; the
    others have their own defaults. All have the same limits.
    """

    reads = ("data", "model", *SEARCH)

    optimizers: list[str] = field(default_factory=list)
    # {choice of data: files}; without data.validate
    held_out: dict[str, list[str]] = field(default_factory=dict)

    def check(self) -> None:
        """Raise `UserError` for an optimizer that there is not."""
        for name in self.optimizers:
            build("optimizer", {"name": name})

    def perform(self, job: Job, **instead: Any) -> Generalised:
        """Compare the run's optimizer with those it is set against."""
        compared = {name: {"name": name} for name in self.optimizers} | {
            job.choices["optimizer"]: job.chosen
        }
        return super().perform(job.holding_out(self.held_out), optimizers=compared, **instead)

    def collect_log(self, job: Job, result: Generalised) -> dict[str, Any]:
        """The residuals of each optimizer's first seed, by the number of the held-out dip."""
        rows = result.residuals
        dips = sum(
            (row["optimizer"], row["seed"]) == (rows[0]["optimizer"], rows[0]["seed"])
            for row in rows
        )
        metrics = {
            f"validate_{1 + k % dips}_residual_{c}_{row['optimizer']}": row[f"residual_{c}"]
            for k, row in reversed(list(enumerate(rows)))  # the first seed's stand
            for c in "PQ"
        }
        return {"name": "generalisation", "metrics": metrics}
