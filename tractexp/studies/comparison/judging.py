"""Runs judged: those of one problem, those of several, and the same variants on BBOB."""

import contextlib
import itertools
from collections.abc import Mapping, Sequence
from inspect import unwrap
from pathlib import Path
from typing import Any

from tractexp.api.setup import Setup
from tractexp.cache import provenance
from tractexp.configuration.plugin import discover, get
from tractexp.errors import UserError
from tractexp.inference.problem import Problem
from tractexp.record import detect, read_records
from tractexp.storage import files
from tractexp.studies.api.benchmark import BenchmarkResult, benchmark
from tractexp.studies.comparison.ablation import find_family
from tractexp.studies.comparison.comparison import Comparison, compare
from tractexp.studies.comparison.floor import Polished, polish
from tractexp.studies.comparison.load import nest_keys
from tractexp.studies.comparison.overall import (
    Overall,
    Several,
    describe_limit,
    merge_records,
    rank_on_functions,
)
from tractexp.studies.comparison.runs import Gathered, SearchRun, gather
from tractexp.text.progress import count_parts
from tractexp.text.wording import join_words

# on BBOB; the evaluations where the searches had no budget in common
DIMENSION, EVALUATIONS = 5, 15_000
BBOB = "bbob.json"


def compare_runs(
    gathered: Gathered, progress: Any, judging: Mapping[str, Any], problem: Problem | None = None
) -> Comparison:
    """The runs of one problem compared; `judging` are the arguments of `comparison.compare` that a
    user chooses.

    Without the `problem` it is put again from the configuration of the runs.
    """
    polished, why_not = _polish_described_problem(gathered, progress, problem)
    return compare(
        gathered, plain=list_plain_optimizers(), polished=polished, why_not=why_not, **judging
    )


def judge_problems(
    groups: Mapping[tuple[str, ...], Sequence[SearchRun]],
    source: str,
    judging: Mapping[str, Any],
    folder: Path | None,
    bbob: int,
    cores: int | None,
    progress: Any,
    problem: Problem | None = None,
) -> Several:
    """Each problem by itself, what they come to under the same terms, and the variants on BBOB."""
    comparisons: dict[str, Comparison] = {}
    by_terms: dict[str, dict[str, Comparison]] = {}
    for (data, *_), runs in groups.items():
        terms = describe_limit(runs)
        label = f"{data}, {terms}" if terms else data
        gathered = gather(runs, f"{source} on {label}")
        comparisons[label] = compare_runs(gathered, progress, judging, problem)
        by_terms.setdefault(terms, {})[label] = comparisons[label]
    without = list_plain_optimizers()
    overall = [
        merge_records(terms, comparisons, without) for terms, comparisons in by_terms.items()
    ]
    notes = _collect_notes(comparisons)
    if bbob:
        try:
            overall.append(
                _run_on_bbob(next(iter(comparisons.values())), bbob, folder, cores, progress)
            )
        # the records have been searched: what they say is told all the same
        except UserError as error:
            notes.append(f"BBOB was left out: {str(error).rstrip('.')}.")
    return Several(comparisons, tuple(overall), tuple(notes))


def _collect_notes(comparisons: Mapping[str, Comparison]) -> list[str]:
    """The notes of all comparisons, each once, with the problems that it is true of unless that is
    all of them.
    """
    of: dict[str, list[str]] = {}
    for label, comparison in comparisons.items():
        for note in comparison.notes:
            of.setdefault(note, []).append(label)
    return [
        n if len(labels) == len(comparisons) else f"{join_words(labels)}: {n}"
        for n, labels in of.items()
    ]


def _run_on_bbob(
    comparison: Comparison, instances: int, folder: Path | None, cores: int | None, progress: Any
) -> Overall:
    """The variants of a comparison on BBOB; the runs are kept beside those of the sweep, under what
    they depend on.
    """
    variants = [v for v in comparison.gathered.variants if not v.settings.get("polish")]
    optimizers = {v.name: nest_keys(v.runs[0].config)["optimizer"] for v in variants}
    runs = itertools.chain.from_iterable(v.runs for v in variants)
    budgets: set[Any] = {run.config.get("budget") for run in runs} - {None}
    multiplier = -(-int(budgets.pop() if len(budgets) == 1 else EVALUATIONS) // DIMENSION)
    settings = {
        "optimizers": optimizers,
        "instances": instances,
        "multiplier": multiplier,
        "code": provenance.hash_code(),
    }
    result = _load_stored_runs(folder, settings) if folder else None
    if result is None:
        chosen = {
            "instances": range(1, instances + 1),
            "dimensions": [DIMENSION],
            "multiplier": multiplier,
        }
        result = unwrap(benchmark)(optimizers, **chosen, cores=cores, progress=progress)
        if folder:
            files.write_json(folder / BBOB, {"of": settings, "made": result.to_dict()})
    return rank_on_functions(result.bbob, find_family(variants, list_plain_optimizers()))


def _load_stored_runs(folder: Path, settings: Mapping[str, Any]) -> BenchmarkResult | None:
    """The runs on BBOB that were made before with the same code and settings."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError, UserError):
        content = files.read_json(folder / BBOB)
        if content["of"] == files.make_plain(settings):
            return BenchmarkResult.from_dict(content["made"])
    return None


def _polish_described_problem(
    gathered: Gathered, progress: Any, problem: Problem | None
) -> tuple[Polished | None, str]:
    """The descents on the problem that the runs' configuration describes; None, and why, where they
    are impossible.
    """
    runs = [run for variant in gathered.variants for run in variant.runs]
    try:
        problem = problem or _build_problem(next(run for run in runs if run.is_finished))
    except UserError as error:
        return None, f"the problem cannot be put again ({str(error).rstrip('.')})"
    except (KeyError, TypeError, ValueError) as error:
        return (
            None,
            f"the configuration of the runs is not understood any more ({type(error).__name__}:"
            f" {error})",
        )
    with contextlib.ExitStack() as stack:
        polished = polish(
            problem,
            runs,
            lambda n: stack.enter_context(count_parts("groups of descents", n, progress)),
        )
    why = "the records or the model have changed since: these parameters fit otherwise now"
    return polished, "" if polished else why


def _build_problem(run: SearchRun) -> Problem:
    """The problem that a run's configuration describes. Raises `UserError` where its records are
    not there any more.
    """
    config = nest_keys(run.config)
    # relative paths count from where the run was started
    home = Path(run.folder) if run.folder else Path()
    with contextlib.chdir(home) if home.is_dir() else contextlib.nullcontext():
        records = read_records(config["data"])
    train = [detect(record) for record in records.train]
    return Setup.from_arguments(train, config["model"], objective=config.get("objective")).problem


def list_plain_optimizers() -> dict[str, str]:
    """For each optimizer the one that it is with all its switches off, "" where there is none."""
    return {name: get("optimizer", name).plain for name in discover()["optimizer"]}
