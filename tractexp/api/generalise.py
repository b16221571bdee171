"""Identify on some dips, judge on milder and deeper ones, for any optimizers."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tractexp import files
from tractexp.api.inputs import Setup, Written, optimizers_by_name
from tractexp.errors import UserError, check_range
from tractexp.outcome import Table

if TYPE_CHECKING:
    from tractexp.identification.optimizer import Optimizer
    from tractexp.identification.problem import Problem
    from tractexp.identification.result import Fit, Result
    from tractexp.model.model import Model
    from tractexp.record import Event, Record

ARRAYS = ("t", "U", "P", "Q", "P_calculated", "Q_calculated")
ERRORS = ("residual_P", "residual_Q", "epsilon_p", "epsilon_q")
Callback = Callable[[int, float, int], None]  # of the search loop
Watch = Callable[[str, "Optimizer", int], AbstractContextManager[Callback | None]]


@dataclass(frozen=True, eq=False, repr=False)
class Generalised(Written):
    """Residuals on the held-out dips: a row for each optimizer, seed and dip; and the parameters they come from."""

    kind = "generalisation"

    residuals: Sequence[Mapping[str, Any]]
    identified: Sequence[Mapping[str, Any]]
    curves: Sequence[Mapping[str, Any]]  # what is drawn: each optimizer's first seed on each held-out dip

    @property
    def medians(self) -> list[dict[str, Any]]:
        """Over the seeds: {event, kind, optimizer, residual_P, residual_Q, epsilon_p, epsilon_q}, by event."""
        groups: dict[Any, list[Mapping[str, Any]]] = {}
        for event, kind in dict.fromkeys((row["event"], row["kind"]) for row in self.residuals):
            for row in self.residuals:
                if row["event"] == event:
                    groups.setdefault((event, kind, row["optimizer"]), []).append(row)
        return [
            dict(zip(("event", "kind", "optimizer"), key, strict=True))
            | {error: float(median(row[error] for row in rows)) for error in ERRORS}
            for key, rows in groups.items()
        ]

    def table(self) -> Table:
        columns = ["event", "kind", "optimizer", *ERRORS]
        said = ["residuals: mean absolute value of Eq. (21), pu; medians over the seeds"]
        return Table(columns, [[row[c] for c in columns] for row in self.medians], "on dips not fitted", said)

    def write(self, folder: Path) -> list[Path]:
        """Write generalise.json, and a figure for each optimizer and held-out dip."""
        told = {"residuals": self.residuals, "identified": self.identified}
        return [files.write_json(folder / "generalise.json", told), *_draw(folder, self.curves)]

    def to_dict(self) -> dict[str, Any]:
        return {"residuals": self.residuals, "identified": self.identified, "curves": self.curves}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        return cls(content["residuals"], content["identified"], content["curves"])


def generalise(
    records: "Sequence[Event | Record]",
    validate: "Sequence[Event | Record]",
    *,
    model: "Model | Mapping[str, Any]",
    optimizers: Any,
    seeds: int = 1,
    seed: int = 0,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    substeps: int | None = None,
    per_event: Sequence[str] | None = None,
    objective: Any = None,
    budget: int | None = None,
    time_limit: float | None = None,
    target: float | None = None,
    begin: "Callable[[Problem], None]" = lambda problem: None,
    watch: Watch = lambda name, optimizer, seed: nullcontext(),
) -> Generalised:
    """Fit `model` to `records` by each optimizer under `seeds` seeds from `seed` on, judge it on `validate`.

    `optimizers` are names or plugins, or a mapping of names to these; all have the same limits. Bounds, fixed values,
    `objective` (None: least squares) and limits are as in an identification. `begin(problem)` is called once all is
    found right; `watch(name, optimizer, seed)` is entered around each search and gives its callback. Raises
    `UserError` for wrong input, and where no dip is held out.
    """
    check_range("seeds", seeds, 1)
    known = {"bounds": bounds, "fixed": fixed, "substeps": substeps, "per_event": per_event}
    limits = {"budget": budget, "time_limit": time_limit, "target": target}
    setup = Setup.of(records, validate, model, known, objective, seed, **limits)
    if not setup.held_out:
        raise UserError(
            "task=generalise needs dips that are not fitted: name them in data.validate, a milder one to"
            " interpolate and a deeper one to extrapolate"
        )
    chosen, problem = optimizers_by_name(optimizers), setup.problem()
    begin(problem)
    return _told(setup, list(_searched(setup, problem, chosen, seeds, watch)))


def _searched(
    setup: Setup, problem: "Problem", optimizers: "Mapping[str, Optimizer]", seeds: int, watch: Watch
) -> "Iterable[tuple[Result, list[Fit]]]":
    """What each search identified, and its fits of the held-out events."""
    from tractexp.identification.result import conclude
    from tractexp.identification.search import search

    parts = {part: setup.model[part] for part in ("motor", "static", "effects")}
    for name, optimizer in optimizers.items():
        for seed in range(setup.seed, setup.seed + seeds):
            with watch(name, optimizer, seed) as progress:
                found = search(problem, optimizer, seed, setup.search_limits, progress)
            result, fits = conclude(problem, found, setup.held_out, seed, parts, name)
            yield result, fits[len(setup.train) :]


def _told(setup: Setup, searched: "Sequence[tuple[Result, list[Fit]]]") -> Generalised:
    """The searches as plain data."""
    from tractexp.replication.searches import by_depth

    kinds = by_depth(setup.held_out, setup.train)
    rows = [row for result, fits in searched for row in _residuals(result, fits, kinds)]
    identified = [
        {key: getattr(result, key) for key in ("optimizer", "seed", "objective", "simulations", "parameters")}
        for result, _ in searched
    ]
    first = {result.optimizer: (result, fits) for result, fits in reversed(searched)}
    curves = [_curve(*first[name], kinds, k) for name in dict.fromkeys(r.optimizer for r, _ in searched)
              for k in range(len(kinds))]  # fmt: skip
    return Generalised(rows, identified, curves)


def _residuals(result: "Result", fits: "Sequence[Fit]", kinds: Sequence[str]) -> Iterable[dict[str, Any]]:
    """Eq. (21) and Eq. (20) of P and Q on each held-out dip."""
    from tractexp.replication.searches import mean_residual

    for fit, kind in zip(fits, kinds, strict=True):
        yield {
            "optimizer": result.optimizer,
            "seed": result.seed,
            "event": fit.event.record.name,
            "kind": kind,
            "depth": fit.event.depth,
            "residual_P": mean_residual(fit.event.record.P, fit.P),
            "residual_Q": mean_residual(fit.event.record.Q, fit.Q),
            "epsilon_p": fit.epsilon_p,
            "epsilon_q": fit.epsilon_q,
        }


def _curve(result: "Result", fits: "Sequence[Fit]", kinds: Sequence[str], k: int) -> dict[str, Any]:
    """Measured and calculated power of one held-out dip, (N,) each, and what its figure is called."""
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


def _draw(folder: Path, curves: Sequence[Mapping[str, Any]]) -> list[Path]:
    """Curves and residuals: issa_interpolation.svg, ..."""
    from tractexp.report import figures

    drawn = []
    for told in curves:
        t, U, P, Q, *calculated = (np.array(told[key], dtype=float) for key in ARRAYS)
        epsilon_p, epsilon_q = told["epsilon"]
        path = figures.fit(
            folder / told["file"], t, U, (P, Q), (calculated[0], calculated[1]), title=told["title"],
            epsilon=(epsilon_p, epsilon_q), notes=told["notes"],
        )  # fmt: skip
        drawn.append(path)
    return drawn
