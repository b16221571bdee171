"""`discrepancy.json`: the investigation for machines, as the design fixes it, and the extended model for Hydra."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tractexp import files
from tractexp.discrepancy.gap import Curves, Gap
from tractexp.discrepancy.investigate import Investigation
from tractexp.discrepancy.judgement import judgements
from tractexp.discrepancy.verdict import NAMED, UNEXPLAINED


def content(investigation: Investigation) -> dict[str, Any]:
    """The content of `discrepancy.json`."""
    window = investigation.bench.records.window
    return {
        "verdict": investigation.verdict.word,
        "reason": investigation.verdict.reason,
        "effects": list(investigation.names),
        "name_sets": [list(names) for names in investigation.verdict.sets],
        "where": [asdict(place) for place in investigation.places],
        "gap": {
            "train": _gap(investigation.train),
            "validate": None if investigation.validate is None else _gap(investigation.validate),
            "fitted_to_both": investigation.fitted_to_both,
        },
        "left": investigation.last.left,
        "nearest": _nearest(investigation),
        "candidates": [*sets(investigation), *_singles(investigation)],
        "recommendation": recommendation(investigation),
        "noise": investigation.last.noise.describe(),
        "phasor_window": None if window is None else window.window,
        "false_alarm_rate": investigation.bench.criteria.false_alarms,
        "parameters": parameters(investigation),
        "simulations": investigation.bench.effort.simulations,
    }


def recommendation(investigation: Investigation) -> str:
    """What to do next, one sentence."""
    if (d := investigation.verdict.next_dip) is not None:
        first, second = (" and ".join(names) for names in investigation.verdict.sets[:2])
        return (
            f"record a dip of {d.depth:.0%} or more lasting {1000 * d.duration:.0f} ms: it tells {first} from {second}"
            f" with a probability of {d.probability:.0%}"
        )
    if investigation.verdict.word == UNEXPLAINED:
        return (
            "look at what is left (unexplained.csv) and at what switched at that time; no effect of the catalogue fits"
        )
    if investigation.verdict.word == NAMED:
        return "use the extended model; judge it on further events as they come"
    return "use the base model; what is missing, if anything, is below the limits given for each effect"


def parameters(investigation: Investigation) -> dict[str, dict[str, float]]:
    """Parameters of the extended model, each with its standard error where the fit gives one."""
    at, unit = investigation.bench.coordinates, investigation.extended.unit
    names = [*(at.names[k] for k in at.base), *_own(investigation)]
    errors = _standard_errors(investigation)
    return {n: {"value": at.value(n, unit), "standard_error": errors.get(n, float("nan"))} for n in names}


def _own(investigation: Investigation) -> list[str]:
    return [p.name for name in investigation.names for p in investigation.catalogue[name].effect.parameters]


def _standard_errors(investigation: Investigation) -> dict[str, float]:
    """From the curvature at the chosen fit; a parameter that rests on its bound has no number."""
    at, tests = investigation.bench.coordinates, investigation.last
    inside = [*at.base, *at.before, *at.parameters(tests.fit.names)]
    columns = inside + [k for name in at.catalogue.of_measurement for k in at.sizes([name])]
    inverse = np.linalg.pinv(tests.projection.R, rcond=1e-10)
    spread = np.sqrt(np.einsum("ij,ij->i", inverse, inverse))
    labels = {k: name for name, k in at.column.items() if k not in tests.tangent.held}
    return {labels[k]: float(s * at.width(labels[k])) for k, s in zip(columns, spread, strict=True) if k in labels}


def _gap(gap: Gap) -> dict[str, Any]:
    return {"before": _curves(gap.before), "after": _curves(gap.after), "closed": _number(gap.closed)}


def _nearest(investigation: Investigation) -> dict[str, Any] | None:
    """The set that comes nearest where nothing explains the disagreement, with the shares it explains."""
    near = investigation.verdict.nearest
    if near is None:
        return None
    others = [{"effects": list(names), "explained": _number(share)} for names, share in near.others]
    return {
        "effects": list(near.names), "explained": _number(near.fitted), "explained_held_out": _number(near.held_out),
        "others": others,
    }  # fmt: skip


def write_left(investigation: Investigation, path: Path) -> Path:
    """Write what the nearest candidates leave, measured less calculated [pu], as CSV: event, t [s], P, Q."""
    drive, nearest = investigation.bench.drive, investigation.verdict.nearest
    near = investigation.train.before.calculated if nearest is None else nearest.calculated
    lines = ["event,t,P,Q"]
    for e, event in enumerate(investigation.bench.events):
        left = drive.measured[:, drive.part(e)] - near[:, drive.part(e)]
        rows = zip(event.record.t, *left, strict=True)
        lines += [f"{event.record.name},{t:.9g},{P:.9g},{Q:.9g}" for t, P, Q in rows]
    return files.write(path, "\n".join(lines) + "\n")


def _curves(curves: Curves) -> dict[str, float]:
    return {
        "epsilon_p": curves.epsilon_p,
        "epsilon_q": curves.epsilon_q,
        "chi2_per_sample": curves.chi2_per_sample,
    }


def sets(investigation: Investigation) -> list[dict[str, Any]]:
    """The refitted sets of the chosen size."""
    rows, at = [], investigation.bench.coordinates
    for rival in investigation.survivors.rivals:
        names = rival.fit.names
        if not names:
            continue
        status = "rejected" if rival.rejected else "adequate" if rival.adequate else "not adequate"
        labels = [p.name for n in names for p in investigation.catalogue[n].effect.parameters]
        values = {n: {"value": at.value(n, rival.fit.unit), "standard_error": None} for n in labels}
        ratio = _number(rival.lowered)
        rows.append({"effects": list(names), "status": status, "likelihood_ratio": ratio, "parameters": values})
    return rows


def _singles(investigation: Investigation) -> list[dict[str, Any]]:
    """Every effect of the catalogue, with its one-step size at the chosen model."""
    rows = []
    for j in judgements(investigation):
        values = {}
        if j.score is not None:
            null = {p.name: p.null for p in investigation.catalogue[j.name].sizes}
            values = {
                n: {"value": null[n] + size, "standard_error": _number(j.score.deviation[n])}
                for n, size in j.score.size.items()
            }
        ratio = None if j.score is None else _number(j.score.drop)
        rows.append(
            {"effects": [j.name], "status": j.status, "why": j.why, "likelihood_ratio": ratio, "parameters": values}
        )
    return rows


def _number(value: float) -> float | None:
    """JSON knows no nan and no infinity."""
    return float(value) if np.isfinite(value) else None


def write_model(investigation: Investigation, node: dict[str, Any], path: Path) -> Path:
    """Write the extended model as a choice of the group `model`, usable at once through `--config-dir`."""
    import yaml

    effects = sorted({*node.get("effects", ()), *investigation.names})
    settings = {part: {k: v for k, v in node[part].items() if k != "name"} for part in ("motor", "static")}
    extended: dict[str, Any] = {
        "defaults": [{"motor": node["motor"]["name"]}, {"static": node["static"]["name"]}, "_self_"],
        "effects": effects,
        "bounds": {n: list(b) for n, b in node["bounds"].items()},
        "fixed": dict(node["fixed"]),
    } | {part: chosen for part, chosen in settings.items() if chosen}
    head = "# The base model and what was found missing: python -m tractexp --config-dir <this conf> model=extended\n"
    return files.write(path, head + yaml.safe_dump(extended, sort_keys=False))
