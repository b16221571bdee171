"""`discrepancy.json`: the investigation for machines, as the design fixes it, and the extended model for Hydra."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.discrepancy.gap import Curves, Gap
from tractexp.discrepancy.investigate import Finding
from tractexp.discrepancy.judgement import judge


def contract(finding: Finding) -> dict[str, Any]:
    """The content of `discrepancy.json`."""
    return {
        "verdict": finding.verdict,
        "reason": finding.reason,
        "effects": list(finding.names),
        "name_sets": [list(names) for names in finding.sets],
        "where": [asdict(place) for place in finding.places],
        "gap": {
            "train": _gap(finding.train),
            "validate": None if finding.validate is None else _gap(finding.validate),
            "fitted_to_both": finding.refitted,
        },
        "left": finding.last.left,
        "nearest": _nearest(finding),
        "candidates": [*sets(finding), *_singles(finding)],
        "recommendation": recommendation(finding),
        "noise": finding.last.noise.describe(),
        "phasor_window": None if finding.study.phasors is None else finding.study.phasors.window,
        "false_alarm_rate": finding.alpha,
        "parameters": parameters(finding),
        "simulations": finding.study.simulations,
    }


def recommendation(finding: Finding) -> str:
    """What to do next, one sentence."""
    if finding.decider is not None:
        d = finding.decider
        first, second = (" and ".join(names) for names in finding.sets[:2])
        return (
            f"record a dip of {d.depth:.0%} or more lasting {1000 * d.duration:.0f} ms: it tells {first} from {second}"
            f" with a probability of {d.probability:.0%}"
        )
    if finding.verdict == "unexplained":
        return (
            "look at what is left (unexplained.csv) and at what switched at that time; no effect of the catalogue fits"
        )
    if finding.verdict == "named":
        return "use the extended model; judge it on further events as they come"
    return "use the base model; what is missing, if anything, is below the limits given for each effect"


def parameters(finding: Finding) -> dict[str, dict[str, float]]:
    """Parameters of the extended model, each with its standard error where the fit gives one."""
    study, unit = finding.study, finding.extended.unit
    names = [*(study.problem.space.names[k] for k in study.base), *_own(finding)]
    errors = _standard_errors(finding)
    return {n: {"value": study.value(n, unit), "standard_error": errors.get(n, float("nan"))} for n in names}


def _own(finding: Finding) -> list[str]:
    return [p.name for name in finding.names for p in finding.catalogue[name].effect.parameters]


def _standard_errors(finding: Finding) -> dict[str, float]:
    """From the curvature at the chosen fit; a parameter that rests on its bound has no number."""
    study, stage = finding.study, finding.last
    inside = [*study.base, *study.before, *study.parameters(stage.fit.names)]
    columns = inside + [k for name in study.catalogue.chain for k in study.sizes([name])]
    inverse = np.linalg.pinv(stage.projection.R, rcond=1e-10)
    spread = np.sqrt(np.einsum("ij,ij->i", inverse, inverse))
    labels = {k: name for name, k in study.column.items() if k not in stage.tangent.held}
    return {labels[k]: float(s * study.width(labels[k])) for k, s in zip(columns, spread, strict=True) if k in labels}


def _gap(gap: Gap) -> dict[str, Any]:
    return {"before": _curves(gap.before), "after": _curves(gap.after), "closed": _number(gap.closed)}


def _nearest(finding: Finding) -> dict[str, Any] | None:
    """The set that comes nearest where nothing explains the disagreement, with the shares it explains."""
    near = finding.nearest
    if near is None:
        return None
    others = [{"effects": list(names), "explained": _number(share)} for names, share in near.others]
    return {
        "effects": list(near.names), "explained": _number(near.fitted), "explained_held_out": _number(near.held_out),
        "others": others,
    }  # fmt: skip


def write_left(finding: Finding, path: Path) -> Path:
    """Write what the nearest candidates leave, measured less calculated [pu], as CSV: event, t [s], P, Q."""
    study = finding.study
    near = finding.train.before.calculated if finding.nearest is None else finding.nearest.calculated
    part = path.with_suffix(".part")
    with part.open("w", encoding="utf-8") as file:
        file.write("event,t,P,Q\n")
        for e, event in enumerate(study.events):
            left = study.problem.drive.measured[:, study.problem.drive.part(e)] - near[:, study.problem.drive.part(e)]
            for t, P, Q in zip(event.record.t, *left, strict=True):
                file.write(f"{event.record.name},{t:.9g},{P:.9g},{Q:.9g}\n")
    return part.replace(path)


def _curves(curves: Curves) -> dict[str, float]:
    return {
        "epsilon_p": curves.epsilon_p,
        "epsilon_q": curves.epsilon_q,
        "chi2_per_sample": curves.chi2_per_sample,
    }


def sets(finding: Finding) -> list[dict[str, Any]]:
    """The refitted sets of the chosen size."""
    rows = []
    for rival in finding.rivals:
        names = rival.fit.names
        if not names:
            continue
        status = "rejected" if rival.rejected else "adequate" if rival.adequate else "not adequate"
        labels = [p.name for n in names for p in finding.catalogue[n].effect.parameters]
        values = {n: {"value": finding.study.value(n, rival.fit.unit), "standard_error": None} for n in labels}
        ratio = _number(rival.lowered)
        rows.append({"effects": list(names), "status": status, "likelihood_ratio": ratio, "parameters": values})
    return rows


def _singles(finding: Finding) -> list[dict[str, Any]]:
    """Every effect of the catalogue, with its one-step size at the chosen model."""
    rows = []
    for j in judge(finding):
        values = {}
        if j.score is not None:
            null = {p.name: p.null for p in finding.catalogue[j.name].sizes}
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


def write(finding: Finding, path: Path) -> Path:
    """Write `discrepancy.json` in one move."""
    part = path.with_suffix(".part")
    clean = json.loads(json.dumps(contract(finding)), parse_constant=lambda _: None)
    part.write_text(json.dumps(clean, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return part.replace(path)


def write_model(finding: Finding, node: dict[str, Any], path: Path) -> Path:
    """Write the extended model as a choice of the group `model`, usable at once through `--config-dir`."""
    import yaml

    effects = sorted({*node.get("effects", ()), *finding.names})
    settings = {part: {k: v for k, v in node[part].items() if k != "name"} for part in ("motor", "static")}
    content: dict[str, Any] = {
        "defaults": [{"motor": node["motor"]["name"]}, {"static": node["static"]["name"]}, "_self_"],
        "effects": effects,
        "bounds": {n: list(b) for n, b in node["bounds"].items()},
        "fixed": dict(node["fixed"]),
    } | {part: chosen for part, chosen in settings.items() if chosen}
    path.parent.mkdir(parents=True, exist_ok=True)
    head = "# The base model and what was found missing: python -m tractexp --config-dir <this conf> model=extended\n"
    path.write_text(head + yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path
