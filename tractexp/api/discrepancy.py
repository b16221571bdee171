"""Find where simulation and measurement disagree, name the missing effect, add it, show the gap
shrink.

The investigation itself is `tractexp.discrepancy`; everything this file asks of it stands in
`_steps`, `_estimate_extended_model` and `Investigation.write_results`.
"""

import functools
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.api.arguments import Choice, public
from tractexp.api.compose import LoadModel, model_of
from tractexp.api.identify import Identification
from tractexp.api.job import Job
from tractexp.api.read import dips_together
from tractexp.api.response import Response
from tractexp.api.setup import Given, describe_records
from tractexp.api.task import Task, print_result, print_written
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import get, plugin
from tractexp.configuration.run_command import build_again_command
from tractexp.errors import MODEL, UserError, check_range
from tractexp.identification.adequacy import Grade
from tractexp.identification.result import Result, conclude, refuse_failed
from tractexp.identification.search import History, SearchResult, search
from tractexp.inference.problem import Problem
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.text import quoting
from tractexp.text.progress import Progress, say, tell_stages
from tractexp.text.wording import join_words, shorten, shown_in_words, with_error

NEXT = "next: "

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tractexp.api.given import ModelGiven, Records, Source
    from tractexp.discrepancy.investigate import Findings as Steps
    from tractexp.discrepancy.readings import Reading
    from tractexp.tracking import TrackedRun


@dataclass(frozen=True, eq=False, kw_only=True)
class Question(Given):
    """The records, the model and the settings of an investigation."""

    effects: Sequence[str]  # none: the whole catalogue
    false_alarms: float
    criteria: Mapping[str, float]


@dataclass(frozen=True)
class Misfit:
    """How far a model is from some events: the model's error {value, interval} of the response,
    relative errors of Eq. (20), and chi-squared per sample.

    `epsilon_i` is that of the currents, where those are compared.
    """

    model_error: Mapping[str, Any]
    epsilon_p: float
    epsilon_q: float
    chi2_per_sample: float | None
    epsilon_i: float | None = None


@dataclass(frozen=True)
class Gap:
    """The misfit of the base model and of the extended one; `closed` is the share of the squared
    error that went.
    """

    before: Misfit
    after: Misfit
    closed: float | None


class NoGap:
    """In place of a gap on held-out events where there are none: it is false, and whatever is asked
    of it raises a `UserError` that says why.
    """

    def __bool__(self) -> bool:
        """False: there is no gap."""
        return False

    def __getattr__(self, name: str) -> Any:
        """Raise `UserError` that says how to hold an event out."""
        if name.startswith("__"):
            raise AttributeError(name)
        raise UserError(
            f"no event was held out, so nothing is known of its {name}: give one to"
            " tractexp.investigate(..., validate=...)"
        )

    def __repr__(self) -> str:
        """That no event was held out."""
        return "no event was held out"


@dataclass(frozen=True)
class Gaps:
    """On the fitted and on the held-out events."""

    train: Gap
    validate: Gap | NoGap
    fitted_to_both: bool


@dataclass(frozen=True, eq=False, repr=False)
class Investigation(Written):
    """The effects that a model lacks, how sure that is, and the model with them. `content` is that
    of `discrepancy.json`.
    """

    kind = "investigation"
    page = "discrepancy.html"

    question: Question
    content: Mapping[str, Any]
    result: Result  # the extended model's parameters, as `result.json` holds them
    behind: "Steps | None" = None  # None where it was loaded

    @property
    def verdict(self) -> str:
        """`none`, `candidate`, `named`, `tied` or `unexplained`."""
        return self.content["verdict"]

    @property
    def complete(self) -> bool:
        """Whether nothing but noise is left."""
        return self.content["complete"]

    @property
    def reason(self) -> str:
        """Why, in one sentence."""
        return self.content["reason"]

    @property
    def names(self) -> tuple[str, ...]:
        """The effects added to the model, by the catalogue's names; `forms` says at which place and
        by which law.
        """
        return tuple(self.content["effects"])

    @property
    def forms(self) -> Mapping[str, Mapping[str, Any]]:
        """{name: {place, kind, law, differs, effect, curve}} of each effect added, as
        `discrepancy.json` holds it.
        """
        return self.content["forms"]

    @property
    def members(self) -> tuple[str, ...]:
        """The effects added as `model.effects` takes them: of another law or place, the family's
        member.
        """
        return tuple(form["effect"] for form in self.forms.values())

    @property
    def recommendation(self) -> str:
        """The next step that the evidence asks for, a sentence."""
        return self.content["recommendation"]

    @property
    def where(self) -> Table:
        """The intervals in which the base model disagrees with the records, the loudest first."""
        places = self.content["where"]
        return Table(
            [*places[0]] if places else [],
            [[*place.values()] for place in places],
            "where they disagree",
        )

    @property
    def candidates(self) -> Table:
        """Every set of effects that was fitted and every single one that was tested, with what
        became of it.
        """
        rows = [
            [" and ".join(c["effects"]), c["status"], c["likelihood_ratio"]]
            for c in self.content["candidates"]
        ]
        return Table(["effects", "status", "deviance lowered by"], rows, "candidates")

    @property
    def remainder(self) -> Table:
        """Where nothing explains the disagreement: the shapes in what the base model leaves, the
        loudest first.
        """
        entry = self.content["remainder"]
        shapes = entry["of_base"] if entry else []
        columns = [*shapes[0]] if shapes else []
        rows = [[shape[key] for key in columns] for shape in shapes]
        return Table(columns, rows, "what is left", entry["sentence"] if entry else "")

    @property
    def readings(self) -> "list[Reading]":
        """Physical causes that the shapes which are left may have, each with what would decide it;
        [] where nothing is left.
        """
        from tractexp.discrepancy.readings import read_shapes
        from tractexp.discrepancy.remainder import Remainder

        entry = self.content["remainder"] or {}
        of_each = (entry.get(key) for key in ("of_names", "of_nearest", "of_base"))
        shapes = [Remainder(**shape) for shape in next(filter(None, of_each), [])]
        return read_shapes(shapes, self.question.train[0])

    @property
    def proposal(self) -> Mapping[str, Any] | None:
        """The term proposed for an unexplained disagreement, as `discrepancy.json` has it; None
        where there is none.
        """
        return self.content["proposal"]

    @property
    def proposal_sentences(self) -> list[str]:
        """The proposal as sentences; why there is none where nothing explains."""
        from tractexp.discrepancy.proposal.wording import proposed_in_words

        return proposed_in_words(self.proposal, self.content["no_proposal"])

    @property
    def sizes(self) -> list[str]:
        """How large the effects named are, with standard errors, as text: their parameters that
        have a null.
        """
        return self._sizes(self.members, self.content["parameters"])

    @property
    def sizes_of_nearest(self) -> list[str]:
        """The sizes of the candidates that come nearest where nothing explains the disagreement."""
        near = self.content["nearest"]
        return self._sizes(near["effects"], near["parameters"]) if near else []

    @staticmethod
    def _sizes(effects: Sequence[str], parameters: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """The sizes of effects, each with its standard error and unit."""
        own = [
            p for name in effects for p in get("effect", name)().parameters if p.null is not None
        ]
        return [_size(p.name, parameters[p.name], p.unit) for p in own]

    @property
    def sets(self) -> list[Mapping[str, Any]]:
        """The sets of effects that were refitted: `effects`, `status`, `likelihood_ratio`,
        `parameters`.
        """
        # single tests say why
        return [row for row in self.content["candidates"] if "why" not in row]

    @property
    def gap(self) -> Gaps:
        """How far off the model is before and after."""

        def gap(entry: Mapping[str, Any]) -> Gap:
            return Gap(Misfit(**entry["before"]), Misfit(**entry["after"]), entry["closed"])

        entry = self.content["gap"]
        held = gap(entry["validate"]) if entry["validate"] else NoGap()
        return Gaps(gap(entry["train"]), held, entry["fitted_to_both"])

    @functools.cached_property
    def extended_model(self) -> LoadModel:
        """The model with the effects named: a model again, for any call. Raises `UserError` where
        none was named.
        """
        model = self.question.model
        if not self.names:
            raise UserError(
                f"there is no extended model: the verdict is '{self.verdict}', and nothing was"
                " added; go on with the base model (.question.model), or give records that show"
                " more"
            )
        # the latter of earlier versions
        window = self.content.get("recorder_window", self.content["phasor_window"])
        return model.with_(
            effects=sorted({*model.effects, *self.members}),
            fixed=self.content["held"],
            window=window,
        )

    extended = property(operator.attrgetter("extended_model"))  # its name in version 0.2

    @functools.cached_property
    def fit(self) -> Identification:
        """The extended model with the parameters that the investigation found; it predicts,
        simulates and exports.

        The base model where no effect was named.
        """
        errors = {name: at["standard_error"] for name, at in self.content["parameters"].items()}
        return Identification(replace(self.result, standard_errors=errors))

    def predict(
        self,
        event: "Source | None" = None,
        *,
        t: "ArrayLike | None" = None,
        U: "ArrayLike | None" = None,
        f: "ArrayLike | None" = None,
        P0: float | None = None,
        Q0: float | None = None,
    ) -> Response:
        """The response of the model of `fit` to an event or a voltage: see
        `Identification.predict`.
        """
        return self.fit.predict(event, t=t, U=U, f=f, P0=P0, Q0=Q0)

    @functools.cached_property
    def steps(self) -> "Steps":
        """The chain of results, from the records to the verdict; of a loaded result it is
        investigated again.
        """
        return self.behind or _steps(self.question, False)

    def table(self) -> Table:
        """How far off the models are, on the fitted and on the held-out events."""
        from tractexp.report import discrepancy

        return discrepancy.gap(self.content)

    def summary(self) -> Report:
        """The verdict with its reason, the gap and the parameters."""
        from tractexp.report import discrepancy

        return discrepancy.summary(self)

    def screen(self) -> Report:
        from tractexp.report import discrepancy_screen

        return discrepancy_screen.screen(self)

    def report(self) -> Report:
        """The page: events before and after, where they disagree, candidates, what changed."""
        from tractexp.report import discrepancy

        return discrepancy.report(self.steps, self.content, self.result.identities)

    def write_results(self, folder: Path, home: Path | None = None) -> list[Path]:
        """discrepancy.json and result.json; `home` is the folder that the files will be in, by
        default `folder`.

        conf/model/extended.yaml where an effect was named, unexplained.csv where nothing explains,
        and the plugin of a term where one is proposed.
        """
        from tractexp.discrepancy import discrepancy_json
        from tractexp.discrepancy.discrepancy_json import MODEL_FILE

        model = self.question.model
        known = {
            # what machines are it is held to again by whoever reads it
            "bounds": {name: b for name, b in model.bounds.items() if name not in model.held},
            "fixed": model.fixed,
            "substeps": model.substeps,
            "priors": model.priors,
            "physical": model.physical,
        }
        base = {**model.node, **known}
        paths = [
            files.write_json(folder / "discrepancy.json", self.content),
            self.result.write(folder / "result.json"),
        ]
        if self.names:
            paths.append(
                discrepancy_json.write_model(
                    self.steps, base, folder / MODEL_FILE, (home or folder) / MODEL_FILE
                )
            )
        if not self.complete:
            paths.append(discrepancy_json.write_left(self.steps, folder / "unexplained.csv"))
        if self.content["proposal"]:
            paths.append(
                discrepancy_json.write_plugin(
                    self.steps, folder / self.content["proposal"]["plugin"]
                )
            )
        return paths


def _size(name: str, at: Mapping[str, Any], unit: str) -> str:
    """ "k_f = 0.12 ± 0.01"."""
    error = float("nan") if at["standard_error"] is None else at["standard_error"]
    return f"{name} = {with_error(at['value'], error)}{'' if unit == '1' else f' {unit}'}"


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
    base = model_of(model, domain).with_(bounds=bounds, fixed=fixed, substeps=substeps)
    if base.per_event:
        raise UserError(
            f"{MODEL.per_event}={list(base.per_event)} has no meaning in an investigation; leave it"
            " out"
        )
    train, held = dips_together(records, validate)
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
    return _build_investigation(question, _steps(question, progress))


def _steps(question: Question, progress: Progress) -> "Steps":
    """The investigation itself, step by step."""
    from tractexp.discrepancy.investigate import investigate as findings_of
    from tractexp.inference.criteria import Criteria

    q, base = question, question.model
    with tell_stages(progress) as tell:
        if base.shown:
            tell(shown_in_words(base.shown))
        return findings_of(
            base.model,
            q.train,
            q.validate,
            base.bounds,
            base.fixed,
            only=q.effects,
            substeps=base.substeps,
            criteria=Criteria.from_choices({"false_alarms": q.false_alarms, **q.criteria}),
            priors=base.priors,
            shown=tuple(base.shown),
            search=functools.partial(_search_end, q.seed),
            seed=q.seed,
            tell=tell,
        )


def _search_end(seed: int, problem: Problem) -> np.ndarray:
    """The free values (d,) at which the search of an identification ends that is asked for nothing
    unusual.
    """
    end = search(problem, Choice.from_argument("optimizer", None).build("optimizer"), seed)
    refuse_failed(problem, end)
    return end.values


def _build_investigation(question: Question, steps: "Steps") -> Investigation:
    """The result of an investigation, with the content of `discrepancy.json` and `result.json`."""
    from tractexp.discrepancy.discrepancy_json import content

    return Investigation(
        question, files.plain(content(steps)), _estimate_extended_model(question, steps), steps
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


def _next_commands(result: Investigation, paths: Mapping[str, Path]) -> list[str]:
    """The commands that go on from the files of an investigation, {name: path}, each with what it
    does.

    What is missing still is looked for in the domain that tells more, where there is one.
    """
    from tractexp.discrepancy.discrepancy_json import (
        MODEL_FILE,
        PLUGIN,
        adopt_term,
        use_of,
    )

    lines, domain = [], result.question.model.domain
    grade, fit_all = result.content["adequacy"]["grade"], result.gap.fitted_to_both
    context = result.steps.context
    better = next(filter(None, map(context.domain.better, context.events)), "")
    if model := paths.get(MODEL_FILE.name):
        use = use_of(domain, model, fit_all=fit_all)
        which = f", which has {join_words(result.names)}" if result.verdict == "tied" else ""
        if grade == Grade.WRONG_MODEL:
            lines.append(f"see the extended model, which does not describe this load: {use}")
        else:
            lines.append(f"use the extended model{which}: {use}")
        if grade != Grade.ADEQUATE and not better:
            again = use_of(domain, model, fit_all=fit_all, task=["task=discrepancy"])
            lines.append(f"investigate it as the base model: {again}")
    if grade != Grade.ADEQUATE and better:
        in_waves = build_again_command("task=discrepancy", "domain=waves", of=("data", "task"))
        lines.append(f"{NEXT}{better}: {in_waves}")
    if term := paths.get(PLUGIN):
        lines.append(f"use the proposed term: {adopt_term(term)}")
    return lines


def choose_next(lines: Sequence[str], result: Investigation) -> str:
    """The one sentence that a screen has room for: of another domain, else the first command, else
    what would decide about what is left, else the recommendation.
    """
    urgent = [line.removeprefix(NEXT) for line in lines if line.startswith(NEXT)]
    open_ones = result.readings if result.verdict == "unexplained" else []
    deciding = [f"{shorten(one.sentence)}: {one.command}" for one in open_ones]
    return next(iter([*urgent, *lines, *deciding, result.recommendation]))


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
        lines = _next_commands(result, paths)
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
