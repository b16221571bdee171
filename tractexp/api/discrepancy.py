"""Find where simulation and measurement disagree, name the missing effect, add it, show the gap
shrink.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.api.arguments import public
from tractexp.api.compose import resolve_model
from tractexp.api.investigation import Investigation
from tractexp.api.job import Job
from tractexp.api.next_commands import NEXT, choose_next, list_next_commands
from tractexp.api.question import Question
from tractexp.api.read import read_dips_together
from tractexp.api.setup import describe_records
from tractexp.api.task import Task, print_result, print_written
from tractexp.configuration.plugin import plugin
from tractexp.errors import MODEL, UserError, check_range
from tractexp.identification.conclude import conclude
from tractexp.identification.result import Result
from tractexp.identification.search import History, SearchResult
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.text import quoting
from tractexp.text.progress import Progress, say

if TYPE_CHECKING:
    from tractexp.api.given import ModelGiven, Records
    from tractexp.discrepancy.findings import Findings as Steps
    from tractexp.tracking import TrackedRun


@public
def investigate(
    records: "Records",
    model: "ModelGiven | None" = None,
    *,
    validate: "Records" = (),
    effects: Sequence[str] = (),  # only these effects are tested; empty: the whole catalogue
    false_alarms: float = 0.05,  # probability of naming anything where nothing is missing
    # {name: value} of other thresholds of its decisions
    criteria: Mapping[str, float] | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    substeps: int | None = None,
    domain: str | None = None,
    seed: int = 0,
    progress: Progress = None,
) -> Investigation:
    """Find what a load model lacks: where it disagrees with the records, which effect explains
    that, and how sure.

    Nothing is searched, so that there is no objective, optimizer or budget.

    Parameters
    ----------
    records : events, or whatever `tractexp.read` reads
        The dips to fit, all together.
    model : as in `tractexp.identify`
        The base model.
    validate : as `records`
        Dips on which is judged what is found.
    effects : names
        Only these are tested; none: all there are.
    false_alarms : float, 0.001 to 0.5
        The probability of naming anything where nothing is missing.
    criteria : {name: value}
        The other thresholds of the decisions, listed in `tractexp.inference.criteria`.
    bounds, fixed, substeps, domain : as in `tractexp.identify`
        Of the base model; with "waves" the sampled currents are investigated.
    seed : int
        The same seed gives the same bits.
    progress : None, False or callable
        None shows the stage, False does not; a callable is told each stage.

    Returns
    -------
    Investigation
        `verdict` (`none`, `candidate`, `named`, `tied` or `unexplained`), `names` of the effects
        added, `reason`, `gap` before and after, tables `where` and `candidates`, `extended_model`
        and `fit`.

    Raises
    ------
    UserError
        For wrong names or values, for events that do not belong together, and for a model with
        `per_event`: the events share its parameters.
    """
    from tractexp.inference.criteria import Criteria

    check_range("seed", seed, 0)
    thresholds = Criteria.from_choices({"false_alarms": false_alarms, **(criteria or {})})
    base = resolve_model(model, domain).with_(bounds=bounds, fixed=fixed, substeps=substeps)
    if base.per_event:
        raise UserError(
            f"{MODEL.per_event}={list(base.per_event)} has no meaning in an investigation; leave it"
            " out"
        )
    train, held = read_dips_together(records, validate)
    base = base.fit_for(train)
    question = Question(
        train=train,
        validate=held,
        model=base,
        seed=seed,
        effects=tuple(effects),
        false_alarms=thresholds.false_alarms,
        criteria=dict(criteria or {}),
    )
    return _build_investigation(question, question.find_steps(progress))


def _build_investigation(question: Question, steps: "Steps") -> Investigation:
    """The result of an investigation, with the content of `discrepancy.json` and `result.json`."""
    from tractexp.discrepancy.discrepancy_json import build_content

    return Investigation(
        question,
        files.make_plain(build_content(steps)),
        _estimate_extended_model(question, steps),
        steps,
    )


def _estimate_extended_model(question: Question, steps: "Steps") -> Result:
    """The graded model's parameters as a result, which predicts and is logged as a model."""
    base, graded, effort = question.model, steps.final_grade, steps.context.effort
    values, problem = graded.values, graded.problem
    model = base.with_(effects=sorted({*base.effects, *steps.names}), window=problem.model.window)
    objective = float(problem.objective(values[None])[0])
    history = History(
        np.array([effort.simulations]), np.array([objective]), values[None], np.zeros(1)
    )
    status = f"ended with the verdict {steps.verdict.word}"
    end = SearchResult(values, objective, effort.simulations, 0, 0, 0.0, status, history)
    result = conclude(problem, end, values, graded.fits, question.seed, model.node, "descent")
    return replace(
        result,
        adequacy=graded.adequacy.to_dict(),
        next_dip=graded.next_dip,
        shown_effects=dict(base.shown),
        race=[*base.race],
    )


@plugin
class Discrepancy(Task, call=investigate):
    """Name the effect that a model lacks, and show the gap shrink on held-out dips

    Writes

        discrepancy.html         every event, measured and calculated before and after, where they
                                 disagree, candidates by evidence, the equations that changed
        discrepancy.json         the same for machines
        result.json              parameters of the extended model, or of the base model where
                                 nothing is added
        conf/model/extended.yaml the extended model with the recorder's window, where a set is
                                 kept; its first line is the command that uses it
        unexplained.csv          the residual, where more than noise is left
        proposed_effect.py       a proposed term as an effect that runs

    Keys of `discrepancy.json`: `verdict`, `complete` (nothing but noise is left) and `reason`;
    `effects` that were added, all `name_sets` that were not rejected, and `forms` {name: {`place`,
    `kind`, `law`, `differs`, `effect` (for `model.effects`), `curve` (with its 95 % band beside the
    catalogue's)}}; `where` [{`event`, `channel`, `start`, `end`, `share`}]; `gap` {`train`,
    `validate`: {`before`, `after`, `closed`}}; `candidates` [{`effects`, `status`,
    `likelihood_ratio`, `parameters`, `evidence`, which is what the decision reads}];
    `contributions`, what each name is good for; `remainder`, the loudest shapes of what is left
    (ringing, decay, step, pulse), and `left`, p of each test of it; `next_event` {`sentence`,
    `rivals`, `model_error`, `recommended`, `indistinguishable`, `no_event_separates`, `tried`};
    `unrecorded_course`, of an input that nobody recorded, where it explains what no effect does;
    `adequacy`, the grade.

    `proposal` is null, and `no_proposal` says why, or it holds `terms` [{`balance`, `signal`,
    `clock`, `words`, `latex`, `function_of_voltage`, `parameters`}], `explained` and `left`
    {`train`, `validate`}, `p`, `when`, `ties`, `alike` (textbook effects that could make most of
    the same change) and `plugin`.
    """

    resumes = True
    instead = {"model.per_event": "its parameters are shared by all events, so leave it out"}

    def perform(self, job: Job, **instead: Any) -> Investigation:
        """Investigate the run's events, and print each stage."""
        train, held = job.events_of_fit
        for line in describe_records(train, held, "hold out"):
            job.tell_beside(line)
        return super().perform(job, records=train, validate=held, progress=None, **instead)

    def conclude(self, job: Job, result: Written) -> None:
        """The page's path and the command that uses the extended model end what is printed."""
        assert isinstance(result, Investigation)
        results = job.write(
            functools.partial(result.write_results, home=job.folder),
            lambda paths: self.track(job, result, paths),
        )
        paths = {path.name: path for path in (*results, *result.write_drawings(job.folder))}
        print_result(job, result)
        lines = list_next_commands(result, paths)
        if not job.tells_everything:
            lines = [f"{NEXT}{choose_next(lines, result)}"]
        print_written(paths.values(), result.page)
        for line in lines:
            say(line)
        self.log(job, result, [*paths.values()])

    def track(self, job: Job, result: Any, paths: list[Path]) -> "TrackedRun | None":
        """The folder of the extended model is one artifact."""
        conf = job.folder / "conf"
        artifacts = [path for path in paths if conf not in path.parents]
        if len(artifacts) < len(paths):
            artifacts.append(conf)
        return super().track(job, result, artifacts)

    def collect_log(self, job: Job, result: Investigation) -> dict[str, Any]:
        """Verdict, gap and page, and below this run one for every set of effects that
        was refitted.
        """
        from tractexp import tracking
        from tractexp.api.logged import measure_model

        of_model = measure_model(result.fit)
        metrics = dict(of_model)
        for role in ("train", "validate"):
            if not (gap := getattr(result.gap, role)):
                continue
            for stage in ("before", "after"):
                misfit = vars(getattr(gap, stage))
                off = misfit | {"model_error": misfit["model_error"]["value"]}
                metrics |= {
                    f"{role}_{stage}_{key}": value
                    for key, value in off.items()
                    if value is not None
                }
            if gap.closed is not None:
                metrics[f"{role}_gap_closed"] = gap.closed
        children = [
            tracking.TrackedRun(
                experiment=job.experiment,
                name=" and ".join(row["effects"]),
                metrics={"deviance_lowered_by": row["likelihood_ratio"] or 0.0}
                | {name: at["value"] for name, at in row["parameters"].items()},
                tags={"candidate": row["status"], "task": "discrepancy"},
            )
            for row in result.sets
        ]
        return {
            "name": f"{result.verdict} {' '.join(result.names)}".strip(),
            "tags": {"verdict": result.verdict, "grade": result.fit.grade},
            "metrics": metrics,
            "children": children,
            "description": quoting.markdown(result.reason),
            "model": job.folder / "result.json",
            "model_metrics": [*of_model],
            "records": result.result.records,
        }
