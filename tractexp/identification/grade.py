"""The grade of a model on records: what its estimate leaves of the fitted and the held-out events.

It is reckoned here alone, whoever asks. So the same model and records have the same error, grade
and sentence in an identification, in an investigation, in what is stored, logged and exported, and
on every page.
"""

import functools
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.identification.adequacy import Adequacy, Grade, grade_errors
from tractexp.identification.conclude import describe_active_bounds
from tractexp.identification.division import doubt_estimate
from tractexp.identification.estimate import EstimationResult, estimate, estimate_without_search
from tractexp.identification.fit import Fit, explain_refusal, play, tabulate_model_errors
from tractexp.identification.forecast import forecast_next_dip
from tractexp.identification.uncertainty import Uncertainty
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.model_error import ModelError
from tractexp.inference.problem import Problem
from tractexp.record import Event
from tractexp.text.wording import join_words


@dataclass(frozen=True, eq=False)
class GradedModel:
    """The estimate of a model, with what it calculates of the fitted and the held-out events.

    Attributes
    ----------
    problem : Problem
        The model and the fitted events.
    estimation : EstimationResult
        The estimate.
    fits : tuple of Fit
        What it calculates of each event, the fitted ones first.
    adequacy : Adequacy
        The grade.
    """

    problem: Problem
    estimation: EstimationResult
    fits: tuple[Fit, ...]
    adequacy: Adequacy

    @property
    def uncertainty(self) -> Uncertainty:
        """What is known of each free parameter: values, intervals and verdicts."""
        return self.estimation.uncertainty

    @property
    def values(self) -> np.ndarray:
        """The free parameters (d,)."""
        return self.uncertainty.values

    @functools.cached_property
    def doubt(self) -> str:
        """Why no load divides so into motor and static part, in words; "" where one may."""
        return doubt_estimate(self.problem, self.values)

    @functools.cached_property
    def parameters(self) -> list[ParameterEstimate]:
        """What is known of each free parameter, with the interval and verdict of `result.json`."""
        known = self.uncertainty
        declared = {p.name: p for p in self.problem.parameters}
        errors = known.information.standard_errors
        errors = np.where(np.isfinite(errors), errors, np.nan).tolist()
        rows = zip(
            known.names, known.values.tolist(), errors, known.intervals.tolist(), strict=True
        )
        return [
            ParameterEstimate(
                declared[name], value, error, str(known.verdicts[name]), ends=(low, high)
            )
            for name, value, error, (low, high) in rows
        ]

    def find_curves(self, event: Event) -> np.ndarray | None:
        """What the model calculates of an event.

        Parameters
        ----------
        event : Event
            One of those of `fits`, by its name.

        Returns
        -------
        (C, N) array [pu] or None
            P and Q, or the currents of waveforms; None where it cannot be simulated there.
        """
        named = (fit for fit in self.fits if fit.event.record.name == event.record.name)
        fit = next(named, None)
        if fit is None:
            return None
        return np.stack([fit.P, fit.Q]) if fit.currents is None else fit.currents

    @functools.cached_property
    def errors(self) -> dict[str, Any]:
        """The model's error as `result.json` has it: of the fitted events, of those held out, and
        of each.
        """
        return tabulate_model_errors(self.fits)

    @functools.cached_property
    def next_dip(self) -> dict[str, Any]:
        """The band that the model promises for a dip that it has not seen, as `result.json` has
        it.
        """
        return forecast_next_dip(self)


def grade_model(
    problem: Problem,
    validate: Sequence[Event] = (),
    searched: np.ndarray | None = None,
    shown: Collection[str] = (),
) -> GradedModel:
    """Estimate a model's parameters, and grade it.

    Parameters
    ----------
    problem : Problem
        The model and the fitted events.
    validate : sequence of Event
        Events held out, which the grade counts, too; one without a steady state makes a wrong
        model.
    searched : (d,) or None
        Free values that a search ended at; None: there was no search.
    shown : names
        Effects that the model has because its records show them: their bounds tell nothing.

    Returns
    -------
    GradedModel

    Raises
    ------
    UserError
        Where nothing of the box can be simulated.
    """
    estimation = (
        estimate_without_search(problem) if searched is None else estimate(problem, searched)
    )
    return grade_estimate(problem, estimation, validate, shown)


def grade_estimate(
    problem: Problem,
    estimation: EstimationResult,
    validate: Sequence[Event] = (),
    shown: Collection[str] = (),
) -> GradedModel:
    """The graded model of an estimate.

    Held-out events that it cannot simulate, for it has no steady state there, make a wrong model.

    Parameters
    ----------
    problem : Problem
        The model and the fitted events.
    estimation : EstimationResult
        The estimate.
    validate, shown
        As of `grade_model`.

    Returns
    -------
    GradedModel
    """
    shared = problem.full(estimation.uncertainty.values)[0]
    refusals = {
        event.record.name: explain_refusal(problem.model, shared, event) for event in validate
    }
    playable = [event for event in validate if not refusals[event.record.name]]
    graded = _grade_played(problem, estimation, playable, shown)
    if len(playable) == len(validate):
        return graded
    reasons = [f"{name} cannot be simulated ({why})" for name, why in refusals.items() if why]
    sentence = (
        f"{graded.adequacy.sentence}; {'; '.join(reasons)}: the model does not describe this load"
    )
    return replace(
        graded, adequacy=replace(graded.adequacy, grade=Grade.WRONG_MODEL, sentence=sentence)
    )


def _grade_played(
    problem: Problem,
    estimation: EstimationResult,
    validate: Sequence[Event],
    shown: Collection[str],
) -> GradedModel:
    """The graded model of an estimate that can simulate all held-out events."""
    values = estimation.uncertainty.values
    fits = play(problem, values, validate)
    errors = tabulate_model_errors(fits)
    held_out = errors["held_out"]
    adequacy = grade_errors(
        estimation.surprise,
        ModelError.from_content(errors),
        held_out and ModelError.from_content(held_out),
        describe_active_bounds(problem, values, _list_nuisances(problem, shown)),
    )
    if said := _describe_swings(problem.events):
        adequacy = replace(adequacy, sentence=f"{adequacy.sentence}; {said}")
    return GradedModel(problem, estimation, tuple(fits), adequacy)


def _describe_swings(events: Sequence[Event]) -> str:
    """What of the noise of fitted events is a swing of the load, in words; "" without."""
    swings = [(event.record.name, event.swing) for event in events if event.swing]
    told = join_words([f"{swing} before {name}" for name, swing in swings])
    return f"what counts as noise is a swing of the load as well: {told}" if told else ""


def _list_nuisances(problem: Problem, shown: Collection[str]) -> list[str]:
    """Parameters, as the problem names them, of effects that nobody asked for: their bounds tell
    nothing.
    """
    own = {
        p.name
        for effect in problem.model.effects
        if effect.name in shown
        for p in effect.parameters
    }
    return [name for name in problem.space.names if name.partition("[")[0] in own]
