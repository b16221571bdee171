"""What an identification says of a load: parameters, how sure they are, how far to trust them."""

import functools
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tractexp.api.compose import LoadModel
from tractexp.api.conclusion import FitDetails, conclude_identification
from tractexp.api.estimate import Estimate, Estimates
from tractexp.api.fit_spec import FitSpec
from tractexp.api.read import read_dips
from tractexp.api.response import Response, respond_to
from tractexp.blocks import Report, Table
from tractexp.configuration.run_command import build_folder_command
from tractexp.errors import UserError
from tractexp.identification.adequacy import Grade
from tractexp.identification.fit import play
from tractexp.identification.result import Result, name_by_event
from tractexp.identification.search import REFUSED, History, SearchResult
from tractexp.inference.model_error import ModelError
from tractexp.outcome import Drawing, Written
from tractexp.record import OwnBase
from tractexp.text.progress import Progress

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike

    from tractexp.api.given import Source
    from tractexp.exchange.operating_point import OperatingPoint
    from tractexp.record import Event

FIXED = "fixed"
SHEET = "sheet.html"
USABLE, DOUBTFUL, UNUSABLE = "usable", "doubtful", "unusable"
USABILITY: dict[str, str] = {
    Grade.ADEQUATE: USABLE,
    Grade.EFFECT_MISSING: DOUBTFUL,
    Grade.WRONG_MODEL: UNUSABLE,
}


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
        result, details = conclude_identification(setup, end, progress)
        return cls(result, setup, end, details)

    @classmethod
    def from_stopped_search(cls, setup: FitSpec, end: SearchResult) -> "Identification | None":
        """Where a search was when it was stopped, without a judgement; None where nothing that it
        had tried can be simulated.
        """
        if not end.objective < REFUSED:
            return None
        fits = play(setup.problem, end.values, setup.validate)
        return cls(setup.build_result(end, end.values, fits), setup, end)

    @functools.cached_property
    def details(self) -> FitDetails:
        """Fits, estimate and uncertainty behind the result: computed again where this was
        loaded.
        """
        return self.behind or conclude_identification(self.spec, self.search_result)[1]

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
        values, ended, estimates = name_by_event(r.parameters, r.per_event), r.search, Estimates()
        search = name_by_event(ended["parameters"], ended["per_event"]) if ended else values
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
        from tractexp.exchange.operating_point import list_doubts

        return list_doubts(self.result, self.operating_point)

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
    def usability_sentence(self) -> str:
        """Both, as console, page and summary begin; the headline where it was not judged."""
        return f"{self.usability}: {self.usability_reason}" if self.usability else self.headline

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
        if not command:
            return self.advice
        return [f"hand in {SHEET}, and export the model: {command}", *self.advice]

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
            (one,) = read_dips("event", event, least=1)[:1]
            return self._predict_event(one)
        P, Q = self.result.predict(t, U, f, P0, Q0)
        band = self.result.find_band(t, U, f, P0, Q0)
        t, U = np.asarray(t, dtype=float), np.asarray(U, dtype=float)
        return Response("prediction", t, U, P, Q, band=band)

    def _predict_event(self, event: "Event") -> Response:
        from tractexp.identification.fit import respond
        from tractexp.identification.forecast import Forecast

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
        from tractexp.report.fit_tables import tabulate_parameters

        return tabulate_parameters(self)

    def to_frame(self) -> "pandas.DataFrame":
        """The estimates as a pandas frame of numbers: `Estimates.to_frame`."""
        return self.parameters.to_frame()

    def summary(self) -> Report:
        """Estimate, intervals and grade."""
        from tractexp.report.fit_summary import build_summary

        return build_summary(self)

    def screen(self) -> Report:
        """The answer on one screen of a terminal."""
        from tractexp.report import screen

        return screen.build_screen(self)

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

        return sheet.build_sheet(self)

    def drawings(self) -> Mapping[str, Drawing]:
        return {**super().drawings(), SHEET: lambda path: self.sheet().save(path)}

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
