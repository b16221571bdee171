"""`discrepancy.json`: the investigation for machines, as the design fixes it, and the extended
model for Hydra.
"""

from collections.abc import Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tractexp.configuration.run_command import build_again_command, list_settings_of_all
from tractexp.discrepancy.evidence import SetEvidence
from tractexp.discrepancy.explain import find_status
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.forms import describe_forms, key_forms
from tractexp.discrepancy.gap import Curves
from tractexp.discrepancy.judgement import judge_effects
from tractexp.discrepancy.proposal import generate
from tractexp.discrepancy.proposal.library import find_term
from tractexp.discrepancy.proposal.propose import to_dict as proposal_dict
from tractexp.discrepancy.recommend import recommend_next
from tractexp.domain import DOMAINS
from tractexp.inference.model_error import ModelChange, ModelError, ModelMisfit, format_percent
from tractexp.storage import files
from tractexp.text import quoting
from tractexp.text.wording import join_words

MODEL_FILE = Path("conf", "model", "extended.yaml")  # beside the page


def build_content(investigation: Findings) -> dict[str, Any]:
    """The content of `discrepancy.json`."""
    window = investigation.context.records.window
    return {
        "verdict": investigation.verdict.word,
        "complete": investigation.verdict.complete,
        "reason": investigation.reason,
        "effects": list(dict.fromkeys(investigation.catalogue.textbook(investigation.names))),
        "name_sets": [
            list(investigation.catalogue.textbook(names)) for names in investigation.verdict.sets
        ],
        "classes": [one.to_dict() for one in investigation.effect_classes],
        "forms": key_forms(describe_forms(investigation)),
        "where": [asdict(place) for place in investigation.places],
        "gap": build_gaps(investigation),
        "contributions": [
            {"effects": list(names), "model_error": files.make_plain(error)}
            for names, error in investigation.contributions
        ],
        "left": investigation.last.p_by_test,
        "nearest": _build_nearest(investigation),
        "candidates": [*list_sets(investigation), *_list_singles(investigation)],
        "remainder": _build_remainder(investigation),
        "unrecorded_course": investigation.unrecorded_course or None,
        "proposal": proposal_dict(investigation.proposed, generate.PLUGIN),
        "no_proposal": investigation.proposed.why or None,
        "recommendation": recommend_next(investigation),
        "next_event": None
        if investigation.next_event is None
        else investigation.next_event.to_dict(),
        "base_adequacy": investigation.base_grade.adequacy.to_dict(),
        "adequacy": investigation.final_grade.adequacy.to_dict(),
        "held": investigation.undetermined_values,
        "extended": MODEL_FILE.as_posix() if investigation.names else None,
        "noise": investigation.context.describe(investigation.last.noise),
        "phasor_window": None if window is None else window.window,
        "recorder_window": investigation.window,
        "false_alarm_rate": investigation.context.criteria.false_alarms,
        "parameters": list_parameters(investigation),
        "simulations": investigation.context.effort.simulations,
    }


def list_parameters(investigation: Findings) -> dict[str, dict[str, float]]:
    """Parameters of the graded model, each with its standard error where the fit gives one."""
    return {
        e.parameter.name: {"value": e.value, "standard_error": e.error}
        for e in investigation.graded_parameters
    }


def build_gaps(investigation: Findings) -> dict[str, Any]:
    """How far off the graded models are: the base model before, the one that the investigation ends
    with after.

    chi2 is that of the fits by which effects were ranked; None where there is none of the held-out
    events.
    """
    before, after = (
        investigation.misfits(one) for one in (investigation.base_grade, investigation.final_grade)
    )
    ranked = {"train": investigation.train, "validate": investigation.validate}
    rows: dict[str, Any] = {
        role: was and now and _build_gap(ModelChange(was, now), ranked[role])
        for role, was, now in zip(ranked, before, after, strict=True)
    }
    return {**rows, "fitted_to_both": investigation.fitted_to_both}


def _build_gap(change: ModelChange[Any], ranked: ModelChange[Curves] | None) -> dict[str, Any]:
    """What two models leave, with the deviance of the ranked fits beside it."""
    return {
        "before": _build_misfit(change.before, ranked and ranked.before),
        "after": _build_misfit(change.after, ranked and ranked.after),
        "closed": files.make_plain(change.closed_share),
    }


def _build_misfit(misfit: ModelMisfit, ranked: Curves | None) -> dict[str, Any]:
    """The errors of a model."""
    own = {} if misfit.epsilon_i is None else {"epsilon_i": misfit.epsilon_i}
    errors = {"epsilon_p": misfit.epsilon_p, "epsilon_q": misfit.epsilon_q}
    chi2 = {"chi2_per_sample": ranked and ranked.chi2_per_sample}
    return files.make_plain({"model_error": _build_error(misfit.error)} | errors | own | chi2)


def _build_nearest(investigation: Findings) -> dict[str, Any] | None:
    """The set that comes nearest where nothing explains the disagreement, and what it makes of the
    gap.
    """
    near = investigation.nearest
    if near is None:
        return None
    on = {"train": near.fitted, "validate": near.held_out}
    return {
        "effects": list(near.names),
        "gap": {role: both and _build_gap(both, both) for role, both in on.items()},
        "others": [
            {"effects": list(names), "closed": files.make_plain(share)}
            for names, share in near.others
        ],
        "parameters": {e.parameter.name: e.plain() for e in near.estimates},
    }


def _build_remainder(investigation: Findings) -> dict[str, Any] | None:
    """What is left where it is more than noise: its size, on held-out events where there are any,
    the share of the base model's squared error that it is, how often chance leaves as much, which
    test it surprises most, and shapes.
    """
    if investigation.verdict.complete:
        return None
    near = investigation.nearest
    tests = investigation.tests
    shapes = list(map(asdict, investigation.rest.of_best))
    change = investigation.graded_change
    last = change if near is None else near.held_out or near.fitted
    return {
        "model_error": _build_error(last.after.error),
        "share": files.make_plain(1 - change.closed_share) if investigation.names else None,
        "p": tests.p_left,
        "where": tests.loudest,
        "sentence": investigation.headline,
        "best_term": _build_best_term(investigation),
        "of_names": shapes if investigation.names else [],
        "of_nearest": shapes if near else [],
        "of_base": list(map(asdict, investigation.rest.of_base)),
    }


def _build_best_term(investigation: Findings) -> dict[str, Any] | None:
    """The term of the library that predicts the held-out events best, where it was a rival of
    names.
    """
    best = investigation.evidence.term
    if best is None or best.prediction is None:
        return None
    return {
        "words": find_term(best.names[0]).words,
        "model_error": files.make_plain(best.prediction.error),
    }


def _build_error(error: ModelError) -> dict[str, Any]:
    """A model's error with its interval, and where it stalls."""
    own = {"stalls": error.stalls} if error.stalls else {}
    return files.make_plain({"value": error.value, "interval": error.interval} | own)


def write_left(investigation: Findings, path: Path) -> Path:
    """Write what the best model leaves, measured less calculated [pu], as CSV: event, t [s], each
    channel.
    """
    drive = investigation.context.drive
    nearest = investigation.nearest
    near = (investigation.train.after if nearest is None else nearest.fitted.after).calculated
    lines = [",".join(["event", "t", *drive.names])]
    left = drive.measurements - near
    for event, part in zip(investigation.context.events, drive.parts, strict=True):
        rows = list(zip(event.record.t, *left[:, part], strict=True))[event.first :]
        lines += [
            ",".join([quoting.csv(event.record.name), *(f"{x:.9g}" for x in row)]) for row in rows
        ]
    return files.write(path, "\n".join(lines) + "\n")


def write_plugin(investigation: Findings, path: Path) -> Path:
    """Write the proposed term as an effect that runs."""
    proposal = investigation.proposed.proposal
    assert proposal is not None
    return files.write(path, proposal.source)


def list_sets(investigation: Findings) -> list[dict[str, Any]]:
    """The refitted sets that were compared, with the model's error on held-out events where that
    decided.
    """
    rows = []
    at = investigation.context.coordinates
    for set_evidence in investigation.evidence.rows:
        names = set_evidence.fit.names
        if not names:
            continue
        own = investigation.catalogue.parameters(names)
        values = {
            p.name: {"value": at.value(p.name, set_evidence.fit.unit), "standard_error": None}
            for p in own
        }
        ratio = files.make_plain(set_evidence.lowered)
        status = find_status(
            set_evidence, investigation.verdict, investigation.evidence, investigation.context
        )
        row = {
            "effects": list(names),
            "status": status,
            "likelihood_ratio": ratio,
            "parameters": values,
        }
        predicted = set_evidence.prediction
        error: dict[str, Any] = {}
        if predicted is not None:
            error["model_error"] = predicted.error
            if predicted.stalls:
                error["stalls"] = predicted.stalls
        rows.append(row | files.make_plain(error | {"evidence": _list_evidence(set_evidence)}))
    return rows


def _list_evidence(row: SetEvidence) -> dict[str, Any]:
    """The numbers of a set by which `decide` decides; None where a step did not ask."""
    held_out = None if row.gap is None else {"gain": row.gap.gain, "expected": row.gap.expected}
    of_all = None if row.gap is None else {"p_left": row.p_of_all, "behind": row.behind_of_all}
    fitted = {"behind": row.behind, "p_left": row.p_left}
    return fitted | {"held_out": held_out, "of_all": of_all, "replicated": row.replicated_share}


def _list_singles(investigation: Findings) -> list[dict[str, Any]]:
    """Every effect of the catalogue, with its one-step size at the chosen model."""
    rows = []
    for j in judge_effects(investigation):
        values = {}
        if j.score is not None:
            null = {p.name: p.absent for p in investigation.catalogue[j.name].sizes}
            values = {
                n: {
                    "value": null[n] + size,
                    "standard_error": files.make_plain(j.score.deviation[n]),
                }
                for n, size in j.score.size.items()
            }
        ratio = None if j.score is None else files.make_plain(j.score.drop)
        rows.append(
            {
                "effects": [j.name],
                "status": j.status,
                "why": j.why,
                "likelihood_ratio": ratio,
                "parameters": values,
            }
        )
    return rows


def use_of(domain: str, model: Path | str, *, fit_all: bool, task: Collection[str] = ()) -> str:
    """The command that fits the model of a file to the records of this run; with `fit_all` to the
    dips that it holds out, too. With a `task` it does that instead, by the settings of this run.
    """
    settings = [*task, *DOMAINS[domain].setting.split(), f"model={model}"]
    settings += list_settings_of_all() if fit_all else []
    return build_again_command(*settings, of=("data", "task") if task else ("data",))


def adopt_term(plugin: Path) -> str:
    """The command that makes a package of the plugin of a proposed term."""
    return quoting.shell("tractexp", "new", "effect", generate.NAME, "--from", str(plugin))


def write_model(
    investigation: Findings, node: Mapping[str, Any], path: Path, home: Path | None = None
) -> Path:
    """Write the extended model with all that the investigation took into account, as a file that is
    a model by itself.

    `node` is the base model: parts, bounds, fixed values and what else is not as usual. `home` is
    the path by which its first line names the file, by default where it is written.
    """
    effects = sorted({*node.get("effects", ()), *investigation.names})
    held = investigation.undetermined_values
    window = investigation.window
    extended: dict[str, Any] = {
        "defaults": [
            {"motor": node["motor"]["name"]},
            {"static": node["static"]["name"]},
            "_self_",
        ],
        "effects": effects,
        "bounds": {n: list(b) for n, b in node["bounds"].items()},
        "fixed": {**node["fixed"], **held},
    }
    extended |= _list_part_settings(node)
    extended |= {
        key: node[key] for key in ("integration", "domain", "substeps", "priors") if node.get(key)
    }
    if window is not None:
        extended["window"] = window
    if node.get("physical") is not None:
        extended["physical"] = node["physical"]
    command = use_of(
        investigation.context.load.domain,
        (home or path).absolute(),
        fit_all=investigation.fitted_to_both,
    )
    lines = [command, *_explain_model(investigation, node, held)]
    comments = "".join(f"# {quoting.comment(line)}\n" for line in lines)
    return files.write(path, comments + quoting.yaml(extended))


def _list_part_settings(node: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """{motor and static: their settings}, where they have some beside the name."""
    parts = {
        part: {k: v for k, v in node[part].items() if k != "name"} for part in ("motor", "static")
    }
    return {part: settings for part, settings in parts.items() if settings}


def _explain_model(
    investigation: Findings, node: Mapping[str, Any], held: Mapping[str, float]
) -> list[str]:
    """What the extended model is, and why it holds what it holds, a sentence each."""
    lines = [f"The base model with what was found missing: {join_words(investigation.names)}."]
    if not investigation.verdict.complete:
        left = investigation.select_misfit(investigation.final_grade).error.value
        lines.append(
            f"Something is missing still: it misses {format_percent(left)} of the load's response."
        )
    if (window := investigation.context.records.window) is not None:
        lines.append(f"window: {window.describe()}.")
    elif investigation.context.load.window is not None:
        lines.append("window: as in the base model.")
    if given := [name for name in node["fixed"] if name not in held]:
        lines.append(f"fixed {join_words(given)}: as in the base model.")
    if held:
        lines.append(
            f"fixed {join_words(list(held))}: the events of the investigation cannot tell; leave"
            " out what yours can tell."
        )
    return lines
