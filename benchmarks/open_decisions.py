"""What exact scales change: the data sets of a judgement set on which a test was open, investigated again.

    python open_decisions.py [--docs]            (from the folder benchmarks)

Data set by data set as in judgement_members.jsonl, whose seeds were drawn before this was thought of; open is a data
set on which p of what a fit leaves was within a factor of `MISSED` of the one that decides. All others are decided as
they were: their draws are the same. Rows are appended to open_decisions.jsonl, so that it can be stopped and taken up;
`--docs` writes the table into docs/earlier-judgements.md.
"""

import argparse
import itertools
import json
from collections import Counter
from pathlib import Path

import hidden_effects_evidence as evidence
import hidden_effects_study as study
import marked
import oracle  # noqa: F401
from joblib import Parallel, delayed

from hidden_effects import cases
from tractexp import files
from tractexp.discrepancy.criteria import Criteria
from tractexp.discrepancy.disagreement import MISSED

OUT, DOCS = Path(__file__).with_suffix(".jsonl"), study.ROOT / "docs" / evidence.EARLIER
MARK = "benchmarks/open_decisions.py --docs"  # what makes the table there
MOST = 40  # data sets of a row that a judgement set may have


def is_open(row: dict) -> bool:
    """Whether a test of this data set was so near its limit that exact scales may turn it."""
    level = Criteria().adequate_p
    tested = [*row.get("left", []), row.get("left_of_all")]
    return any(p is not None and level / MISSED < p < level * MISSED for p in tested)


def key(row: dict) -> tuple:
    """What tells one data set from another."""
    return row["group"], row["label"], row["seed"]


def judged(row: dict) -> str:
    """How a verdict stands to the truth."""
    known = row["truth"] and not row["group"].startswith("outside ")
    if row["verdict"] in ("none", "unexplained"):
        return f"`{row['verdict']}`"
    if not known:
        return "a name or tie where there is none in the catalogue"
    if row["verdict"] == "tied":
        return "a tie with the truth" if row["truth"] in row["sets"] else "a tie without it"
    return "the right name" if row["names"] == row["truth"] else "a wrong name"


def stored() -> dict[tuple, dict]:
    """The open data sets as they were decided."""
    return {key(row): row for row in evidence.read(study.SETS["with more members"]) if is_open(row)}


def table(before: dict[tuple, dict], after: list[dict]) -> str:
    """How often what was said became what, Markdown."""
    turned = Counter((judged(before[key(row)]), judged(row)) for row in after)
    lines = [
        f"| {was} | {is_} | {n} |" for (was, is_), n in sorted(turned.items(), key=lambda item: (-item[1], item[0]))
    ]
    return "\n".join(
        [f"{len(after)} data sets.", "", "| before | with exact scales | data sets |", "|---|---|---|", *lines]
    )


def main() -> None:
    """Investigate what is missing; write the table where it is asked for."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--docs", action="store_true", help="write the table into the docs and stop")
    asked.add_argument("--jobs", type=int, default=2)
    chosen = asked.parse_args()
    before = stored()
    rows = evidence.read(OUT) if OUT.exists() else []
    if chosen.docs:
        marked.replace(DOCS, MARK, table(before, rows))
        return
    (frozen,) = {r["frozen"] for r in before.values()}
    (total,) = {r["events"] for r in before.values()}
    missing = set(before) - {key(r) for r in rows}
    drawn = study.planned(study.SUITES, MOST, int(frozen[:12], 16), cases.MULTIPLES, total)
    wanted = ((group, trial) for group, trial in drawn if (group, trial.label, trial.seed) in missing)
    jobs = list(itertools.islice(wanted, len(missing)))
    if left := len(missing) - len(jobs):
        raise SystemExit(f"{left} of {len(missing)} data sets are not among the first {MOST} of their rows")
    held = before[next(iter(before))]["held"]
    with OUT.open("a", encoding="utf-8") as file:
        calls = (delayed(study.run)(group, trial, total, held) for group, trial in jobs)
        for row in Parallel(n_jobs=chosen.jobs, return_as="generator_unordered", pre_dispatch=4)(calls):
            file.write(json.dumps(files.plain(row)) + "\n")
            file.flush()
            was = before[key(row)]
            print(*key(row), f"{judged(was)} -> {judged(row)} ({row['seconds']:.1f} s)", flush=True)


if __name__ == "__main__":
    main()
