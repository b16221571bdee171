"""One run of a comparison, and the runs of one variant: an optimizer with its settings, under all its seeds."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tractexp.errors import UserError, among

LIMITS = ("budget", "time_limit", "target")  # settings beside the optimizer's own that make a variant


@dataclass(frozen=True, eq=False)
class Run:
    """One identification. The history has one entry per iteration; a failed run has none and the objective inf."""

    optimizer: str  # as chosen: "issa_no_levy"
    data: str  # as chosen: "tibet_50pct"
    seed: int
    config: Mapping[str, Any]  # flattened: {"optimizer.levy": False, "budget": 15000, ...}
    where: str  # folder or MLflow run
    objective: float = np.inf  # pu²
    epsilon_p: float = np.nan
    epsilon_q: float = np.nan
    simulations: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,) spent by the end of an iteration
    seconds: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,)
    history: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,) best objective so far, pu²
    failure: str = ""  # why there is no result

    @property
    def finished(self) -> bool:
        return not self.failure

    def spent(self, target: float, cost: str) -> float:
        """Simulations or seconds (`cost`) by the end of the iteration that reached `target`; inf where none did."""
        reached = self.history <= target
        return float(getattr(self, cost)[reached.argmax()]) if reached.any() else np.inf


@dataclass(frozen=True, eq=False)
class Variant:
    """The runs of one optimizer with one set of settings, one per seed, in order of seed."""

    name: str
    optimizer: str
    settings: Mapping[str, Any]  # of the optimizer, and the limits
    runs: tuple[Run, ...]

    @property
    def finished(self) -> list[Run]:
        return [run for run in self.runs if run.finished]

    @property
    def objectives(self) -> dict[int, float]:
        """{seed: objective}, inf for a failed run."""
        return {run.seed: run.objective for run in self.runs}


@dataclass(frozen=True, eq=False)
class Gathered:
    """Runs of one problem by variant, in alphabetic order, and what the reader must know about the gathering."""

    variants: tuple[Variant, ...]
    problem: str
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> Variant:
        found = [variant for variant in self.variants if variant.name == name]
        if not found:
            raise UserError(
                f"there is no variant '{name}' in this comparison{among(name, (v.name for v in self.variants))}"
            )
        return found[0]


def gather(runs: Sequence[Run], source: str, data: str | None = None) -> Gathered:
    """Group runs into variants; `data` keeps the runs on that choice of data. Later repeats replace earlier ones.

    Raises `UserError` where no run is left, none finished, or the runs do not solve the same problem.
    """
    if data is not None:
        known = {run.data for run in runs}
        runs = [run for run in runs if run.data == data]
        if not runs:
            raise UserError(f"task.data={data}: {source} has no run on these data{among(data, known, 'Data')}")
    _check_same_problem(runs, source)
    failures = [run for run in runs if not run.finished]
    if len(failures) == len(runs):
        raise UserError(
            f"none of the {len(runs)} runs of {source} finished, so there is nothing to compare; "
            f"the first failed because: {failures[0].failure}"
        )
    unique = {(run.optimizer, _settings(run), run.seed): run for run in runs}
    left_out = len(runs) - len(unique)
    notes = [f"Of runs made more than once, the newest count: {left_out} left out."] if left_out else []
    return Gathered(_variants(list(unique.values())), _problem_name(runs[0]), tuple(notes))


def _settings(run: Run) -> tuple[tuple[str, str], ...]:
    kept = {k: v for k, v in run.config.items() if k.startswith("optimizer.") or k in LIMITS}
    return tuple(sorted((k, repr(v)) for k, v in kept.items()))


def _variants(runs: list[Run]) -> tuple[Variant, ...]:
    groups: dict[str, dict[Any, list[Run]]] = defaultdict(lambda: defaultdict(list))
    for run in runs:
        groups[run.optimizer][_settings(run)].append(run)
    made = []
    for optimizer, by_settings in groups.items():
        differing = {item for settings in by_settings for item in settings}
        differing -= set.intersection(*map(set, by_settings))
        for settings, members in by_settings.items():
            parts = [f"{key.removeprefix('optimizer.')}={_plain(v)}" for key, v in settings if (key, v) in differing]
            own = {key.removeprefix("optimizer."): members[0].config[key] for key, _ in settings}
            members.sort(key=lambda run: run.seed)
            made.append(Variant(" ".join([optimizer, *parts]), optimizer, own, tuple(members)))
    return tuple(sorted(made, key=lambda variant: variant.name))


def _plain(value: str) -> str:
    return {"None": "null", "True": "true", "False": "false"}.get(value, value.strip("'"))


def _problem_name(run: Run) -> str:
    return (
        f"{run.data}, model {run.config.get('model.motor.name', '?')} with {run.config.get('model.static.name', '?')}"
    )


def _check_same_problem(runs: Sequence[Run], source: str) -> None:
    """Objectives compare only on the same data and model."""
    chosen = sorted({run.data for run in runs})
    if len(chosen) > 1:
        raise UserError(
            f"{source} holds runs on different data ({', '.join(chosen)}), whose objectives cannot be compared; "
            f"choose one, such as task.data={chosen[0]}"
        )
    for part in ("data", "model"):
        contents = [{k: repr(v) for k, v in run.config.items() if k.startswith(part + ".")} for run in runs]
        for key in sorted({key for content in contents for key in content}):
            values = sorted({_plain(content.get(key, "None")) for content in contents})
            if len(values) > 1:
                raise UserError(
                    f"{source} holds runs that differ in {key} ({', '.join(values)}), so their objectives cannot be "
                    "compared; compare one problem at a time, from sweeps of their own or by task.filter"
                )
