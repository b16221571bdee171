"""What a proposal finds of effects that no catalogue holds: blind cases and nulls, a row each in proposals.json.

    cd benchmarks && python proposals.py [--first 900000] [--count 2] [--docs] [case ...]

Three events are fitted, one is held out, noise is 0.3 %. The term is searched whatever the verdict of the catalogue
would be, so that nulls are searched, too. `--docs` writes the table of docs/missing-effects.md and ends. The hidden
effects are other formulas than the library's terms: admittances, circuits and relays of `hidden_effects`, some of them
declared here. Reported seeds begin at 900000 and are used nowhere else; from 950000 on the search was looked at.
"""

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import marked
import oracle  # noqa: F401

import tractexp  # noqa: F401 before NumPy: it keeps BLAS to one thread
from hidden_effects import EFFECTS, Case, Noise, make
from hidden_effects.devices import Ring, Switched
from hidden_effects.hidden import Hidden, beside
from hidden_effects.laws import KneeSaturation, StaticTrip
from hidden_effects.motor import Motor
from hidden_effects.outside import after
from hidden_effects.site import Site
from hidden_effects.supply import Profile

TABLE, DOCS = Path(__file__).with_suffix(".json"), Path(__file__).parents[1] / "docs" / "missing-effects.md"
MARK = "benchmarks/proposals.py --docs"  # what makes the table there
FIRST, COUNT, NOISE = 900_000, 2, Noise(0.003)


@dataclass(frozen=True)
class RampFromDip(Hidden):
    """Load that grows steadily from the beginning of the dip on; `amount` is its share of the power per second."""

    reference, largest, unit = 0.03, 0.5, "1/s"

    def apply(self, site: Site) -> Site:
        start = site.dip.start
        profile = Profile((start, start + 10.0), (0.0, 10.0))
        return replace(beside(site, Switched(self.amount * site.S, profile)), breaks=(*site.breaks, start))


@dataclass(frozen=True)
class ReactiveRing(Hidden):
    """A mode elsewhere is heard in Q alone, from a time after the voltage returns."""

    reference, largest, unit = 0.015, 0.5, "1"
    frequency: float = 23.0
    decay: float = 0.12
    delay: float = 0.1

    @classmethod
    def details(cls, rng, dips):
        return {"frequency": float(rng.uniform(12.0, 30.0)), "decay": float(rng.uniform(0.1, 0.3))}

    def apply(self, site: Site) -> Site:
        start = after(site, self.delay)
        ring = Ring(1j * self.amount * site.S.real, start, self.frequency, self.decay)
        return replace(beside(site, ring), breaks=(*site.breaks, start))


@dataclass(frozen=True)
class DeepMotor(Motor):
    """A motor whose rotor resistance grows with slip."""

    depth: float = 0.0

    def flow(self, now, V, x):
        if not self.speed:
            return super().flow(now, V, x)
        more = 1 + self.depth * (self.speed - x[1].real)
        made = Motor(**{k: v for k, v in vars(self).items() if k != "depth"})
        return replace(made, machine=replace(self.machine, Rr=more * self.machine.Rr)).flow(now, V, x)


@dataclass(frozen=True)
class DeepBar(Hidden):
    """The rotor's resistance grows with slip, as in a deep bar."""

    reference, largest, unit = 5.0, 60.0, "1"

    def apply(self, site: Site) -> Site:
        return replace(site, motors=tuple(DeepMotor(**vars(m), depth=self.amount) for m in site.motors))


OWN = {
    "static_trip": StaticTrip, "ramp_from_dip": RampFromDip, "reactive_ring": ReactiveRing,
    "knee_saturation": KneeSaturation, "deep_bar": DeepBar,
}  # fmt: skip
# case: how many references are hidden, and the balances and signals that are called right
CASES: dict[str, tuple[float, set[str], set[str]]] = {
    "static_trip": (4.0, {"static", "static_P"}, {"relay"}),
    "ramp_from_dip": (2.0, {"power", "whole"}, {"ramp"}),
    "load_step": (3.0, {"power", "whole"}, {"step"}),
    "reactive_ring": (3.0, {"power_Q", "power"}, {"ring"}),
    "subsynchronous_ring": (3.0, {"power", "power_P"}, {"ring"}),
    "knee_saturation": (2.0, {"magnetizing", "coupling"}, {"field", "field_knee"}),
    "deep_bar": (3.0, {"decay"}, {"slip", "slip_squared"}),
    "stator_resistance": (3.0, {"resistance"}, {"constant"}),
    "speed_dependent_torque": (2.0, {"torque"}, {"slip", "slip_squared"}),
    "null": (0.0, set(), set()),
}


def row(case: str, seed: int) -> dict:
    """One data set, searched."""
    from tractexp.discrepancy.base_fit import base_fit
    from tractexp.discrepancy.catalogue import catalogue
    from tractexp.discrepancy.context import Context
    from tractexp.discrepancy.criteria import Criteria
    from tractexp.discrepancy.disagreement import disagreement
    from tractexp.discrepancy.effort import Effort
    from tractexp.discrepancy.fitting import refit
    from tractexp.discrepancy.proposal.propose import propose, to_dict
    from tractexp.discrepancy.records import Records
    from tractexp.model.model import compose
    from tractexp.plugin import get
    from tractexp.record import Record, detect

    size, balances, signals = CASES[case]
    made = make(Case(None if case == "null" else case, size, events=4, noise=NOISE), seed)
    events = [detect(Record(f"event{k + 1}", **r, source=f"made {k + 1}").check()) for k, r in enumerate(made)]
    begun, train, held = time.perf_counter(), events[:3], events[3:]
    motor, static = get("model/motor", "electromechanical")(), get("model/static", "exponential")()
    missing = catalogue(motor, static, (), train, ["stator_resistance"])
    bench = Context.of(compose(motor, static), missing, Records.of(train), {}, {}, Criteria(), Effort())
    base = base_fit(bench)
    first = disagreement(base, 0)
    bare = refit(bench, first.noise, [((), bench.coordinates.without_faults(first.fit.unit, ()))], faults=())[0]
    found = propose(base, first, bare, first.noise, held, 0)
    content = to_dict(found, "")
    best = found.tried[0][1]
    name = found.proposal.term.name if found.proposal else found.tried[0][0].name
    _, balance, signal = name.split(":")[:3]
    right = {balance in balances, signal in signals} == {True} if case != "null" else found.proposal is None
    return {
        "case": case, "seed": seed, "size": size, "proposed": found.proposal is not None,
        "balance": balance, "signal": signal, "clock": (name.split(":") + [None] * 4)[3],
        "values": {k: v["value"] for k, v in content["terms"][0]["parameters"].items()} if content else None,
        "closed_train": content["closed"]["train"] if content else best.train.closed,
        "closed_validate": content["closed"]["validate"] if content else best.validate.closed,
        "before": best.train.without.chi2_per_sample, "left_train": best.train.left,
        "left_validate": best.validate.left,
        "p": best.p, "ties": [f"{t['balance']}: {t['signal']}" for t in content["ties"]] if content else [],
        "why": found.why, "right": right, "seconds": round(time.perf_counter() - begun, 1),
    }  # fmt: skip


def told_in_docs(rows: list[dict]) -> list[str]:
    """The rows as a table for people; in brackets the best term where none is proposed."""
    columns = "hidden, seed, chi2 per sample before, found, gap closed (fitted / held out), left (same), right"
    lines = [f"| {' | '.join(columns.split(', '))} |", "| " + " | ".join(["---"] * 7) + " |"]
    for r in rows:
        if "failed" in r:
            lines.append(f"| {r['case']} | {r['seed']} | failed: {r['failed']} |  |  |  | no |")
            continue
        name = f"{r['balance']}: {r['signal']}" + (f" {r['clock']}" if r["clock"] else "")
        closed = f"{r['closed_train']:.0%} / {r['closed_validate']:.0%}"
        left = f"{r['left_train']:.2f} / {r['left_validate']:.2f}"
        cells = [r["case"], r["seed"], f"{r['before']:.1f}", name if r["proposed"] else f"none ({name})", closed, left]
        right = ("yes" if r["right"] else "no") if r["proposed"] or r["case"] == "null" else "not proposed"
        lines.append("| " + " | ".join(map(str, [*cells, right])) + " |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=FIRST, help="the first seed, at least 900000")
    parser.add_argument("--count", type=int, default=COUNT, help="data sets of each case")
    parser.add_argument("cases", nargs="*", metavar="case", help=f"of {', '.join(CASES)}; by default all")
    parser.add_argument("--docs", action="store_true", help="write the table of the docs, and nothing else")
    chosen = parser.parse_args()
    if chosen.docs:
        marked.replace(DOCS, MARK, "\n".join(told_in_docs(kept())))
        return
    if chosen.first < FIRST or chosen.count < 1 or set(chosen.cases) - set(CASES):
        parser.error(f"seeds begin at {FIRST}, there is at least one of each case, and cases are {', '.join(CASES)}")
    for seed in range(chosen.first, chosen.first + chosen.count):
        for case in chosen.cases or CASES:
            if any((r["case"], r["seed"]) == (case, seed) for r in kept()):
                continue
            try:
                made = row(case, seed)
            except (ValueError, ArithmeticError) as why:
                made = {"case": case, "seed": seed, "failed": str(why)}
            rows = sorted([*kept(), made], key=lambda r: (list(CASES).index(r["case"]), r["seed"]))
            TABLE.write_text(json.dumps(rows, indent=1) + "\n")
            print({k: v for k, v in made.items() if k not in ("values", "why")}, flush=True)


def kept() -> list[dict]:
    """The rows made before, by this run or another beside it."""
    return json.loads(TABLE.read_text()) if TABLE.exists() else []


EFFECTS.update(OWN)
if __name__ == "__main__":
    main()
