"""A comparison as one self-contained page for people, and as one JSON file for machines."""

import math
import tempfile
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.comparison import claims
from tractexp.comparison.ablation import Ablation
from tractexp.comparison.claims import number, p_value
from tractexp.comparison.comparison import Comparison, Pair
from tractexp.comparison.statistics import ALPHA, size_of
from tractexp.comparison.summary import AT_FLOOR, Spread
from tractexp.report import compare as figures
from tractexp.report.page import Page

QUOTED = 12  # more sentences than these about pairs are folded away


def write_page(comparison: Comparison, path: Path, source: str) -> Path:
    """Write `comparison.html`; `source` says where the runs are from."""
    runs = sum(summary.runs for summary in comparison.summaries)
    title = f"Comparison of {len(comparison.summaries)} optimizers on {comparison.gathered.problem}"
    page = Page(title, f"{runs} runs of {source}.")
    page.verdict(claims.headline(comparison), claims.of_floor(comparison), claims.of_speed(comparison))
    if comparison.notes:
        page.heading("Mind").items(comparison.notes)
    with tempfile.TemporaryDirectory() as folder:
        _quality(page, comparison)
        _speed(page, comparison, Path(folder))
        _differences(page, comparison, Path(folder))
    if comparison.ablation:
        _switches(page, comparison.ablation)
    _failures(page, comparison)
    _reading(page, comparison)
    return page.write(path)


def _spread(spread: Spread, scale: float = 1.0) -> list[str]:
    """Best, lower quartile, median, upper quartile, worst."""
    return [number(x * scale, 4) for x in (spread.best, spread.lower, spread.median, spread.upper, spread.worst)]


def _quality(page: Page, comparison: Comparison) -> None:
    page.heading("How good")
    columns = ["variant", "runs", "failed", "best", "lower quartile", "median", "upper quartile", "worst", "at floor"]
    rows = [
        [s.name, str(s.runs), str(s.failures), *_spread(s.objective), f"{s.at_floor:.0%}"] for s in comparison.summaries
    ]
    floor = f"the floor, {number(comparison.floor.value, 5)} pu² ({comparison.floor.source})"
    page.table(columns, rows, f"Objective of Eq. (8) [pu²]. At floor: share of runs within {AT_FLOOR:.0%} of {floor}.")
    for name in ("epsilon_p", "epsilon_q"):
        rows = [[s.name, *_spread(getattr(s, name), 100.0)] for s in comparison.summaries]
        with page.folded(f"{name} of Eq. (20)"):
            page.table(["variant", *columns[3:-1]], rows, f"{name}, in percent.")


def _speed(page: Page, comparison: Comparison, folder: Path) -> None:
    page.heading("How fast")
    goals = [f"{target:g} x floor" for target in comparison.targets]
    columns = ["variant", "simulations", *(f"{g} [simulations]" for g in goals), *(f"{g} [s]" for g in goals)]
    rows = [
        [s.name, number(s.simulations.median)]
        + [number(float(round(x)) if math.isfinite(x) else x) for x in s.ert["simulations"]]
        + [number(x) for x in s.ert["seconds"]]
        for s in comparison.summaries
    ]
    page.table(
        columns,
        rows,
        "Median of all simulations made, and expected running time (ERT) to each target: what all runs spent until "
        "they reached it, those that did not all they had, per run that did.",
    )
    many = len(comparison.summaries) > figures.TOGETHER
    behind = f" Gray: {comparison.summaries[0].name}." if many else ""
    band = "Median and quartiles of the best objective by {}. Dashed: the floor." + behind
    for by in ("simulations", "iterations"):
        drawn = figures.fitness(folder / f"{by}.svg", comparison.variants, by, comparison.floor)
        page.figure(drawn, band.format(by) + (" An iteration may cost several populations." * (by == "iterations")))
    drawn = figures.ecdf(folder / "ecdf.svg", comparison.variants, comparison.floor)
    page.figure(drawn, f"Runtimes: the share of {figures.targets_told()} reached by all runs, by simulations.{behind}")


def _differences(page: Page, comparison: Comparison, folder: Path) -> None:
    page.heading("Is the difference more than chance?")
    page.figure(
        figures.boxes(folder / "boxes.svg", comparison.variants, comparison.floor),
        "Quartiles, range and every run. Dashed: the floor.",
    )
    if comparison.ranks:
        page.text(claims.of_ranks(comparison))
        page.figure(
            figures.critical_difference(folder / "ranks.svg", comparison.ranks),
            f"Mean ranks over seeds, 1 is best. A bar joins variants whose ranks do not differ significantly at "
            f"{ALPHA:.0%} (Nemenyi).",
        )
    if not comparison.pairs:
        return
    main, rest = claims.near_and_far(comparison)
    _pairs(page, main, "")
    if rest:
        with page.folded(f"the other {len(rest)} pairs"):
            _pairs(page, rest, "")
    told = [claims.of_pair(comparison, pair) for pair in (*main, *rest)]
    page.heading("To quote", 3).items(told[:QUOTED])
    if told[QUOTED:]:
        with page.folded(f"{len(told) - QUOTED} more sentences"):
            page.items(told[QUOTED:])


def _pairs(page: Page, pairs: list[Pair], caption: str) -> None:
    columns = ["lower", "higher", "seeds", "median", "median", "p", "p (Holm)", "A", "effect", "significant"]
    rows = [
        [
            *(
                pair.first,
                pair.second,
                str(pair.seeds),
                *map(number, pair.medians),
                *map(p_value, (pair.p, pair.corrected)),
            ),
            *(f"{pair.effect:.2f}", size_of(pair.effect), "yes" if pair.significant else "no"),
        ]
        for pair in pairs
    ]
    said = (
        "p: Wilcoxon signed-rank test over paired seeds, two-sided, as it is and after Holm's correction. A: "
        "probability that a run of the first ends lower than one of the second (Vargha-Delaney)."
    )
    page.table(columns, rows, f"{caption} {said}".strip(), words=(1, 8))


def _switches(page: Page, ablation: Ablation) -> None:
    page.heading("What each ingredient does")
    page.items([claims.of_effect(effect) for effect in ablation.effects])
    columns = ["switched on", "factor", "from", "to", "seeds", "shown", "contrasts"]
    groups = (
        (ablation.effects, "Main effects: the factor by which the objective is multiplied; below 1 it is lowered."),
        (ablation.company, "With most other switches on against with fewest: the factor by which the effect changes."),
        (ablation.interactions, "Interactions: the factor by which one switch's effect changes when the other is on."),
    )
    for effects, caption in groups:
        rows = [
            [
                *(" with ".join(e.switches), number(e.factor), number(e.low), number(e.high)),
                *(str(e.seeds), "yes" if e.shown else "no", str(len(e.contrasts))),
            ]
            for e in effects
        ]
        if rows:
            page.table(columns, rows, f"{caption} 95 % bootstrap intervals over seeds.")
    if unknown := claims.of_unknown(ablation):
        page.text(unknown)


def _failures(page: Page, comparison: Comparison) -> None:
    rows = [
        [variant.name, str(run.seed), run.where, run.failure]
        for variant in comparison.variants
        for run in variant.runs
        if not run.finished
    ]
    if rows:
        page.heading(f"Failures: {len(rows)}")
        page.table(["variant", "seed", "job", "because"], rows, words=(2, 3))


def _reading(page: Page, comparison: Comparison) -> None:
    page.heading("How to read this page").items(
        [
            f"Objectives within {comparison.ties:g} of the floor count as equal in the tests: what is left there is "
            "rounding, not quality. The tables show them as they are.",
            "A failed run counts as worse than any other in the tests; its budget counts as spent in the ERT; "
            "quartiles and curves are those of the finished runs.",
            "A target counts as reached at the end of the iteration in which it was, so running times are at most "
            "one iteration too long.",
            "Not significant means that these runs do not show a difference, not that there is none.",
            "Wilcoxon 1945; Holm 1979; Vargha and Delaney 2000; Friedman 1937 and Nemenyi 1963 after Demsar 2006; ERT "
            "after Hansen et al. 2021 (COCO); bootstrap intervals after Efron 1979.",
        ]
    )


def content(comparison: Comparison, source: str) -> dict[str, Any]:
    """What `comparison.json` holds: every number of the page. What is not finite is None."""
    told = {
        "source": source,
        "problem": comparison.gathered.problem,
        "floor": comparison.floor,
        "targets": comparison.targets,
        "ties": comparison.ties,
        "variants": comparison.summaries,
        "pairs": [asdict(pair) | {"significant": pair.significant} for pair in comparison.pairs],
        "ranks": comparison.ranks,
        "ablation": comparison.ablation,
        "sentences": claims.sentences(comparison),
        "notes": comparison.notes,
        "failures": [
            {"variant": variant.name, "seed": run.seed, "job": run.where, "message": run.failure}
            for variant in comparison.variants
            for run in variant.runs
            if not run.finished
        ],
    }
    return files.plain(_as_dicts(told))


def write_json(comparison: Comparison, path: Path, source: str) -> Path:
    """Write `comparison.json`."""
    return files.write_json(path, content(comparison, source))


def _as_dicts(value: Any) -> Any:
    """Data classes within as dictionaries."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, dict):
        return {key: _as_dicts(item) for key, item in value.items()}
    return [_as_dicts(item) for item in value] if isinstance(value, list | tuple) else value
