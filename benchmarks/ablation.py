"""What `experiment=ablation` showed, as docs/comparison.md tells it.

tractexp experiment=ablation hydra.sweep.dir=SWEEP python benchmarks/ablation.py SWEEP # stores what
the page says, and writes docs/comparison.md from it python benchmarks/ablation.py # writes
docs/comparison.md from what is stored
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import marked

from tractexp.storage import files
from tractexp.studies.comparison.statistics import SIGNIFICANCE_LEVEL

ROOT = Path(__file__).resolve().parents[1]
STORED, PAGE, NAME = (
    ROOT / "benchmarks" / "ablation.json",
    ROOT / "docs" / "comparison.md",
    "benchmarks/ablation.py",
)
FIELDS = ("terms", "where", "columns", "measure", "figures", "ranks", "ablation", "cost", "share")


def store(sweep: Path) -> None:
    """Keep what a sweep's `comparison.json` says of all problems together."""
    comparison = json.loads((sweep / "comparison.json").read_text(encoding="utf-8"))
    overall = [{key: part[key] for key in FIELDS} for part in comparison["overall"]]
    job = json.loads((sweep / "0" / "result.json").read_text(encoding="utf-8"))
    files.write_json(STORED, {"commit": job["commit"], "overall": overall})


def text(stored: Mapping[str, Any]) -> str:
    """The text of the docs: the best variants, the effect of each ingredient, and the mean ranks,
    on each problem.
    """
    parts = stored["overall"]
    lines = [
        f"Measured at commit `{stored['commit'][:7]}`.",
        "",
        *(f"- {_best(part)}" for part in parts),
        f"- {_interactions(parts)}",
    ]
    return "\n".join([*lines, "", *_effects(parts), "", *_ranked(parts)])


def _best(part: Mapping[str, Any]) -> str:
    """Which variant has the best mean rank, and how many do not differ from it significantly."""
    ranks = part["ranks"]
    (rank, name), *others = sorted(zip(ranks["mean"], ranks["names"], strict=True))
    alike = [other for mean, other in others if mean - rank < ranks["critical_difference"]]
    said = (
        f"{part['terms']}, {part['where']}: `{name}` has the best mean rank, {rank:.2f} of"
        f" {len(ranks['names'])}"
    )
    if ranks["p"] >= SIGNIFICANCE_LEVEL:
        return (
            f"{said}, but the variants do not differ significantly (Friedman, p ="
            f" {ranks['p']:.2g})."
        )
    return f"{said}; {len(alike)} others are not significantly different."


def _interactions(parts: Sequence[Mapping[str, Any]]) -> str:
    """Which pairs of ingredients do not act independently."""
    found = [
        f"{' and '.join(effect['switches'])} ({part['terms']})"
        for part in parts
        for effect in part["ablation"]["interactions"]
        if not effect["low"] <= 1 <= effect["high"]
    ]
    return (
        "Interactions of two ingredients whose 95 % interval excludes 1:"
        f" {', '.join(found) or 'none'}."
    )


def _effects(parts: Sequence[Mapping[str, Any]]) -> list[str]:
    """A table of the ingredients: the factor on the objective with its interval, and the share of
    pairs it improves.
    """
    head = [
        "switched on",
        *(part["terms"] + (", BBOB" if part["share"] else "") for part in parts),
        "simulations",
    ]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for k, effect in enumerate(parts[0]["ablation"]["effects"]):
        (name,) = effect["switches"]
        own = [part["ablation"]["effects"][k] for part in parts]
        cells = [
            f"× {e['factor']:.3g} ({e['low']:.3g} to {e['high']:.3g}), {e['better'][0]:.0%}"
            for e in own
        ]
        lines.append(f"| `{name}` | {' | '.join(cells)} | {parts[0]['cost'][name]:+.1f} |")
    return lines


def _ranked(parts: Sequence[Mapping[str, Any]]) -> list[str]:
    """A table of the mean ranks of all variants, the best of the first problem first."""
    ranks = [
        dict(zip(part["ranks"]["names"], part["ranks"]["mean"], strict=True)) for part in parts
    ]
    head = [
        "mean rank of 16",
        *(part["terms"] + (", BBOB" if part["share"] else "") for part in parts),
    ]
    lines = [f"| {' | '.join(head)} |", f"|---{'|---:' * len(parts)}|"]
    lines += [
        f"| `{name}` | {' | '.join(f'{rank[name]:.2f}' for rank in ranks)} |"
        for name in parts[0]["figures"]
    ]
    apart = ", ".join(f"{part['ranks']['critical_difference']:.2f}" for part in parts)
    return [*lines, "", f"Two mean ranks differ significantly at 5 % when {apart} apart (Nemenyi)."]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "sweep", nargs="?", type=Path, help="folder of the sweep; without it, what is stored"
    )
    given = parser.parse_args()
    if given.sweep is not None:
        store(given.sweep)
    marked.replace(PAGE, NAME, text(json.loads(STORED.read_text(encoding="utf-8"))))


if __name__ == "__main__":
    main()
