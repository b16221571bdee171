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


def content(found: Investigation) -> dict[str, Any]:
    """The content of `discrepancy.json`."""
    return {
        "verdict": found.verdict.word,
        "reason": found.verdict.reason,
        "effects": list(found.names),
        "name_sets": [list(names) for names in found.verdict.sets],
        "where": [asdict(place) for place in found.places],
        "gap": {
            "train": _gap(found.train),
            "validate": None if found.validate is None else _gap(found.validate),
            "fitted_to_both": found.fitted_to_both,
        },
        "left": found.last.left,
        "nearest": _nearest(found),
        "candidates": [*sets(found), *_singles(found)],
        "recommendation": recommendation(found),
        "noise": found.last.noise.describe(),
        "phasor_window": None if found.bench.records.window is None else found.bench.records.window.window,
        "false_alarm_rate": found.bench.criteria.false_alarms,
        "parameters": parameters(found),
        "simulations": found.bench.effort.simulations,
    }


def recommendation(found: Investigation) -> str:
    """What to do next, one sentence."""
    if (d := found.verdict.next_dip) is not None:
        first, second = (" and ".join(names) for names in found.verdict.sets[:2])
        return (
            f"record a dip of {d.depth:.0%} or more lasting {1000 * d.duration:.0f} ms: it tells {first} from {second}"
            f" with a probability of {d.probability:.0%}"
        )
    if found.verdict.word == UNEXPLAINED:
        return (
            "look at what is left (unexplained.csv) and at what switched at that time; no effect of the catalogue fits"
        )
    if found.verdict.word == NAMED:
        return "use the extended model; judge it on further events as they come"
    return "use the base model; what is missing, if anything, is below the limits given for each effect"


def parameters(found: Investigation) -> dict[str, dict[str, float]]:
    """Parameters of the extended model, each with its standard error where the fit gives one."""
    at, unit = found.bench.coordinates, found.extended.unit
    names = [*(at.names[k] for k in at.base), *_own(found)]
    errors = _standard_errors(found)
    return {n: {"value": at.value(n, unit), "standard_error": errors.get(n, float("nan"))} for n in names}


def _own(found: Investigation) -> list[str]:
    return [p.name for name in found.names for p in found.catalogue[name].effect.parameters]


def _standard_errors(found: Investigation) -> dict[str, float]:
    """From the curvature at the chosen fit; a parameter that rests on its bound has no number."""
    at, tests = found.bench.coordinates, found.last
    inside = [*at.base, *at.before, *at.parameters(tests.fit.names)]
    columns = inside + [k for name in at.catalogue.of_measurement for k in at.sizes([name])]
    inverse = np.linalg.pinv(tests.projection.R, rcond=1e-10)
    spread = np.sqrt(np.einsum("ij,ij->i", inverse, inverse))
    labels = {k: name for name, k in at.column.items() if k not in tests.tangent.held}
    return {labels[k]: float(s * at.width(labels[k])) for k, s in zip(columns, spread, strict=True) if k in labels}


def _gap(gap: Gap) -> dict[str, Any]:
    return {"before": _curves(gap.before), "after": _curves(gap.after), "closed": _number(gap.closed)}


def _nearest(found: Investigation) -> dict[str, Any] | None:
    """The set that comes nearest where nothing explains the disagreement, with the shares it explains."""
    near = found.verdict.nearest
    if near is None:
        return None
    others = [{"effects": list(names), "explained": _number(share)} for names, share in near.others]
    return {
        "effects": list(near.names), "explained": _number(near.fitted), "explained_held_out": _number(near.held_out),
        "others": others,
    }  # fmt: skip


def write_left(found: Investigation, path: Path) -> Path:
    """Write what the nearest candidates leave, measured less calculated [pu], as CSV: event, t [s], P, Q."""
    drive, nearest = found.bench.drive, found.verdict.nearest
    near = found.train.before.calculated if nearest is None else nearest.calculated
    lines = ["event,t,P,Q"]
    for e, event in enumerate(found.bench.events):
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


def sets(found: Investigation) -> list[dict[str, Any]]:
    """The refitted sets of the chosen size."""
    rows = []
    for rival in found.survivors.rivals:
        names = rival.fit.names
        if not names:
            continue
        status = "rejected" if rival.rejected else "adequate" if rival.adequate else "not adequate"
        labels = [p.name for n in names for p in found.catalogue[n].effect.parameters]
        values = {
            n: {"value": found.bench.coordinates.value(n, rival.fit.unit), "standard_error": None} for n in labels
        }
        ratio = _number(rival.lowered)
        rows.append({"effects": list(names), "status": status, "likelihood_ratio": ratio, "parameters": values})
    return rows


def _singles(found: Investigation) -> list[dict[str, Any]]:
    """Every effect of the catalogue, with its one-step size at the chosen model."""
    rows = []
    for j in judgements(found):
        values = {}
        if j.score is not None:
            null = {p.name: p.null for p in found.catalogue[j.name].sizes}
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


def write(found: Investigation, path: Path) -> Path:
    """Write `discrepancy.json`."""
    return files.write_json(path, content(found))


def write_model(found: Investigation, node: dict[str, Any], path: Path) -> Path:
    """Write the extended model as a choice of the group `model`, usable at once through `--config-dir`."""
    import yaml

    effects = sorted({*node.get("effects", ()), *found.names})
    settings = {part: {k: v for k, v in node[part].items() if k != "name"} for part in ("motor", "static")}
    extended: dict[str, Any] = {
        "defaults": [{"motor": node["motor"]["name"]}, {"static": node["static"]["name"]}, "_self_"],
        "effects": effects,
        "bounds": {n: list(b) for n, b in node["bounds"].items()},
        "fixed": dict(node["fixed"]),
    } | {part: chosen for part, chosen in settings.items() if chosen}
    head = "# The base model and what was found missing: python -m tractexp --config-dir <this conf> model=extended\n"
    return files.write(path, head + yaml.safe_dump(extended, sort_keys=False))
