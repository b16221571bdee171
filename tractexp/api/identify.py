"""Identify a load model's parameters from recorded dips."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import Choice, public
from tractexp.api.fit_spec import AVERAGED_CYCLES, FREQUENCY_SWING, UNBALANCE, FitSpec
from tractexp.api.identification import Identification
from tractexp.api.job import Job
from tractexp.api.task import Task
from tractexp.configuration.plugin import plugin
from tractexp.errors import TASK, Stopped, UserError
from tractexp.text.progress import Progress

if TYPE_CHECKING:
    from tractexp.api.given import Chosen, ModelGiven, Records

SHEET_DOCUMENT = "sheet.docx"


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
    unbalance: float = UNBALANCE,
    averaged_cycles: float = AVERAGED_CYCLES,
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
    unbalance : float
        As much where they have no U2, of one that is so much of what the voltage falls by; 0: the
        dips were balanced.
    averaged_cycles : float
        As much where they have no window and the model would be looked at through it, of a mean
        over so many cycles; 0: their values are of one instant.
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
        unbalance=unbalance,
        averaged_cycles=averaged_cycles,
    )
    end = None
    try:
        end = setup.search_end(progress)
        return Identification.from_search(setup, end, progress)
    except KeyboardInterrupt as stop:
        reached = end or getattr(stop, "state", None)
        so_far = Identification.from_stopped_search(setup, reached) if reached else None
        raise Stopped.from_interrupt(stop, result=so_far) from None


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
        from tractexp.api.logged import build_logged_fit

        predictor = not job.of_many if self.predictor is None else self.predictor
        return build_logged_fit(job, result, predictor)
