"""Before the recording: which dips tell what, how deep one must be, and which events of an archive
to fit.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.api.arguments import public
from tractexp.api.identification import Identification
from tractexp.api.job import Job
from tractexp.api.next_event import Recommended, recommend_event
from tractexp.api.setup import Setup
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import plugin
from tractexp.configuration.run_command import suggest_run
from tractexp.errors import MODEL, TASK, UserError, check_range, name_setting
from tractexp.identification import plan as planning
from tractexp.identification.adequacy import Grade
from tractexp.identification.fit import play
from tractexp.identification.plan import ChosenEvent, DipShape
from tractexp.identification.result import Result, load
from tractexp.inference.model_error import ModelError, compute_model_error, format_percent
from tractexp.noise import Noise
from tractexp.outcome import Written
from tractexp.record import Event
from tractexp.report import plan as shown
from tractexp.report.plan import DEPTH, DURATION, JUMP, RATE, UNBALANCE, Planned, explain_rest
from tractexp.storage import files
from tractexp.text.progress import Progress

if TYPE_CHECKING:
    from tractexp.api.given import ModelGiven, Records

DURATIONS = (0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8)  # s
GRIDS = {  # of what only some domains' dips have: degrees, negative sequence over the depth
    "jump": (JUMP, (0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0)),
    "unbalance": (UNBALANCE, (0.0, 0.25, 0.5, 0.75, 1.0)),
}
NOISES = (0.001, 0.002, 0.005, 0.01, 0.02)  # of P before the event
FIT, DEFAULT = "fit", "default"


@dataclass(frozen=True, eq=False, repr=False)
class Forecasts(Written):
    """A plan: what dips of other depths, lengths, rates and noises would tell. `content` is that of
    `plan.json`.
    """

    kind = "plan"
    page = "plan.html"

    setup: Setup
    asked: Mapping[str, Any]  # parameter, within, what was given of the dip, values, least, events
    content: Mapping[str, Any]
    behind: "Planned | None" = None  # None where it was loaded

    @functools.cached_property
    def forecast(self) -> Planned:
        """The planned events behind the page; of a loaded result they are computed again."""
        return self.behind or _forecast_plan(self.setup, **self.asked)

    @property
    def depth_needed(self) -> float | None:
        """Depth from which a dip gives what was asked for; None where no dip does."""
        return self.content["depth_needed"]

    @property
    def best_events(self) -> list[str]:
        """Names of the events that tell most together, the best first; none of a single event."""
        return [event["name"] for event in self.content["best_events"]]

    def table(self) -> Table:
        """Half of the 95 % interval over the value, by depth."""
        return shown.scan(self.content, DEPTH)

    def summary(self) -> Report:
        """How deep a dip is needed, and the intervals."""
        return shown.build_summary(self.content)

    def screen(self) -> Report:
        """The answer on one screen of a terminal."""
        return shown.build_screen(self.content)

    @property
    def next_step(self) -> str:
        """The command that shows what the dips at hand tell, whatever is recorded next."""
        return f"until then, what these dips tell: {suggest_run('task=profile')}"

    def report(self) -> Report:
        """The page: each interval against depth, duration, rate and noise."""
        return shown.report(self.forecast, self.content)


@public
def plan(
    records: "Records",
    model: "ModelGiven | None" = None,
    *,
    parameter: str = "H",  # how deep a dip is needed for this one (H stands for M)
    within: float = 0.05,  # half of the 95 % interval, as a share of the value
    depth: float | None = None,  # of the voltage before; null: as recorded
    duration: float | None = None,  # s
    rate: float | None = None,  # Hz
    noise: float | None = None,  # standard deviation, as a share of P before the event; white
    jump: float | None = None,  # degrees, of the voltage's phase; in waveforms
    # negative sequence over the depth, 1 of a fault between two phases; in waveforms
    unbalance: float | None = None,
    domain: str | None = None,
    # fit, default, or the path of a result.json
    values: "str | Path | Identification | Mapping[str, float]" = FIT,
    least: float = 0.05,  # another event of the archive must narrow the intervals by this share
    events: int | None = None,  # at most so many
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    substeps: int | None = None,
    # [a,b+c], or a discrepancy.json: what to record to tell these apart
    rivals: "str | Sequence[str | Sequence[str]]" = (),
    progress: Progress = None,
) -> Forecasts | Recommended:
    """Forecast the intervals that a recording would give, without fitting it; or what tells
    `rivals` apart.

    How deep must a dip be for `parameter` (H stands for M) to be known with half of its 95 %
    interval `within` a share of the value? The dip is that of the deepest of `records`, unless
    settings of it are given. Of several records those that tell most together are chosen. With
    `rivals` nothing of this is asked: the event is chosen that most surely leaves one of them.

    Parameters
    ----------
    records : events, or whatever `tractexp.read` reads
    model, bounds, fixed, substeps : as in `tractexp.identify`
    parameter : name
        How deep a dip is needed for this one.
    within : float
        Half of the 95 % interval, as a share of the value.
    depth : float, 0 to 1
        Of the voltage before; None: as recorded, and so the next ones.
    duration : float [s]
        Of the dip.
    rate : float [1/s]
        Samples per second.
    noise : float
        Standard deviation as a share of P before the event, white; in waves that of the sampled
        currents.
    jump : float [degrees]
        Of the voltage's phase in the dip, with `domain` "waves".
    unbalance : float
        Negative sequence over the depth, with `domain` "waves" (0: balanced, 1: a fault between two
        phases).
    domain : "phasors" or "waves"
        None: that of `conf/config.yaml`.
    values : "fit", "default", Identification or path
        What is planned at: the estimate of that record, the model's defaults, an identification, or
        a `result.json`.
    least : float
        Another event of an archive must narrow the intervals by this share.
    events : int
        At most so many are chosen.
    rivals : names, or path
        Effects that the model may lack (`["a", "b"]`, `"b+c"` two at once), or a `discrepancy.json`
        that ended tied.
    progress : None, False or callable
        As in `tractexp.investigate`.

    Returns
    -------
    Forecasts or Recommended
        `depth_needed`, None where no dip will do, `forecast` of each parameter and `best_events`;
        with `rivals` the `sentence` that says what to record, and its `probability`.

    Raises
    ------
    UserError
        For wrong names or values, and for a model with `per_event`.
    """
    rivals = rivals if isinstance(rivals, str) else [*rivals]
    if not rivals:
        check_range("task.within", within, 1e-6, 10.0)
        check_range("task.least", least, 0.0, 1.0)
        check_range("task.events", events, 1)
        check_range("task.noise", noise, 1e-9, 1.0)
    setup = Setup.from_arguments(
        records, model, bounds=bounds, fixed=fixed, substeps=substeps, domain=domain
    )
    if rivals:
        return recommend_event(setup, rivals, progress)
    error = 0.0
    if isinstance(values, Identification):
        error = _find_missed_share(values.result)
        values = values.result.on_base_of(setup.train[0].record)
    asked = {
        "parameter": parameter,
        "within": within,
        "depth": depth,
        "duration": duration,
        "rate": rate,
        "noise": noise,
        "jump": jump,
        "unbalance": unbalance,
        "values": values,
        "least": least,
        "events": events,
        "error": error,
    }
    planned = _forecast_plan(setup, **asked)
    return Forecasts(setup, asked, files.make_plain(_build_content(planned)), planned)


def _forecast_plan(
    setup: Setup,
    parameter: str,
    within: float,
    values: Any,
    least: float,
    events: int | None,
    error: float = 0.0,
    **given: Any,
) -> Planned:
    """Everything forecast: how deep, over what, and the best events."""
    problem, recorded = setup.problem, setup.train
    planning.find_column(problem.space.names, parameter)
    if problem.per_event:
        raise UserError(
            f"{name_setting('task=plan')} plans for shared parameters;"
            f" leave {MODEL.per_event} empty"
        )
    for name in GRIDS:
        if given[name] is not None and name not in problem.domain.shaped_by:
            where = f"{name_setting(f'task.{name}')}={given[name]:g}"
            raise UserError(f"{where} is of waveforms: add domain=waves, or leave it out")
    deepest = max(problem.events, key=lambda e: e.depth)
    at, origin, noise, missed = _guess(setup, deepest, values)
    shape = replace(_choose_shape(deepest, seen=noise, **given), error=missed or error)
    shape.check()
    scans = _scan_properties(problem, at, shape)
    needed = planning.find_depth_needed(scans[DEPTH][1], parameter, within)
    best = planning.choose_best_events(problem, at, least, events) if len(recorded) > 1 else []
    return Planned(problem, at, origin, _describe_shape(shape), needed, scans, best, least, events)


def select_events(setup: Setup, values: Any, most: int) -> list[ChosenEvent]:
    """The events of a setup that tell most about its model together, at most `most`; `values` are
    those of `plan`.

    Events before which the model has no steady state at these values are left out. Raises
    `UserError` where that are all of them.
    """
    if setup.problem_of(setup.train[:1]).per_event:
        raise UserError(f"events are chosen for shared parameters; leave {MODEL.per_event} empty")
    at, *_ = _guess(setup, max(setup.train, key=lambda e: e.depth), values)
    informations, refused = {}, ""
    for event in setup.train:
        try:
            informations[event.record.name] = planning.compute_own_information(
                setup.problem_of([event]), at
            )
        except UserError as error:
            refused = str(error)
    if not informations:
        raise UserError(refused)
    return planning.choose_best([*informations.values()], [*informations], 0.0, most)


def _choose_shape(
    event: Event, noise: float | None, seen: Noise | None = None, **given: float | None
) -> DipShape:
    """The dip to plan for: the recorded one, with the noise `seen` in its fit, and what is given
    replaced.
    """
    shape = replace(
        DipShape.from_event(event, seen),
        **{key: value for key, value in given.items() if value is not None},
    )  # type: ignore[arg-type]
    if noise is not None:
        shape = replace(
            shape, noise_P=noise * abs(event.P0), noise_Q=noise * abs(event.P0), memory=0.0
        )
    return shape


def _guess(setup: Setup, event: Event, values: Any) -> tuple[np.ndarray, str, Noise | None, float]:
    """Free values (d,) to plan at, where they are from, the noise that the fit showed, and what it
    missed of the response beyond that.
    """
    problem = setup.problem_of([event])
    if values == FIT:
        from tractexp.identification.estimate import estimate_without_search

        fit = estimate_without_search(problem)
        origin = f"the estimate of {event.record.name}"
        if not fit.surprise.adequate:
            origin += ", though more than noise is left there, which the forecast counts as noise"
        at, noise = fit.uncertainty.values, fit.uncertainty.likelihood.noise.select_event(0)
        missed = 0.0 if fit.surprise.adequate else compute_model_error(play(problem, at)).value
        return at, origin, noise, missed
    if values == DEFAULT:
        defaults = [p.default for p in problem.parameters if p.name in problem.space.names]
        return np.array(defaults), "the model's default values", None, 0.0
    given = isinstance(values, Mapping)
    result = None if given else load(Path(values))
    by_parameter = values if result is None else result.on_base_of(setup.train[0].record)
    if missing := [name for name in problem.space.names if name not in by_parameter]:
        raise UserError(
            f"{TASK.values}={values}: that result has no {', '.join(missing)}; it is of another"
            " model"
        )
    origin = f"the values of {'an identification' if given else values}"
    missed = 0.0 if result is None else _find_missed_share(result)
    return np.array([by_parameter[n] for n in problem.space.names]), origin, None, missed


def _find_missed_share(result: Result) -> float:
    """The share of a response that an identified model misses beyond the noise, on average; 0 where
    noise alone leaves as much.
    """
    told = result.model_error
    if not told or result.adequacy.get("grade") == Grade.ADEQUATE:
        return 0.0
    return ModelError.from_content(told.get("held_out") or told).value


def _scan_properties(problem: Any, values: np.ndarray, shape: DipShape) -> dict[str, Any]:
    """{label: (x, forecasts)}: one property of the dip varied at a time."""

    def scan_shapes(key: str, grid: tuple[float, ...]) -> Any:
        shapes = [replace(shape, **{key: x}) for x in grid]
        return grid, [planning.forecast_intervals(problem, values, s) for s in shapes]

    by_depth = planning.forecast_over_depth(problem, values, shape)
    P = abs(shape.P0)
    loud = [replace(shape, noise_P=x * P, noise_Q=x * P) for x in NOISES]
    scans = {
        DEPTH: (tuple(f.shape.depth for f in by_depth), by_depth),
        DURATION: scan_shapes("duration", DURATIONS),
    }
    scans |= {GRIDS[name][0]: scan_shapes(name, GRIDS[name][1]) for name in shape.domain.shaped_by}
    scans[RATE] = scan_shapes("rate", shape.domain.rates(shape.frequency))
    return scans | {
        shape.domain.planned_noise: (
            NOISES,
            [planning.forecast_intervals(problem, values, s) for s in loud],
        )
    }


def _describe_shape(shape: DipShape) -> str:
    """The sentence that tells what was planned: depth, duration and rate of the dip, the noise of
    its channels and within which time that is forgotten, and the error of the model.
    """
    memory = f"forgotten within {1000 * shape.memory:.0f} ms" if shape.memory > 0 else "white"
    first, second = (
        f"{100 * level / abs(shape.P0):.2g} %" for level in (shape.noise_P, shape.noise_Q)
    )
    names = shape.domain.channels
    dip = (
        f"a dip of {100 * shape.depth:.0f} % for {1000 * shape.duration:.0f} ms at {shape.rate:.0f}"
        " Hz"
    )
    dip += shape.domain.describe_shape(shape)
    if shape.error:
        memory += f", and a model that misses {format_percent(shape.error)} of its response"
    return f"planned: {dip}, noise {first} in {names[0]} and {second} in {names[1]}, of P, {memory}"


def _build_content(planned: Planned) -> dict[str, Any]:
    """The content of `plan.json`; half intervals are shares of the value, null where there
    is none.
    """
    names = planned.problem.space.names
    return {
        "dip": planned.dip,
        "origin": planned.origin,
        "answer": str(planned.needed),
        "depth_needed": planned.needed.depth,
        "parameters": dict(zip(names, planned.values, strict=True)),
        "half_intervals": {
            label: [
                {"at": float(x), **dict(zip(names, f.relative, strict=True))}
                for x, f in zip(grid, forecasts, strict=True)
            ]
            for label, (grid, forecasts) in planned.scans.items()
        },
        "best_events": [
            {"name": c.name, "gain": c.gain, "half": dict(zip(names, c.half, strict=True))}
            for c in planned.chosen
        ],
        "other_events": explain_rest(planned),
    }


@plugin
class Plan(Task, call=plan):
    """Forecast the intervals that a recording would give, without fitting it: plan.html and
    plan.json.

    The dip is that of the deepest record in `data`, or as set here. The parameters and the noise
    are those of the estimate that identify makes of it, or the model's defaults, or those of an
    earlier result.json.
    """

    def collect_log(self, job: Job, result: Forecasts | Recommended) -> dict[str, Any]:
        """The depth needed, or the probability that rivals part, for MLflow."""
        if isinstance(result, Recommended):
            name = f"plan to tell {len(result.rivals)} explanations apart"
            return {"name": name, "metrics": {"probability": result.probability}}
        metrics = {} if result.depth_needed is None else {"depth_needed": result.depth_needed}
        values = dict(result.content["parameters"])
        parameter = result.asked["parameter"]
        return {"name": f"plan for {parameter}", "values": values, "metrics": metrics}
