"""A benchmark as one self-contained page for people, and as one JSON file for machines."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.storage import files
from tractexp.studies.bbob.runs import BbobRuns
from tractexp.studies.comparison.charts import draw_runtime_curves
from tractexp.text.wording import count_noun


def scale(benchmark: BbobRuns) -> str:
    """How many functions, dimensions and instances were run, in a phrase."""
    plan = benchmark.plan
    functions, dimensions = len(plan.functions), " and ".join(map(str, plan.dimensions))
    return (
        f"{count_noun(functions, 'BBOB function')} in dimension {dimensions},"
        f" {count_noun(len(plan.instances), 'instance')} each, {plan.multiplier:,} evaluations per"
        " dimension and run"
    )


def list_sentences(benchmark: BbobRuns) -> list[str]:
    """One sentence to quote for each dimension, the best optimizer first."""
    sentences = []
    plan = benchmark.plan
    for d in plan.dimensions:
        shares = {name: benchmark.share(name, d, plan.functions) for name in benchmark.optimizers}
        ranked = sorted(shares, key=lambda name: -shares[name])
        parts = [
            f"{name} met {shares[name]:.0%} of the targets and solved"
            f" {benchmark.count_solved(name, d)} of {len(plan.functions)} functions"
            for name in ranked
        ]
        sentences.append(
            f"On BBOB in dimension {d}, {len(plan.instances)} runs of {plan.multiplier * d:,}"
            f" evaluations on each function, {'; '.join(parts)}."
        )
    return sentences


def tabulate_shares(benchmark: BbobRuns, dimension: int) -> tuple[list[str], list[list[str]]]:
    """Columns and rows: the share of targets met, in all and by group of functions, and the
    functions solved.
    """
    groups = benchmark.groups()
    functions = benchmark.plan.functions
    rows = []
    for name in benchmark.optimizers:
        parts = [
            benchmark.share(name, dimension, chosen) for chosen in (functions, *groups.values())
        ]
        solved = f"{benchmark.count_solved(name, dimension)} of {len(functions)}"
        rows.append([name, *(f"{part:.0%}" for part in parts), solved])
    return ["optimizer", "all", *groups, "solved"], rows


def tabulate_running_times(benchmark: BbobRuns, dimension: int, target: int) -> list[list[str]]:
    """One row for each function: ERT in evaluations and the runs that met the target, for each
    optimizer.
    """
    count = len(benchmark.plan.instances)

    def cell(optimizer: str, function: int) -> str:
        time, met = benchmark.ert(optimizer, dimension, function, target)
        return f"{time:,.0f} ({met}/{count})" if met else "–"

    return [
        [f"f{f} {benchmark.titles[f]}", *(cell(name, f) for name in benchmark.optimizers)]
        for f in benchmark.plan.functions
    ]


def answer(benchmark: BbobRuns, dimension: int) -> str:
    """Which optimizer to take in one dimension, and where another did better."""
    functions = benchmark.plan.functions
    best, *others = sorted(
        benchmark.optimizers, key=lambda name: -benchmark.share(name, dimension, functions)
    )
    share = f"{benchmark.share(best, dimension, functions):.0%}"
    if not others:
        return (
            f"{best} met {share} of the targets in dimension {dimension}; task.against=[NAME] sets"
            " it beside others."
        )
    second = f"{benchmark.share(others[0], dimension, functions):.0%} of {others[0]}"
    sentence = (
        f"Take {best} in dimension {dimension}: it met most targets, {share} against {second}."
    )
    if share == second.partition(" ")[0]:
        sentence = f"{best} and {others[0]} met as many targets in dimension {dimension}, {share}."
    elsewhere = []
    for group, chosen in benchmark.groups().items():
        shares = {name: benchmark.share(name, dimension, chosen) for name in (best, *others)}
        lead = max(shares, key=lambda name: shares[name])
        if shares[lead] > shares[best]:
            elsewhere.append(f"{group} ({lead} {shares[lead]:.0%}, {best} {shares[best]:.0%})")
    return sentence + (
        f" Another did better in a group of functions: {'; '.join(elsewhere)}." if elsewhere else ""
    )


def draw_charts(benchmark: BbobRuns, dimension: int) -> dict[str, tuple[Chart, list[Chart]]]:
    """The ECDF over all functions and over each group, {group or "all": the whole, and each where
    they are many}.
    """
    groups = benchmark.groups()
    chosen: Mapping[str, Iterable[int]] = {"all": benchmark.plan.functions} | (
        groups if len(groups) > 1 else {}
    )
    drawn = {}
    for group, functions in chosen.items():
        hits = [benchmark.hits(name, dimension, functions) for name in benchmark.optimizers]
        drawn[group] = draw_runtime_curves(benchmark.optimizers, hits, "evaluations")
    return drawn


def span(functions: list[int]) -> str:
    """The functions of a group in short: f1-5."""
    first, last = min(functions), max(functions)
    return f"f{first}" if first == last else f"f{first}-{last}"


def report(benchmark: BbobRuns) -> Report:
    """The page of a benchmark."""
    plan = benchmark.plan
    page = Report(
        f"Benchmark of {benchmark.optimizers[0]} on BBOB", f"{scale(benchmark)}; seed {plan.seed}."
    )
    page.verdict(*(answer(benchmark, d) for d in plan.dimensions), *list_sentences(benchmark))
    for d in plan.dimensions:
        page.heading(f"Dimension {d}")
        _add_shares(page, benchmark, d)
        _add_times(page, benchmark, d)
    return _add_reading(page)


def _add_shares(page: Report, benchmark: BbobRuns, d: int) -> None:
    """The share of targets met, in a table and by evaluations."""
    plan, drawn = benchmark.plan, draw_charts(benchmark, d)
    page.table(
        *tabulate_shares(benchmark, d),
        f"Share of the {len(plan.targets)} targets, {plan.targets[0]:g} to {plan.targets[-1]:g}"
        " from the optimum, met by all runs. Solved: functions on which every run met the last"
        " one.",
    )
    whole, each = drawn.pop("all")
    page.chart(whole, "Runtimes: the share of all targets met by all runs, by evaluations.")
    if each:
        with page.fold_blocks("each optimizer in a chart of its own"):
            page.charts(each, f"In gray: {benchmark.optimizers[0]}.")
    if drawn:
        with page.fold_blocks("the same by group of functions"):
            for group, (chart, _) in drawn.items():
                numbers = ", ".join(f"f{f}" for f in benchmark.groups()[group])
                page.chart(chart, f"{group.capitalize()}: {numbers}.")


def _add_times(page: Report, benchmark: BbobRuns, d: int) -> None:
    """The expected running times to each target, the hardest first."""
    hardest = len(benchmark.plan.targets) - 1
    columns = ["function", *benchmark.optimizers]
    page.heading(f"Expected running times in dimension {d}", 3)
    page.table(
        columns,
        tabulate_running_times(benchmark, d, hardest),
        _write_caption(benchmark.plan, hardest),
    )
    with page.fold_blocks("to the other targets"):
        for target in range(hardest):
            page.table(
                columns,
                tabulate_running_times(benchmark, d, target),
                _write_caption(benchmark.plan, target),
            )


def _write_caption(plan: Any, target: int) -> str:
    """The caption of the table of running times."""
    return f"ERT to {plan.targets[target]:g} from the optimum, in evaluations (runs that met it)."


def _add_reading(page: Report) -> Report:
    """Add how the page is read."""
    return page.heading("How to read this page").items(
        [
            "ERT, the expected running time, is what all runs spent until they met the target,"
            " those that did not all they had, per run that did; a dash where none did (Hansen et"
            " al. 2021, COCO).",
            "A search that ends by itself is started again from new random numbers until the budget"
            " is spent. All optimizers have the same seeds.",
            "Each optimizer has its own settings, tuned for nothing here. An evaluation counts when"
            " it is made, not at the end of its iteration.",
            "The functions are those of Hansen, Finck, Ros and Auger 2009 in the package ioh,"
            " searched on the box [-5, 5], from which no point is let out.",
        ]
    )


def build_content(benchmark: BbobRuns, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The content of `benchmark.json`: the plan, each optimizer's settings, every run; alike for
    the same seed.

    Evaluations to a target that was not met, and running times to one that no run met, are None.
    """
    plan = benchmark.plan
    times = [
        {
            "optimizer": name,
            "dimension": d,
            "function": f,
            "ert": [benchmark.ert(name, d, f, k)[0] for k in range(len(plan.targets))],
        }
        for name in benchmark.optimizers
        for d in plan.dimensions
        for f in plan.functions
    ]
    summary = [
        {
            "optimizer": name,
            "dimension": d,
            "share": benchmark.share(name, d, plan.functions),
            "groups": {
                group: benchmark.share(name, d, chosen)
                for group, chosen in benchmark.groups().items()
            },
            "solved": benchmark.count_solved(name, d),
        }
        for name in benchmark.optimizers
        for d in plan.dimensions
    ]
    return files.make_plain(
        {
            **asdict(plan),
            "optimizers": settings,
            "summary": summary,
            "running_times": times,
            "runs": benchmark.runs,
            "sentences": list_sentences(benchmark),
        }
    )
