"""Searches of one problem by several optimizers under many seeds, to be compared."""

import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp.api.arguments import Choice, public
from tractexp.api.setup import Setup
from tractexp.blocks import Table
from tractexp.configuration.composition import list_leaves
from tractexp.errors import UserError, check_distinct, check_range, list_allowed
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.text.progress import Progress, count_parts, tell

if TYPE_CHECKING:
    from tractexp.api.given import Chosen, ModelGiven, Records, Several
    from tractexp.studies.comparison.runs import SearchRun

SEARCH_SEEDS = 30


@dataclass(frozen=True, eq=False, repr=False)
class Searches(Written):
    """Where each search ended, before any polish. `tractexp.compare` says which variant to take."""

    kind = "searches"
    source = "tractexp.search"  # where a comparison says its runs are from

    setup: Setup
    runs: "tuple[SearchRun, ...]"

    def table(self) -> Table:
        """A row for each search: variant, seed and where it ended."""
        from tractexp.studies.comparison.runs import name_variants

        columns = ["variant", "seed", "objective [pu²]", "epsilon_p", "epsilon_q", "simulations"]
        rows = [
            [
                name,
                run.seed,
                *([run.objective, run.epsilon_p, run.epsilon_q] if run.is_finished else [None] * 3),
                int(run.simulations[-1]) if run.is_finished else None,
                run.failure,
            ]
            for name, run in zip(name_variants(self.runs), self.runs, strict=True)
        ]
        return Table([*columns, "failure"], rows, words=(6,))

    def write_results(self, folder: Path) -> list[Path]:
        """Write `searches.json`."""
        return [files.write_json(folder / "searches.json", self.to_dict())]

    def to_dict(self) -> dict[str, Any]:
        """Call and searches as plain data."""
        return {"setup": self.setup.to_dict(), "runs": [run.to_dict() for run in self.runs]}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The searches that `to_dict` gave."""
        from tractexp.studies.comparison.runs import SearchRun

        runs = tuple(map(SearchRun.from_dict, content["runs"]))
        return cls(Setup.from_dict(content["setup"]), runs)


@public
def search(
    records: "Records",
    model: "ModelGiven | None" = None,
    *,
    optimizers: "Several | None" = None,
    switches: Sequence[str] = (),
    seeds: int = SEARCH_SEEDS,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    per_event: Sequence[str] | None = None,
    substeps: int | None = None,
    objective: "Chosen | None" = None,
    budget: int | None = None,
    time_limit: float | None = None,
    target: float | None = None,
    seed: int = 0,
    cores: int | None = None,
    progress: Progress = None,
) -> Searches:
    """Fit a model by each optimizer under several seeds, for `tractexp.compare` to judge.

    A search that fails is a row with the reason. What was searched before by the same code on the
    same records is read back.

    Parameters
    ----------
    records, model : as in `tractexp.identify`
    optimizers : one as in `tractexp.identify`, a list, or {label: optimizer}
        A plugin of your own enters by its name. All have the same limits.
    switches : names
        Settings of optimizers that are true or false: every combination of those that an optimizer
        has is a variant of it, whose effects the comparison tells.
    seeds : int
        Searches of each: `seed` and the ones after it.
    bounds, fixed, per_event, substeps, objective, budget, time_limit, target, seed
        As in `tractexp.identify`.
    cores : int
        Processes; None: all.
    progress : None, False or callable
        None shows how many searches have ended, False does not; a callable is told what is read,
        and of each group.

    Returns
    -------
    Searches
        A row for each search; what `tractexp.compare` takes.

    Raises
    ------
    UserError
        For wrong names or values.
    """
    check_range("seeds", seeds, 1)
    check_range("cores", cores, 1)
    chosen = vary_switches(Choice.several("optimizer", optimizers), switches)
    setup = Setup.from_arguments(
        records,
        model,
        (),
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
    tell(progress, setup.lines())
    return Searches(setup, tuple(_run_searches(setup, chosen, seeds, cores, progress)))


def vary_switches(choices: Sequence[Choice], switches: Sequence[str]) -> list[Choice]:
    """Each choice with every combination of those switches that it has.

    Raises `UserError` for a switch that none of them has.
    """
    if switches:
        check_distinct("switches", switches)
    there = set(itertools.chain.from_iterable(map(_list_switches, choices)))
    for switch in switches:
        if switch not in there:
            names = ", ".join(one.name for one in choices)
            raise UserError(
                f"switches names {switch}, which is no switch of"
                f" {names}{list_allowed(switch, there, 'Switches')}"
            )
    return [varied for one in choices for varied in _vary(one, switches)]


def _list_switches(choice: Choice) -> list[str]:
    """The settings of a choice that are on or off."""
    return [key for key, value in choice.node.items() if isinstance(value, bool)]


def _vary(choice: Choice, switches: Sequence[str]) -> list[Choice]:
    """A choice with every combination of those switches that it has."""
    own = _list_switches(choice)
    varied = [key for key in switches if key in own]
    return [
        dataclasses.replace(choice, node={**choice.node, **dict(zip(varied, values, strict=True))})
        for values in itertools.product((True, False), repeat=len(varied))
    ]


def _run_searches(
    setup: Setup, choices: Sequence[Choice], seeds: int, cores: int | None, progress: Progress
) -> "Iterator[SearchRun]":
    """The searches by each choice under each seed, on the cores of this computer."""
    from tractexp.studies import searches

    span = range(setup.seed, setup.seed + seeds)
    variants = {str(k): one.node for k, one in enumerate(choices)}
    everything = len(variants) * seeds
    counted = 0
    with count_parts("searches", everything, progress) as count:

        def count_ended(done: int, total: int) -> None:
            """Those read back, `everything - total`, have ended, too."""
            nonlocal counted
            ended = everything - total + done
            for _ in range(ended - counted):
                count()
            counted = ended

        made = searches.attempt(
            setup.problem_of,
            variants,
            span,
            setup.limits,
            cores,
            count_ended,
            note=lambda line: tell(progress, [line.strip()]),
        )
    for one, several in zip(choices, made.values(), strict=True):
        for seed, end in zip(span, several, strict=True):
            yield _describe_run(setup, one, seed, end)


def _describe_run(setup: Setup, choice: Choice, seed: int, end: Any) -> "SearchRun":
    """The record of one search, for a comparison of several: settings, history and final values.

    `end` is what the search returned, or a `FailedSearch`. A search in which no point could be
    simulated is a record with its reason as `failure`, not an error.
    """
    from tractexp.identification.conclude import describe_search, refuse_failed
    from tractexp.studies.comparison.load import list_parameters
    from tractexp.studies.comparison.runs import SearchRun
    from tractexp.studies.searches import FailedSearch

    content = {
        "optimizer": dict(choice.node),
        "model": dict(setup.model.node),
        "objective": dict(setup.objective.node),
        "budget": setup.budget,
        "time_limit": setup.time_limit,
        "target": setup.target,
        "seed": seed,
    }
    names = " and ".join(event.record.name for event in setup.train)
    run = SearchRun(choice.name, names, seed, dict(list_leaves(content)), f"seed {seed}")
    if isinstance(end, FailedSearch):
        return dataclasses.replace(run, failure=end.why)
    try:
        refuse_failed(setup.problem, end)
    except UserError as error:
        return dataclasses.replace(run, failure=str(error))
    ended = describe_search(setup.problem, end)
    return dataclasses.replace(
        run,
        **{key: float(ended[key]) for key in ("objective", "epsilon_p", "epsilon_q")},
        parameters=list_parameters(ended),
        simulations=end.history.simulations.astype(float),
        seconds=end.history.seconds,
        history=end.history.objective,
    )
