"""Identify a load model's parameters from recorded dips, and what such an identification says."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from tractexp.api.arguments import Choice, public
from tractexp.api.compose import LoadModel
from tractexp.api.job import Job
from tractexp.api.read import dips_of
from tractexp.api.response import Response, respond_to
from tractexp.api.setup import Setup
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.configuration.choices import set_holding
from tractexp.configuration.plugin import plugin
from tractexp.configuration.run_command import build_folder_command, suggest_run
from tractexp.errors import TASK, Stopped, UserError, among
from tractexp.identification.adequacy import Adequacy, Grade
from tractexp.identification.result import Result, by_event, conclude, play, refuse_failed
from tractexp.identification.search import REFUSED, History, SearchResult
from tractexp.inference.model_error import ModelError
from tractexp.outcome import Drawing, Written
from tractexp.record import OwnBase
from tractexp.text.progress import Progress, counter, tell
from tractexp.text.wording import epsilon, join_words

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike

    from tractexp.api.given import Chosen, ModelGiven, Records, Source
    from tractexp.exchange.operating_point import OperatingPoint
    from tractexp.identification.agreement import EventAgreement
    from tractexp.identification.estimate import EstimationResult
    from tractexp.identification.result import Fit
    from tractexp.identification.uncertainty import Uncertainty
    from tractexp.record import Event

FIXED = "fixed"
SHEET = "sheet.html"
SHEET_DOCUMENT = "sheet.docx"
USABLE, DOUBTFUL, UNUSABLE = "usable", "doubtful", "unusable"
USABILITY: dict[str, str] = {
    Grade.ADEQUATE: USABLE,
    Grade.EFFECT_MISSING: DOUBTFUL,
    Grade.WRONG_MODEL: UNUSABLE,
}
# Hz: how far the frequency of a network strays around a fault, where nobody recorded it
FREQUENCY_SWING = 0.2
LEAST_TOLD_MOVE = 2.0  # standard errors from which a rival structure's move is told


@dataclass(frozen=True, eq=False, kw_only=True)
class FitSpec(Setup):
    """The records, the model and the settings of an identification."""

    optimizer: Choice
    check_intervals: bool = True
    frequency_swing: float = FREQUENCY_SWING

    def search_end(self, progress: Progress) -> SearchResult:
        """Where the search ends; raises `UserError` where the input is wrong, before anything is
        told.
        """
        tell(progress, [*self.lines(), f"optimizer: {self.optimizer.name}, seed {self.seed}"])
        return self.search(self.optimizer, self.seed, progress)

    def so_far(self, end: SearchResult | None) -> "Identification | None":
        """Where a search was when it was stopped, as an identification that nothing
        is judged of.
        """
        if end is None or not end.objective < REFUSED:
            return None
        fits = play(self.problem, end.values, self.validate)
        result = conclude(
            self.problem, end, end.values, fits, self.seed, self.model.node, self.optimizer.name
        )
        return Identification(result, self, end)


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value and how sure it is. Interval (95 %) and standard error are None
    where there is none.

    `search` is where the optimizer itself ended.
    """

    name: str
    value: float
    search: float
    unit: str
    interval: tuple[float, float] | None
    standard_error: float | None
    verdict: str
    bounds: tuple[float, float]
    about: str

    def times(self, factor: float) -> "Estimate":
        """The estimate in a unit of which one is a `factor`-th of its own."""
        low, high = self.bounds
        return replace(
            self,
            value=factor * self.value,
            search=factor * self.search,
            bounds=(factor * low, factor * high),
            interval=self.interval and (factor * self.interval[0], factor * self.interval[1]),
            standard_error=None if self.standard_error is None else factor * self.standard_error,
        )

    def __repr__(self) -> str:
        """ "M = 0.01 pu s2/rad, 95 % interval 0.009 .. 0.011: identified"."""
        span = (
            f", 95 % interval {self.interval[0]:.4g} .. {self.interval[1]:.4g}"
            if self.interval
            else ""
        )
        return f"{self.name} = {self.value:.5g} {self.unit}{span}: {self.verdict}"


class Estimates(dict[str, Estimate]):
    """Estimates by name, printed one a line."""

    def __repr__(self) -> str:
        """A line for each parameter."""
        return "\n".join(map(repr, self.values()))

    def __missing__(self, name: str) -> Estimate:
        """Raise KeyError with the nearest name."""
        raise KeyError(f"no parameter is called {name}{among(name, self, 'Parameters')}")

    def to_frame(self) -> "pandas.DataFrame":
        """A pandas frame of numbers with a row for each estimate: parameter, value, unit, the ends
        `lower` and `upper` of the 95 % interval and the standard error (nan where there is none),
        search (where the optimizer ended), verdict.
        """
        import pandas

        rows = [
            {
                "parameter": e.name,
                "value": e.value,
                "unit": e.unit,
                "lower": e.interval[0] if e.interval else np.nan,
                "upper": e.interval[1] if e.interval else np.nan,
                "standard_error": np.nan if e.standard_error is None else e.standard_error,
                "search": e.search,
                "verdict": e.verdict,
            }
            for e in self.values()
        ]
        return pandas.DataFrame(rows)


class FitDetails(NamedTuple):
    """Fits, estimate and uncertainty behind a result: heavy, and computed again from a
    loaded one.
    """

    fits: "list[Fit]"
    estimation: "EstimationResult"
    uncertainty: "Uncertainty"  # with the intervals that profiles gave
    agreement: "EventAgreement | None"
    adequacy: Adequacy


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Written):
    """Identified parameters, how sure they are, and how well they fit. `result` is the content of
    `result.json`.
    """

    kind = "identification"
    page = "report.html"

    result: Result
    setup: FitSpec | None = None  # None where only a result.json is known
    end: "SearchResult | None" = None
    behind: "FitDetails | None" = None  # None where it was loaded

    @classmethod
    def from_search(
        cls, setup: FitSpec, end: SearchResult, progress: Progress = False
    ) -> "Identification":
        """Judge what a search found."""
        result, details = _conclude_identification(setup, end, progress)
        return cls(result, setup, end, details)

    @functools.cached_property
    def details(self) -> FitDetails:
        """Fits, estimate and uncertainty behind the result: computed again where this was
        loaded.
        """
        return self.behind or _conclude_identification(self.spec, self.search_result)[1]

    @property
    def spec(self) -> FitSpec:
        """The call. Raises `UserError` where only a `result.json` was read."""
        if self.setup is None:
            raise UserError(
                "a result.json holds no records, so that this can predict but not be judged again;"
                " call tractexp.identify and save() its result"
            )
        return self.setup

    @property
    def search_result(self) -> SearchResult:
        """Where the search ended."""
        _ = self.spec
        assert self.end is not None
        return self.end

    @functools.cached_property
    def model(self) -> LoadModel:
        """The model that was fitted."""
        return LoadModel(**self.result.model) if self.setup is None else self.setup.model

    @functools.cached_property
    def parameters(self) -> Estimates:
        """The estimates by name; a parameter with a value of its own in each event is there as
        T_m[1], T_m[2], too.
        """
        r, about = self.result, {p.name: p.about for p in self.model.model.parameters}
        values, ended, estimates = by_event(r.parameters, r.per_event), r.search, Estimates()
        search = by_event(ended["parameters"], ended["per_event"]) if ended else values
        for name, value in values.items():
            of, interval = name.partition("[")[0], r.intervals.get(name)
            without = "mean of its events" if name in r.per_event else FIXED if r.verdicts else ""
            verdict = r.verdicts.get(name, without)
            bounds = tuple(r.bounds.get(of, (float("nan"),) * 2))
            estimates[name] = Estimate(
                name,
                value,
                search[name],
                r.units.get(of, ""),
                tuple(interval) if interval else None,  # type: ignore[arg-type]
                r.standard_errors.get(name),
                verdict,
                bounds,  # type: ignore[arg-type]
                about.get(of, ""),
            )
        return estimates

    @functools.cached_property
    def on_given_base(self) -> Estimates:
        """The estimates on the base of the record's file: those of `parameters` where that is the
        record's own.
        """
        ratio, exponents = (
            self.result.base.ratio,
            {p.name: p.power_exponent for p in self.model.model.parameters},
        )
        return Estimates(
            {
                name: e.times(ratio ** exponents[name.partition("[")[0]])
                for name, e in self.parameters.items()
            }
        )

    @property
    def grade(self) -> str:
        """`adequate`, `effect_missing` or `wrong_model`; "" where it was not judged."""
        return self.result.adequacy.get("grade", "")

    @property
    def headline(self) -> str:
        """The grade in words, and what speaks against it, one sentence."""
        sentence = self.result.adequacy.get("sentence", "")
        doubt = self.operating_point.doubt if self.operating_point else ""
        told = [sentence, self.result.next_dip.get("sentence", ""), doubt]
        return "; ".join(filter(None, told)) if sentence else ""

    @functools.cached_property
    def operating_point(self) -> "OperatingPoint | None":
        """How the load divides before the dip, and the motor as a machine; None where the model has
        no motor.
        """
        from tractexp.exchange.operating_point import OperatingPoint

        return OperatingPoint.from_result(self.result)

    @property
    def doubts(self) -> list[str]:
        """The reasons why this model is no physical load, a clause each."""
        from tractexp.exchange.operating_point import doubts

        return doubts(self.result, self.operating_point)

    @property
    def usability(self) -> str:
        """`usable`, `doubtful` or `unusable`, by the grade and by what speaks against it as a load;
        "" where it was not judged.
        """
        if not self.grade:
            return ""
        return UNUSABLE if self.doubts else USABILITY.get(self.grade, "")

    @property
    def usability_reason(self) -> str:
        """Why it is so: what speaks against it as a load first, then what it is good for."""
        headline = self.headline
        return "; ".join(filter(None, [*(d for d in self.doubts if d not in headline), headline]))

    @property
    def own_parameters(self) -> list[Estimate]:
        """The estimates but for those of what the records show beside the load."""
        return [e for e in self.parameters.values() if e.name not in self.result.nuisances]

    @property
    def next_steps(self) -> list[str]:
        """Commands and advice that lead on, the most pressing first: a model that is usable is
        handed on.
        """
        from tractexp.exchange.format import choose_format

        if self.usability != USABLE or not (name := choose_format(self.result)):
            return self.advice
        command = build_folder_command("task=export", f"task.format={name}")
        return (
            [f"hand in {SHEET}, and export it: {command}", *self.advice] if command else self.advice
        )

    @property
    def adequate(self) -> bool:
        """Whether nothing but noise is left of the fitted dips."""
        return self.grade == "adequate"

    @functools.cached_property
    def model_error(self) -> ModelError:
        """The part of the fitted dips' response that the model misses, beyond the noise: rms over
        that of the response, with its 95 % interval.
        """
        return self._error(self.result.model_error)

    @functools.cached_property
    def model_error_held_out(self) -> ModelError | None:
        """The model error on the held-out dips; None where there are none."""
        held_out = self.result.model_error.get("held_out")
        return held_out and self._error(held_out)

    @staticmethod
    def _error(content: Mapping[str, Any]) -> ModelError:
        """The model's error as a result stores it. Raises `UserError` for one of an earlier
        version.
        """
        if not content:
            raise UserError(
                "this result.json has no model_error: it is of an earlier version; identify again"
            )
        return ModelError.from_content(content)

    @property
    def yardstick(self) -> str:
        """How many times what the best linear network leaves this model does, in a sentence; ""
        where not judged.
        """
        return self.result.linear_network.get("sentence", "")

    @property
    def advice(self) -> list[str]:
        """The advice to the user, the most pressing first; [] where the fit was not judged."""
        return self.result.advice

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
        """P and Q [pu] (N,) that the identified load draws in an event, or from a voltage, on the
        base of its file.

        `event` is one that `tractexp.read` gave (or what it reads, holding one dip): its voltage,
        and the power before it. Otherwise `U` [pu] at uniform times `t` [s], (N,) each, with `f`
        [Hz] where known; `P0` and `Q0` are by default those of the event identified on. `band` of
        the response is half of what P and Q [pu] stay within in 95 % of events. Raises `UserError`
        where the load has no steady state there.
        """
        if (event is None) == (t is None or U is None):
            raise UserError("predict() needs either an event, or both t= and U=")
        if event is not None:
            (one,) = dips_of("event", event, least=1)[:1]
            return self._predict_event(one)
        P, Q = self.result.predict(t, U, f, P0, Q0)
        band = self.result.find_band(t, U, f, P0, Q0)
        t, U = np.asarray(t, dtype=float), np.asarray(U, dtype=float)
        return Response("prediction", t, U, P, Q, band=band)

    def _predict_event(self, event: "Event") -> Response:
        from tractexp.identification.forecast import Forecast
        from tractexp.identification.result import respond

        model, base = self.model.model, self.result.base
        values = np.array([self.result.parameters[name] for name in model.names])
        response = respond_to(model, values, event, base)
        forecast = Forecast.from_content(self.result.next_dip, model.names, values)
        if forecast is None:
            return response
        own = base.convert_event(event)
        fit = respond(model, values, own, "validate")
        seen = fit.event

        def calculate(values: np.ndarray) -> np.ndarray:
            moved = respond(model, values, own, "validate")
            return np.stack([moved.P, moved.Q])

        drawn = complex(seen.P0, seen.Q0)
        half = forecast.find_half_width(calculate, drawn, seen.record.t, seen.start, seen.f0)
        P, Q = (OwnBase.from_record(event.record).ratio * half).tolist()
        return replace(response, band=(P, Q))

    def table(self) -> Table:
        """Estimates with intervals and verdicts, the search's end only where it lies outside."""
        from tractexp.report.fit_tables import parameters

        return parameters(self)

    def to_frame(self) -> "pandas.DataFrame":
        """The estimates as a pandas frame of numbers: `Estimates.to_frame`."""
        return self.parameters.to_frame()

    def summary(self) -> Report:
        """Estimate, intervals and grade."""
        from tractexp.report.fit_summary import summary

        return summary(self)

    def screen(self) -> Report:
        """The answer on one screen of a terminal."""
        from tractexp.report import screen

        return screen.screen(self)

    def _repr_html_(self) -> str:
        """The HTML for a notebook: the answer, and the first event beside it; the answer alone of
        one that was loaded, whose curves would have to be computed first.
        """
        from tractexp.report import glance

        return glance.show_beside(self.screen(), self.behind and self.behind.fits[0])

    def report(self) -> Report:
        """The page: measured and calculated power, the residual, parameters, how far to trust
        them.
        """
        from tractexp.report import identify

        return identify.report(self)

    def sheet(self) -> Report:
        """The sheet to be handed in, for print: see `tractexp.report.sheet`."""
        from tractexp.report import sheet

        return sheet.sheet(self)

    def drawings(self) -> Mapping[str, Drawing]:
        return {**super().drawings(), SHEET: lambda path: self.sheet().save(path)}

    @property
    def moves(self) -> dict[str, tuple[str, float]]:
        """By parameter the rival structure that moves it most, and by more than it scatters; and
        the value there.
        """
        far = {}
        for rival in self.result.rival_structures:
            for e in (self.parameters[name] for name in rival["parameters"]):
                value, before = rival["parameters"][e.name], far.get(e.name, ("", e.value))[1]
                if abs(value - e.value) > max(
                    LEAST_TOLD_MOVE * (e.standard_error or 0.0), abs(before - e.value)
                ):
                    far[e.name] = rival["name"], value
        return far

    @property
    def structures(self) -> list[str]:
        """A sentence on each rival structure: the parameters that it moves most, and to where."""
        by_name: dict[str, list[str]] = {}
        for name, (structure, value) in sorted(self.moves.items()):
            by_name.setdefault(structure, []).append(f"{name} {value:.4g}")
        return [
            f"with {name}, which fits as well: {', '.join(values)}"
            for name, values in by_name.items()
        ]

    @property
    def outside_interval(self) -> list[str]:
        """Parameters whose interval does not hold the value that the search ended at."""
        return [
            e.name
            for e in self.parameters.values()
            if e.interval and not e.interval[0] <= e.search <= e.interval[1]
        ]

    @property
    def end_of_search(self) -> str:
        """Where the optimizer itself ended, in one line; "" where that is not known."""
        if not (s := self.result.search):
            return ""
        end = (
            f"search: {self.result.optimizer} {s['status']}: objective {s['objective']:.4g} pu²"
            " (the estimate's is"
        )
        errors = ", ".join(f"{name} {epsilon(s[name])}" for name in ("epsilon_p", "epsilon_q"))
        end += f" {self.result.objective:.4g}), {errors},"
        return (
            f"{end} {s['simulations']} simulations in {s['seconds']:.2f} s{self._search_difference}"
        )

    @property
    def _search_difference(self) -> str:
        """Where the search's end differs from the estimate, as the end of a sentence; "" where it
        does not.
        """
        if not (away := self.outside_interval):
            return ""
        ratio = (
            self.result.search["objective"] / self.result.objective
            if self.result.objective
            else float("inf")
        )
        why = (
            f"it stopped short of the minimum, at {ratio:.3g} times its objective"
            if ratio > 1
            else "it is elsewhere"
        )
        lie = "lies" if len(away) == 1 else "lie"
        return f"; its {join_words(away)} {lie} outside the estimate's interval: {why}"

    def to_dict(self) -> dict[str, Any]:
        """Call, result and search as plain data."""
        end = None if self.end is None else asdict(self.end)
        return {
            "setup": self.setup and self.setup.to_dict(),
            "result": asdict(self.result),
            "found": end,
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The identification that `to_dict` gave."""
        setup, end = content["setup"], content["found"]
        if end is not None:
            history = History(
                **{key: np.array(v, dtype=float) for key, v in end["history"].items()}
            )
            end = SearchResult(
                **end | {"values": np.array(end["values"], dtype=float), "history": history}
            )
        return cls(
            Result.from_content(content["result"], "the saved result"),
            setup and FitSpec.from_dict(setup),
            end,
        )

    def write_results(self, folder: Path) -> list[Path]:
        """Write `result.json` and `history.csv`."""
        from tractexp.identification.result import write_history

        return [
            self.result.write(folder / "result.json"),
            write_history(folder / "history.csv", self.search_result.history),
        ]


@public
def identify(
    records: "Records",
    model: "ModelGiven | None" = None,
    *,
    validate: "Records" = (),
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    per_event: Sequence[str] | None = None,
    substeps: int | None = None,
    domain: str | None = None,
    priors: bool | None = None,
    physical: bool | None = None,
    objective: "Chosen | None" = None,
    optimizer: "Chosen | None" = None,
    budget: int | None = None,
    time_limit: float | None = None,
    target: float | None = None,
    seed: int = 0,
    check_intervals: bool = True,
    frequency_swing: float = FREQUENCY_SWING,
    progress: Progress = None,
) -> Identification:
    """Fit the free parameters of a load model to recorded dips, and judge the fit on these and on
    others held out.

    Parameters
    ----------
    records : events, or whatever `tractexp.read` reads
        The dips to fit, all together.
    model : name, path, LoadModel or None
        A choice of `conf/model`, the path of such a YAML file, or what `tractexp.compose` or an
        investigation (`found.extended_model`) made; None: that of `conf/config.yaml`.
    validate : as `records`
        Dips that are only judged.
    bounds : {name: (lower, upper)}
        In the parameter's own unit, in place of those declared.
    fixed : {name: value}
        Parameters that are not searched.
    per_event : names
        Parameters with a value of their own in each event.
    substeps : int
        Runge-Kutta steps per sample; None: as many as needed.
    domain : "phasors" or "waves"
        With "waves" the records' sampled currents are fitted, not the power that phasors show.
    priors : bool
        Whether a motor is held to what machines usually are where more than noise is left.
    physical : bool
        Whether a motor is kept within what machines are; None: of records in kV and MW.
    objective, optimizer : name, mapping or None
        `{"name": "pso", "population": 100}` has settings; None: those of `conf/config.yaml`.
    budget : int
        The search ends after so many simulations,
    time_limit : float [s]
        after so long,
    target : float [pu²]
        at this objective, or by itself.
    seed : int
        The same seed gives the same bits.
    check_intervals : bool
        Whether wide intervals are confirmed by profile likelihood, and structures that most loads
        may have are fitted as well, to tell by how much they would move each parameter.
    frequency_swing : float [Hz]
        Where records have no f: of a frequency that swings so far is told by how much it would move
        each parameter; 0: it was nominal.
    progress : None, False or callable
        None shows how far the search is, False does not; a callable is told what is read and done,
        a sentence at a time.

    Returns
    -------
    Identification
        `parameters` {name: estimate with `value`, `interval`, `standard_error`, `verdict`, `unit`},
        `grade` and `headline`, `model_error`, `predict(event)`, `report()` and `advice`.

    Raises
    ------
    UserError
        For wrong names or values, records that lack what the model reads, and where nothing tried
        can be simulated.
    tractexp.errors.Stopped
        On Ctrl-C: a KeyboardInterrupt whose `result` holds what was found so far.

    Examples
    --------
    >>> import tractexp
    >>> fit = tractexp.identify(
    ...     "tibet_50pct",
    ...     optimizer="multistart_least_squares",
    ...     check_intervals=False,
    ...     progress=False,
    ... )
    >>> sorted(fit.parameters)
    ['C', 'M', 'T_m', 'T_prime', 'X_prime', 'p_v', 'q_v']
    >>> fit.parameters["T_prime"].unit
    's'
    """
    setup = FitSpec.from_arguments(
        records,
        model,
        validate,
        objective,
        bounds=bounds,
        fixed=fixed,
        per_event=per_event,
        substeps=substeps,
        domain=domain,
        priors=priors,
        physical=physical,
        seed=seed,
        budget=budget,
        time_limit=time_limit,
        target=target,
        optimizer=Choice.from_argument("optimizer", optimizer),
        check_intervals=check_intervals,
        frequency_swing=frequency_swing,
    )
    end = None
    try:
        end = setup.search_end(progress)
        return Identification.from_search(setup, end, progress)
    except KeyboardInterrupt as stop:
        raise Stopped.from_interrupt(
            stop, result=setup.so_far(end or getattr(stop, "state", None))
        ) from None


def _conclude_identification(
    setup: FitSpec, end: SearchResult, progress: Progress = False
) -> tuple[Result, FitDetails]:
    """The estimate that a search led to, and what stands behind it."""
    from tractexp.identification.advice import advise
    from tractexp.identification.agreement import compare_events
    from tractexp.identification.grade import grade_estimate, grade_model
    from tractexp.identification.load_drift import with_load_drift
    from tractexp.identification.physical import find_free_optimum, say_ranges
    from tractexp.identification.profile import check_by_profiles
    from tractexp.identification.rivals import with_rivals
    from tractexp.identification.share import find_share_bound
    from tractexp.identification.unfinished import with_unfinished
    from tractexp.identification.unrecorded import with_unrecorded
    from tractexp.identification.yardstick import yardstick

    problem = setup.problem
    refuse_failed(problem, end)
    shown = setup.model.shown
    graded = grade_model(problem, setup.validate, end.values, shown)
    uncertainty = graded.uncertainty
    if setup.check_intervals:
        profiled = check_by_profiles(
            uncertainty, counter("points at most on the profiles", progress)
        )
        uncertainty = with_rivals(profiled, counter("structures fitted beside", progress))
    uncertainty = with_unrecorded(uncertainty, setup.frequency_swing)
    uncertainty = with_unfinished(with_load_drift(uncertainty))
    uncertainty = say_ranges(uncertainty, setup.model.held)
    if not np.array_equal(uncertainty.values, graded.values):  # a profile led to a better optimum
        moved = replace(graded.estimation, uncertainty=uncertainty)
        graded = grade_estimate(problem, moved, setup.validate, shown)
    fits, adequacy = list(graded.fits), graded.adequacy
    result = conclude(
        problem, end, graded.values, fits, setup.seed, setup.model.node, setup.optimizer.name
    )
    result = replace(result, shown_effects=dict(shown), race=[*setup.model.race])
    together = compare_events(uncertainty) if len(problem.events) > 1 else None
    fields = uncertainty.fields()
    fields["uncertainty"] |= together.fields() if together else {"gains": {}, "odd_events": []}
    fields["uncertainty"]["notes"] += together.notes if together else []
    share = find_share_bound(uncertainty)
    played = {fit.event.record.name for fit in fits}
    validate = [event for event in setup.validate if event.record.name in played]
    free = find_free_optimum(uncertainty, setup.model.held, fits, validate)
    fields["uncertainty"]["notes"] += [str(free)] if free else []
    starts = [s.to_dict(problem.space.names) for s in graded.estimation.starts]
    structures = [rival.to_dict() for rival in uncertainty.rivals]
    data = set_holding(tuple(event.record.where for event in problem.events))
    unrecorded = uncertainty.unrecorded
    odd = together.odd if together else ()
    advice = [
        *advise(uncertainty, adequacy, odd, data=data),
        *_hold_to_machines(setup, result),
        *_with_frequency(uncertainty),
    ]
    beside = yardstick(fits, result.model_error)
    result = replace(
        result,
        **fields,
        adequacy=adequacy.to_dict(),
        linear_network=beside,
        next_dip=graded.next_dip,
        starts=starts,
        rival_structures=structures,
        free_optimum=free.to_dict() if free else {},
        share_bound=share.to_dict() if share else {},
        unrecorded=unrecorded.to_dict() if unrecorded else {},
        advice=advice,
    )
    return result, FitDetails(fits, graded.estimation, uncertainty, together, adequacy)


def _with_frequency(uncertainty: "Uncertainty") -> list[str]:
    """To record what moves parameters beyond their intervals, or would explain most of what is
    left; [] where nothing does.
    """
    missing = uncertainty.unrecorded
    if missing is None or not (missing.beyond or missing.course):
        return []
    still = "(task.frequency_swing=0 where it stood still)"
    if missing.course:
        return [f"record f or U_angle: {missing.course} {still}"]
    return [
        f"record f or U_angle: without it a swing of {missing.swing:g} Hz moves"
        f" {join_words(missing.beyond)} {still}"
    ]


def _hold_to_machines(setup: FitSpec, result: Result) -> list[str]:
    """The command that holds a motor that no load has to what machines are, or races structures
    where it is held; [] where the motor is one, or by priors.
    """
    from tractexp.exchange.operating_point import OperatingPoint

    point, model = OperatingPoint.from_result(result), setup.model
    if model.priors or not (point and point.doubt):
        return []
    if model.held:
        race = f"race structures for one that is a load: {suggest_run('model=auto')}"
        return [] if model.race else [race]
    if not any(parameter.physical for parameter in model.model.parameters):
        return []
    return [f"hold the motor to what machines are: {suggest_run('model.physical=true')}"]


@plugin
class Identify(Task, call=identify):
    """Identify the parameters of a load from recorded dips, and judge the model on all"""

    figures: bool | None = None  # write the page; null: in single runs, not in sweeps
    # log the model for mlflow.pyfunc; null: in single runs, not in sweeps
    predictor: bool | None = None
    document: bool = False  # write sheet.docx beside sheet.html (pip install 'tractexp[word]')

    def perform(self, job: Job, **instead: Any) -> Identification:
        """Identify; what is read is told where everything is asked for.

        Raises `UserError` where a document is asked for and python-docx is not installed.
        """
        if self.document and not find_spec("docx"):
            raise UserError(
                f"{TASK.document}=true needs python-docx; install it by: pip install"
                " 'tractexp[word]'"
            )
        return super().perform(job, **{"progress": job.tell_beside, **instead})

    def draws(self, job: Job) -> bool:
        """Whether this run draws figures: as set, else in single runs."""
        return not job.of_many if self.figures is None else self.figures

    def draw(self, job: Job, result: Any) -> list[Path]:
        """The page, the sheet, and the sheet as a document where that is asked for."""
        paths = super().draw(job, result)
        if self.document:
            paths.append(result.sheet().save(job.folder / SHEET_DOCUMENT))
        return paths

    def collect_log(self, job: Job, result: Identification) -> dict[str, Any]:
        """Estimates, errors and curves for MLflow, and the model as one that predicts where that is
        set.
        """
        from tractexp.api.logged import logged_fit

        predictor = not job.of_many if self.predictor is None else self.predictor
        return logged_fit(job, result, predictor)
