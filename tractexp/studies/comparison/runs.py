"""One run of a comparison, and the runs of one variant: an optimizer with its settings, under all
its seeds.

What is compared is where each search ended, before the estimate was polished.
"""

import itertools
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from tractexp.errors import TASK, UserError, list_allowed
from tractexp.storage import files

# The parts of a configuration. Every key belongs to one of them, so that nothing swept is pooled
# under one name.
PROBLEM = ("data", "model", "objective")  # one comparison has one of each
# what differs in these makes a variant
SETTINGS = ("optimizer", "task", "budget", "time_limit", "target")
REST = ("seed", "tracking", "sweep")  # what differs in these does not
ARRAYS = ("simulations", "seconds", "history")  # of a run


@dataclass(frozen=True, eq=False)
class SearchRun:
    """The search of one identification, as it ended. The history has one entry per iteration.

    A failed run has none and the objective inf. An interrupted one neither failed nor finished.
    """

    optimizer: str  # as chosen: "issa_no_levy"
    data: str  # as chosen: "tibet_50pct"
    seed: int
    config: Mapping[str, Any]  # flattened: {"optimizer.levy": False, "budget": 15000, ...}
    where: str  # folder or MLflow run
    objective: float = np.inf  # pu²
    epsilon_p: float = np.nan
    epsilon_q: float = np.nan
    # (n,) spent by the end of an iteration
    simulations: np.ndarray = field(default_factory=lambda: np.empty(0))
    seconds: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,)
    # (n,) best objective so far, pu²
    history: np.ndarray = field(default_factory=lambda: np.empty(0))
    parameters: Mapping[str, float] = field(default_factory=dict)  # empty where they are not known
    failure: str = ""  # why there is no result
    interruption: str = ""  # why there is none yet
    code: str = ""  # version and commit of the package; "" where that is not known
    folder: str = ""  # where it ran, from which relative paths count; "" where that is not known

    @property
    def is_finished(self) -> bool:
        """Whether it neither failed nor was interrupted."""
        return not (self.failure or self.interruption)

    def to_dict(self) -> dict[str, Any]:
        """The run as plain data."""
        return files.make_plain(vars(self))

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The run that `to_dict` gave: plain data have no numbers that are not finite."""
        arrays = {name: np.array(content[name], dtype=float) for name in ARRAYS}
        unknown = {"objective": np.inf, "epsilon_p": np.nan, "epsilon_q": np.nan}
        numbers = {
            name: instead if content[name] is None else content[name]
            for name, instead in unknown.items()
        }
        return cls(**{**content, **arrays, **numbers})

    def spent(self, target: float, cost: str) -> float:
        """Simulations or seconds (`cost`) by the end of the iteration that reached `target`; inf
        where none did.
        """
        reached = self.history <= target
        return float(getattr(self, cost)[reached.argmax()]) if reached.any() else np.inf


@dataclass(frozen=True, eq=False)
class Variant:
    """The runs of one optimizer with one set of settings, one per seed, in order of seed."""

    name: str
    optimizer: str
    settings: Mapping[str, Any]  # of the optimizer, and the limits
    runs: tuple[SearchRun, ...]

    @property
    def finished_runs(self) -> list[SearchRun]:
        """The runs that are finished."""
        return [run for run in self.runs if run.is_finished]

    @property
    def objectives(self) -> dict[int, float]:
        """{seed: objective}, inf for a failed run."""
        return {run.seed: run.objective for run in self.runs}


@dataclass(frozen=True, eq=False)
class Gathered:
    """Runs of one problem by variant, in alphabetic order, and what the reader must know about the
    gathering.
    """

    variants: tuple[Variant, ...]
    problem: str
    notes: tuple[str, ...]
    interrupted: tuple[tuple[str, SearchRun], ...] = ()  # (variant, run), which are not judged

    def __getitem__(self, name: str) -> Variant:
        """The variant of that name. Raises `UserError` with those there are."""
        variants = [variant for variant in self.variants if variant.name == name]
        if not variants:
            raise UserError(
                f"there is no variant '{name}' in this"
                f" comparison{list_allowed(name, (v.name for v in self.variants))}"
            )
        return variants[0]


def select_runs_on(runs: Sequence[SearchRun], source: str, data: str) -> list[SearchRun]:
    """The runs on one choice of data. Raises `UserError` where there is none."""
    chosen = [run for run in runs if run.data == data]
    if not chosen:
        choices = {run.data for run in runs}
        raise UserError(
            f"{TASK.data}={data}: {source} has no run on these data"
            f"{list_allowed(data, choices, 'Data')}"
        )
    return chosen


def part_runs(
    runs: Sequence[SearchRun], apart: Sequence[str] = ()
) -> dict[tuple[str, ...], list[SearchRun]]:
    """Runs by their data and by the limits named in `apart`, which make comparisons of their own,
    as they come.
    """
    groups: dict[tuple[str, ...], list[SearchRun]] = defaultdict(list)
    for run in runs:
        groups[(run.data, *(repr(run.config.get(key)) for key in apart))].append(run)
    return groups


def gather(runs: Sequence[SearchRun], source: str) -> Gathered:
    """Group runs into variants. Later repeats replace earlier ones.

    Interrupted runs are told apart from those that are judged. Raises `UserError` where none
    finished, or the runs do not solve the same problem.
    """
    _check_same_problem(runs, source)
    _check_any_finished(runs, source)
    ended = [run for run in runs if not run.interruption]
    unique = {_find_identity(run): run for run in ended}
    notes = []
    if left_out := len(ended) - len(unique):
        notes.append(f"Of runs made more than once, the newest count: {left_out} left out.")
    notes += _describe_versions(ended)
    names = _name_variants(runs)
    stopped = {_find_identity(run): run for run in runs if run.interruption}
    unjudged = [run for key, run in stopped.items() if key not in unique]
    if unjudged:
        count = f"{len(unjudged)} runs were" if len(unjudged) > 1 else "One run was"
        notes.append(
            f"{count} interrupted, or still going on, and not judged: see the end of the page."
        )
    return Gathered(
        _collect_variants(list(unique.values()), names),
        _name_problem(runs[0]),
        tuple(notes),
        tuple((names[_find_settings(run)], run) for run in unjudged),
    )


def _describe_versions(runs: Sequence[SearchRun]) -> list[str]:
    """A note on runs made by different code; [] where it is the same, or not known."""
    versions = {run.code for run in runs} - {""}
    if len(versions) < 2:
        return []
    return [
        f"The runs were made by different code ({', '.join(sorted(versions))}): a difference"
        " between variants may be one between versions."
    ]


def _check_any_finished(runs: Sequence[SearchRun], source: str) -> None:
    """Raise `UserError` where no run is finished, with the reason."""
    if any(run.is_finished for run in runs):
        return
    failures = [run.failure for run in runs if run.failure]
    why = (
        f"the first failed because: {failures[0]}"
        if failures
        else "all were interrupted, or still go on"
    )
    raise UserError(
        f"none of the {len(runs)} runs of {source} finished, so there is nothing to compare; {why}"
    )


Settings = tuple[str, tuple[tuple[str, str], ...]]  # the optimizer as chosen, and what is set


def _find_settings(run: SearchRun) -> Settings:
    """The optimizer and its settings, which tell variants apart."""
    settings = {
        key: value for key, value in run.config.items() if key.partition(".")[0] in SETTINGS
    }
    return run.optimizer, tuple(sorted((key, repr(value)) for key, value in settings.items()))


def _find_identity(run: SearchRun) -> tuple[Settings, int]:
    """The variant and the seed, which tell runs apart."""
    return _find_settings(run), run.seed


def name_variants(runs: Sequence[SearchRun]) -> list[str]:
    """The name of each run's variant."""
    names = _name_variants(runs)
    return [names[_find_settings(run)] for run in runs]


def _name_variants(runs: Sequence[SearchRun]) -> dict[Settings, str]:
    """The name of each variant: its optimizer, and the settings in which runs of that optimizer
    differ.
    """
    groups: dict[str, list[Settings]] = defaultdict(list)
    for settings in dict.fromkeys(map(_find_settings, runs)):
        groups[settings[0]].append(settings)
    names = {}
    for optimizer, several in groups.items():
        differing = {item for _, settings in several for item in settings}
        differing -= set.intersection(*(set(settings) for _, settings in several))
        for one in several:
            parts = [
                f"{k.removeprefix('optimizer.')}={_write_as_typed(v)}"
                for k, v in one[1]
                if (k, v) in differing
            ]
            names[one] = " ".join([optimizer, *parts])
    return names


def _collect_variants(runs: list[SearchRun], names: Mapping[Settings, str]) -> tuple[Variant, ...]:
    """The variants of runs, each with its runs."""
    groups: dict[Settings, list[SearchRun]] = defaultdict(list)
    for run in runs:
        groups[_find_settings(run)].append(run)
    variants = []
    for settings, members in groups.items():
        own = {key.removeprefix("optimizer."): members[0].config[key] for key, _ in settings[1]}
        members.sort(key=lambda run: run.seed)
        variants.append(Variant(names[settings], settings[0], own, tuple(members)))
    return tuple(sorted(variants, key=lambda variant: variant.name))


def _write_as_typed(value: str) -> str:
    """A value as the command line writes it."""
    return {"None": "null", "True": "true", "False": "false"}.get(value, value.strip("'"))


def _name_problem(run: SearchRun) -> str:
    """The data and the model of a run, in a phrase."""
    return (
        f"{run.data}, model {run.config.get('model.motor.name', '?')} with"
        f" {run.config.get('model.static.name', '?')}"
    )


def _check_same_problem(runs: Sequence[SearchRun], source: str) -> None:
    """Objectives compare only on the same data, with the same model, by the same measure."""
    chosen = sorted({run.data for run in runs})
    if len(chosen) > 1:
        raise UserError(
            f"{source} holds runs on different data ({', '.join(chosen)}), whose objectives cannot"
            f" be compared; choose one, such as {TASK.data}={chosen[0]}"
        )
    keys = set(itertools.chain.from_iterable(run.config for run in runs))

    for part in PROBLEM:
        for key in sorted(key for key in keys if key.partition(".")[0] == part):
            values = sorted({_write_as_typed(repr(run.config.get(key))) for run in runs})
            if len(values) > 1:
                raise UserError(
                    f"{source} holds runs that differ in {key} ({', '.join(values)}), so their"
                    " objectives cannot be compared; compare one problem at a time, from sweeps of"
                    f" their own or by {TASK.filter}"
                )
