"""The black box: the best linear network from the recorded voltage to the recorded current, without
any physics.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import public
from tractexp.api.compose import DOMAIN
from tractexp.api.job import Job
from tractexp.api.read import Dips, read_dips, read_dips_together
from tractexp.api.response import Response, build_response
from tractexp.api.setup import describe_records
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.cache import provenance
from tractexp.configuration.choices import read_choices, read_default_choices
from tractexp.configuration.plugin import plugin
from tractexp.configuration.run_command import suggest_run
from tractexp.errors import TASK, UserError, check_choice, check_range
from tractexp.outcome import Written
from tractexp.record import Event, OwnBase
from tractexp.record.identity import Identity
from tractexp.storage import files
from tractexp.text import quoting
from tractexp.text.progress import Progress, tell

if TYPE_CHECKING:
    from tractexp.api.given import Records, Source
    from tractexp.identification.fit import Fit
    from tractexp.identification.linear_network import BlackBox

MOST_ASKED_POLES = 12  # poles that may be asked for


@dataclass(frozen=True, eq=False, repr=False)
class NetworkFit(Written):
    """The best linear network of few poles for some events, and how well it does on them and on
    others.

    `content` is that of `linear_network.json`: `poles` [{decay [1/s], frequency [Hz], admittance
    [pu]}], `chosen_by`, `model_error` as in `result.json`, `events` and `records`, and `by_poles`,
    what each number of poles leaves.
    """

    kind = "linear network"
    page = "linear_network.html"

    train: Dips
    validate: Dips
    domain: str
    order: int | None  # poles, where they are given
    content: Mapping[str, Any]

    @functools.cached_property
    def box(self) -> "BlackBox":
        """The network; of a loaded result it is fitted again."""
        return _fit_networks(self)[0]

    @functools.cached_property
    def fits(self) -> "list[Fit]":
        """The calculated response of each event beside the recorded one."""
        return _play_network(self.box, self)

    @property
    def poles(self) -> list[dict[str, float]]:
        """[{decay [1/s], frequency [Hz], admittance [pu]}]."""
        return self.content["poles"]

    @property
    def headline(self) -> str:
        """How much of the response it leaves, in one sentence."""
        return self.content["sentence"]

    def predict(self, event: "Source") -> Response:
        """P and Q [pu] (N,) that it draws in an event, on the base of its file.

        `event` is one that `tractexp.read` gave, or what it reads, holding one dip: its voltage and
        the power before it. Raises `UserError` where the event lacks the samples of its domain.
        """
        (one,) = read_dips("event", event, least=1)[:1]
        own = OwnBase.from_record(self.train[0].record)
        return build_response(_play(self.box, own.convert_event(one), "validate"), one, own)

    def table(self) -> Table:
        """The poles."""
        from tractexp.report.linear_network import tabulate_poles

        return tabulate_poles(self)

    def summary(self) -> Report:
        """The poles, and what the network leaves."""
        from tractexp.report import linear_network

        return linear_network.build_summary(self)

    @property
    def next_step(self) -> str:
        """The command that fits the load whose physics is known."""
        return f"fit a load beside this yardstick: {suggest_run('task=identify')}"

    def report(self) -> Report:
        """The page: the curves of the network, and what each number of poles leaves."""
        from tractexp.report import linear_network

        return linear_network.report(self)


@public
def linear_network(
    records: "Records",
    *,
    validate: "Records" = (),
    domain: str | None = None,
    poles: int | None = None,  # null: as many as the fitted dips ask for
    progress: Progress = None,
) -> NetworkFit:
    """Fit the best linear network of few poles from the voltage to the current of recorded dips:
    how good can it get?

    Parameters
    ----------
    records : events, or whatever `tractexp.read` reads
        The dips to fit, all together.
    validate : as `records`
        Dips that are only judged: they choose nothing.
    domain : "phasors" or "waves"
        With "waves" space vectors of sampled currents follow those of the voltages, and the zero
        sequence has a path of its own; else P and Q follow U. None: that of `conf/config.yaml`.
    poles : int
        None: as many as an information criterion of the fitted dips asks for, up to four.
    progress : callable
        Is told what is read, a sentence at a time.

    Returns
    -------
    NetworkFit
        `poles`, `fits` of each event, `headline`, and `predict(event)`.

    Raises
    ------
    UserError
        For wrong values, and for records of too few samples or whose voltage does not move.
    """
    domain = domain or read_default_choices()[DOMAIN]
    check_choice("domain", domain, sorted(read_choices()[DOMAIN]))
    check_range("task.poles", poles, 0, MOST_ASKED_POLES)
    train, held_out = read_dips_together(records, validate)
    request = NetworkFit(train, held_out, domain, poles, {})
    tell(progress, describe_records(train, held_out))
    box, boxes = _fit_networks(request)
    return NetworkFit(
        train, held_out, domain, poles, files.make_plain(_build_content(request, box, boxes))
    )


def _fit_networks(of: NetworkFit) -> "tuple[BlackBox, list[BlackBox]]":
    """The network for the events of a call, and those of fewer and of more poles."""
    from tractexp.domain import DOMAINS
    from tractexp.identification.linear_network import (
        MOST_VECTOR_POLES,
        choose_network,
        fit_black_boxes,
    )

    domain = DOMAINS[of.domain]
    train = domain.events(of.train)
    boxes = fit_black_boxes(domain, train, MOST_VECTOR_POLES if of.order is None else of.order)
    if of.order is None:
        return choose_network(boxes, train), boxes
    if len(boxes) <= of.order:
        raise UserError(
            f"{TASK.poles}={of.order}: the samples from the dips on are enough for"
            f" {len(boxes) - 1}; ask for fewer poles, or take a record that goes on longer"
        )
    return boxes[-1], boxes


def _play(box: "BlackBox", event: Event, role: str) -> "Fit":
    """The response of a network to an event, as a fit of that role."""
    from tractexp.identification.fit import Fit

    return Fit(role=role, **vars(box.play(box.domain.event(event))))


def _play_network(box: "BlackBox", of: NetworkFit) -> "list[Fit]":
    """The response of a network to every event, those fitted first."""
    from tractexp.identification.fit import TRAIN, VALIDATE

    return [
        _play(box, e, role)
        for role, events in ((TRAIN, of.train), (VALIDATE, of.validate))
        for e in events
    ]


def _build_content(of: NetworkFit, box: "BlackBox", boxes: "list[BlackBox]") -> dict[str, Any]:
    """The content of `linear_network.json`."""
    from tractexp.identification.fit import tabulate_model_errors
    from tractexp.identification.network_comparison import describe_network
    from tractexp.inference.model_error import ModelError

    fits = _play_network(box, of)
    error, by_poles = tabulate_model_errors(fits), []
    for one in boxes:
        own = tabulate_model_errors(_play_network(one, of))
        held = own["held_out"] and own["held_out"]["value"]
        by_poles.append({"poles": len(one.poles), "model_error": own["value"], "held_out": held})
    sentence = f"{describe_network(len(box.poles))} leaves {ModelError.from_content(error)}"
    if error["held_out"]:
        sentence += f", and of the held-out dips {ModelError.from_content(error['held_out'])}"
    return {
        "sentence": sentence,
        "poles": box.poles,
        "chosen_by": box.chosen_by or f"task.poles={of.order}",
        "model_error": error,
        "events": [fit.to_dict() for fit in fits],
        "by_poles": by_poles,
        "records": [
            {"role": f.role, "name": f.event.record.name}
            | Identity.from_record(f.event.record).to_dict()
            for f in fits
        ],
        "tractexp_version": provenance.read_version(),
        "commit": provenance.find_commit(),
    }


@plugin
class LinearNetwork(Task, call=linear_network):
    """Fit the best linear network of few poles, a model without physics: linear_network.html and
    .json.

    What it leaves is what a model can hardly go below by linear equations; each identification says
    how much more it leaves itself.
    """

    reads = ("data", "model.domain")
    instead = {"model": "a network has no equations: leave it out"}

    def perform(self, job: Job, **instead: Any) -> NetworkFit:
        """Fit the network in the domain of the run's model."""
        given = {"domain": job.config["model"]["domain"], "progress": job.tell_beside}
        return super().perform(job, **given | instead)

    def collect_log(self, job: Job, result: NetworkFit) -> dict[str, Any]:
        """The errors and the number of poles for MLflow."""
        error = result.content["model_error"]
        metrics = {"model_error": error["value"], "poles": len(result.poles)}
        if error["held_out"]:
            metrics["model_error_held_out"] = error["held_out"]["value"]
        names = " and ".join(event.record.name for event in result.train)
        return {
            "name": f"linear network, {names}",
            "metrics": metrics,
            "description": quoting.markdown(result.headline),
            "records": result.content["records"],
        }
