"""What `experiment=ablation` showed, as docs/comparison.md tells it.

tractexp experiment=ablation hydra.sweep.dir=SWEEP
python benchmarks/ablation.py SWEEP    # stores what the page says, and writes docs/comparison.md from it
python benchmarks/ablation.py          # writes docs/comparison.md from what is stored
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import marked

from tractexp import files

ROOT = Path(__file__).resolve().parents[1]
STORED, PAGE, NAME = ROOT / "benchmarks" / "ablation.json", ROOT / "docs" / "comparison.md", "benchmarks/ablation.py"
KEPT = ("terms", "where", "columns", "measure", "figures", "ranks", "ablation", "cost", "share")


def store(sweep: Path) -> None:
    """Keep what a sweep's `comparison.json` says of all problems together."""
    told = json.loads((sweep / "comparison.json").read_text(encoding="utf-8"))
    overall = [{key: part[key] for key in KEPT} for part in told["overall"]]
    job = json.loads((sweep / "0" / "result.json").read_text(encoding="utf-8"))
    kept = {"commit": job["commit"], "sentences": told["sentences"], "overall": overall}
    files.write_json(STORED, kept)


def text(kept: Mapping[str, Any]) -> str:
    """The text of the docs."""
    lines = [f"Measured at commit `{kept['commit'][:7]}`.", ""]
    lines += [f"- {sentence}" for sentence in kept["sentences"]]
    for part in kept["overall"]:
        lines += ["", f"### {part['terms']}: {part['where']}", "", *_effects(part), "", *_ranked(part)]
    return "\n".join(lines)


def _effects(part: Mapping[str, Any]) -> list[str]:
    """A table of the ingredients, one by one and in pairs."""
    what = "distance to the optimum" if part["share"] else "objective"
    lines = [f"| switched on | {what} × | 95 % interval | better in | 95 % interval | simulations per iteration |"]
    lines += ["|---|---:|---|---:|---|---:|"]
    for effect in part["ablation"]["effects"]:
        (name,), (share, low, high) = effect["switches"], effect["better"]
        cost = f"{part['cost'][name]:+.1f}" if name in part["cost"] else ""
        interval = f"{effect['low']:.3g} to {effect['high']:.3g}"
        lines.append(
            f"| `{name}` | {effect['factor']:.3g} | {interval} | {share:.0%} | {low:.0%} to {high:.0%} | {cost} |"
        )
    for effect in part["ablation"]["interactions"]:
        a, b = effect["switches"]
        interval = f"{effect['low']:.3g} to {effect['high']:.3g}"
        lines.append(f"| `{a}` where `{b}` is on, against off | {effect['factor']:.3g} | {interval} | | | |")
    return lines


def _ranked(part: Mapping[str, Any]) -> list[str]:
    """A table of all variants, the best ranked first."""
    ranks = dict(zip(part["ranks"]["names"], part["ranks"]["mean"], strict=True))
    head = ["variant", "mean rank", *part["columns"]]
    lines = [f"| {' | '.join(head)} |", f"|---{'|---:' * (len(head) - 1)}|"]
    tell = (lambda x: f"{x:.0%}") if part["share"] else (lambda x: f"{x:.3g}")
    lines += [
        f"| `{name}` | {ranks[name]:.2f} | {' | '.join(map(tell, values))} |"
        for name, values in part["figures"].items()
    ]
    said = f"{part['measure'].capitalize()}; two mean ranks differ significantly at 5 % when"
    return [*lines, "", f"{said} {part['ranks']['critical_difference']:.2f} or more apart (Nemenyi)."]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("sweep", nargs="?", type=Path, help="folder of the sweep; without it, what is stored")
    given = parser.parse_args()
    if given.sweep is not None:
        store(given.sweep)
    marked.replace(PAGE, NAME, text(json.loads(STORED.read_text(encoding="utf-8"))))


if __name__ == "__main__":
    main()
