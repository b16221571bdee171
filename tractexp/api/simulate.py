"""Play a voltage through a load model with given parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tractexp.api.arguments import public
from tractexp.api.compose import LoadModel, resolve_model
from tractexp.api.identification import Identification
from tractexp.api.job import Job
from tractexp.api.read import read_dips
from tractexp.api.response import Response, respond_to
from tractexp.api.task import LOAD, Task
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import plugin
from tractexp.domain import find_domain
from tractexp.errors import TASK, UserError, check_range, list_allowed, name_setting
from tractexp.identification.result import load
from tractexp.outcome import Drawing, Written

if TYPE_CHECKING:
    from tractexp.api.given import ModelGiven, Records
    from tractexp.api.identification import Identification
    from tractexp.api.investigation import Investigation

# a dip by hand, where nothing else is known
BEFORE = {"U0": 1.0, "P0": 1.0, "Q0": 0.5, "frequency": 50.0}


@dataclass(frozen=True)
class Dip:
    """A dip made by hand. Times in s."""

    depth: float
    duration: float = 0.15  # from the start of the fall to the start of the recovery
    fall: float = 0.02
    recovery: float = 0.05
    start: float = 0.5
    length: float = 3.0
    rate: float = 1000.0  # samples per second

    def check(self) -> None:
        """Raise `UserError` for a setting out of range."""
        check_range("task.depth", self.depth, 0.0, 1.0)
        for name in ("duration", "fall", "recovery", "start"):
            check_range(f"task.{name}", getattr(self, name), 0.0)
        check_range("task.rate", self.rate, 1.0, 1e5)
        check_range(
            "task.length", self.length, max(20 / self.rate, self.start + self.duration), 3600.0
        )

    def voltage(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (N,) [s] and the voltage (N,) as a share of that before."""
        t = np.arange(round(self.length * self.rate) + 1) / self.rate
        fallen = smooth((t - self.start) / max(self.fall, 1e-9))
        back = smooth((t - self.start - self.duration) / max(self.recovery, 1e-9))
        return t, 1 - self.depth * fallen * (1 - back)


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Written):
    """Responses, one for each event; a simulation of one event has its arrays `t`, `U`, `P`, `Q`
    itself.
    """

    kind = "simulation"

    model: LoadModel
    values: Mapping[str, float]
    responses: tuple[Response, ...]

    def __getattr__(self, name: str) -> np.ndarray:
        """`t`, `U`, `P` and `Q` of the only event."""
        if name in ("t", "U", "P", "Q") and len(self.responses) == 1:
            return getattr(self.responses[0], name)
        raise AttributeError(
            f"a simulation of {len(self.responses)} events has no '{name}'; see .responses"
        )

    def table(self) -> Table:
        """Lowest voltage, range of P and Q, and the errors of each event."""
        columns = ["event", "U min", "P min", "P max", "Q min", "Q max", "epsilon_p", "epsilon_q"]
        if any(one.epsilon_i is not None for one in self.responses):
            columns.append("epsilon_i")
        return Table(columns, [one.row for one in self.responses], self.model.model.title)

    def summary(self) -> Report:
        """The parameters and the table."""
        rows = [[p.name, f"{self.values[p.name]:.6g}", p.unit] for p in self.model.model.parameters]
        return Report().add(Table(["parameter", "value", "unit"], rows), self.table())

    def to_dict(self) -> dict[str, Any]:
        """Model, values and responses as plain data."""
        return {
            "model": asdict(self.model),
            "values": dict(self.values),
            "responses": [dict(vars(one)) for one in self.responses],
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The simulation that `to_dict` gave."""

        def response(entry: Mapping[str, Any]) -> Response:
            arrays: Any = {key: np.array(entry[key], dtype=float) for key in ("t", "U", "P", "Q")}
            arrays["notes"] = tuple(entry["notes"])
            if entry["measured"]:
                P, Q = (np.array(values, dtype=float) for values in entry["measured"])
                arrays |= {
                    "measured": (P, Q),
                    "epsilon": tuple(entry["epsilon"]),
                    "epsilon_i": entry.get("epsilon_i"),
                }
                arrays["currents"] = {
                    k: np.array(x, dtype=float) for k, x in entry.get("currents", {}).items()
                }
            return Response(entry["title"], **arrays)

        responses = tuple(map(response, content["responses"]))
        return cls(LoadModel(**content["model"]), content["values"], responses)

    def write_results(self, folder: Path) -> list[Path]:
        """response.csv, with a number from the second event on; of waveforms currents, too."""
        return [
            path
            for k, one in enumerate(self.responses, start=1)
            for path in one.write(folder / _name_stem(k))
        ]

    def drawings(self) -> Mapping[str, Drawing]:
        """response.svg, with a number from the second event on."""
        return {f"{_name_stem(k)}.svg": one.draw for k, one in enumerate(self.responses, start=1)}


def _name_stem(number: int) -> str:
    """The name of an event's files without ending."""
    return "response" if number == 1 else f"response_{number}"


@public
def simulate(
    model: "ModelGiven | Identification | Investigation | None" = None,
    values: Mapping[str, float] | None = None,  # {name: value}
    *,
    records: "Records" = (),
    depth: float | None = None,  # of the voltage before; null: play the recorded data
    duration: float = 0.15,  # s, from the start of the fall to the start of the recovery
    fall: float = 0.02,  # s
    recovery: float = 0.05,  # s
    start: float = 0.5,  # s
    length: float = 3.0,  # s
    rate: float = 1000.0,  # samples per second
    U0: float | None = None,  # pu, voltage before the dip; null: the result's, or 1
    P0: float | None = None,  # pu, power before the dip; null: the result's, or 1
    Q0: float | None = None,  # pu; null: the result's, or 0.5
) -> Simulation:
    """Calculate the power a load draws in recorded events, or in a dip made by hand.

    A dip made by hand falls to `depth` from `start` on, within `fall`, and recovers `duration`
    after that, within `recovery`. Powers, given and calculated, are on the base of the records'
    file. `values` are on the identification's own base where there is one, as its parameters are;
    without one nothing is rebased, and they are on that of the records.

    Parameters
    ----------
    model : Identification, or as in `tractexp.identify`
        Of an identification the parameters are taken, too.
    values : {name: value}
        Every parameter of a model, in its own unit; single ones of an identification.
    records : events, or whatever `tractexp.read` reads
        Events whose recorded voltage is played, in place of a dip made by hand.
    depth : float, 0 to 1
        Of the voltage before.
    duration : float [s]
        From the start of the fall to the start of the recovery.
    fall, recovery : float [s]
        How long they take.
    start, length : float [s]
        When the fall starts, and how long all of it is.
    rate : float [1/s]
        Samples per second.
    U0, P0, Q0 : float [pu]
        Before such a dip; None: those of the identification, else 1, 1 and 0.5.

    Returns
    -------
    Simulation
        `responses`, one an event, with `t` [s], `U`, `P` and `Q` (N,) [pu] and `to_frame()`; those
        of a single one are attributes of the simulation, too.

    Raises
    ------
    UserError
        For unknown names, values that are missing, and where there is no steady state.

    Examples
    --------
    >>> import tractexp
    >>> load = tractexp.compose(motor="none", static="constant_impedance")
    >>> played = tractexp.simulate(load, {}, depth=0.5, Q0=0.3)
    >>> round(float(played.P.min()), 3), round(float(played.Q.min()), 3)
    (0.25, 0.075)
    """
    dip = Dip(0.0 if depth is None else depth, duration, fall, recovery, start, length, rate)
    dip.check()
    powers = {
        key: value for key, value in {"U0": U0, "P0": P0, "Q0": Q0}.items() if value is not None
    }
    if depth is None and (
        needless := [
            *powers,
            *(f.name for f in fields(Dip)[1:] if getattr(dip, f.name) != f.default),
        ]
    ):
        where = name_setting(f"task.{needless[0]}")
        raise UserError(
            f"{where} describes a dip made by hand; give its depth, too, or leave it out"
        )
    fit = model if isinstance(model, Identification) else None
    load = fit.model if fit else resolve_model(model)
    at = order_values(load.model.names, fit.result.parameters if fit else {}, values or {})
    events = read_dips("records", records)
    if bool(events) == (depth is not None):
        raise UserError("give either records to play, or the depth of a dip")
    own = fit.result.base if fit else None
    ratio = own.ratio if own else 1.0
    before = (
        BEFORE
        | (fit.result.before if fit else {})
        | {k: v if k == "U0" else v / ratio for k, v in powers.items()}
    )
    played = [respond_to(load.model, at, e, own) for e in events] or [
        _play_dip(load, at, dip, before, ratio)
    ]
    return Simulation(load, dict(zip(load.model.names, at.tolist(), strict=True)), tuple(played))


def _play_dip(
    load: LoadModel, values: np.ndarray, dip: Dip, before: Mapping[str, float], ratio: float
) -> Response:
    """The response to a dip made by hand, `ratio` times the power that the model draws on its own
    base.
    """
    t, shape = dip.voltage()
    U = before["U0"] * shape
    P, Q = find_domain(load.model).play(load.model, values, t, U, before)
    return Response(f"dip of {dip.depth:.0%} for {dip.duration:g} s", t, U, ratio * P, ratio * Q)


def smooth(x: np.ndarray) -> np.ndarray:
    """Raised cosine from 0 (x <= 0) to 1 (x >= 1)."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(x, 0.0, 1.0))


def order_values(
    names: Sequence[str], fitted: Mapping[str, float], given: Mapping[str, float]
) -> np.ndarray:
    """Values (d,) in the model's order. Raises `UserError` for unknown names and for what is
    missing.
    """
    for name in given:
        if name not in names:
            raise UserError(
                f"{TASK.values}.{name}: this model has no parameter"
                f" '{name}'{list_allowed(name, names, 'Parameters')}"
            )
    values = {**fitted, **given}
    if missing := [name for name in names if name not in values]:
        raise UserError(
            f"no value for {', '.join(missing)}: give {TASK.parameters}=result.json of an"
            f" identification, or {TASK.values}={{{', '.join(f'{name}: ...' for name in missing)}}}"
        )
    return np.array([values[name] for name in names], dtype=float)


@plugin
class Simulate(Task, call=simulate):
    """Simulate recorded events, or the dip that `depth`, `duration` ... describe.

    The parameters are those of a `result.json`, with its model, or `values` for the model chosen;
    values also replace single parameters of the result.
    """

    instead = {
        "model": "with task.parameters the model is that of the result",
        "data": "with task.depth no record is played",
    }

    # path of a result.json, or of its run's folder; of parameters that a model has, a task has none
    parameters: str | None = None  # pyright: ignore[reportIncompatibleVariableOverride]

    def needless(self) -> tuple[str, ...]:
        """The parts of the configuration that this run does not read."""
        return (*(LOAD if self.parameters else ()), *(("data",) if self.by_hand else ()))

    @property
    def by_hand(self) -> bool:
        """Whether the dip is made by hand."""
        return getattr(self, "depth") is not None  # noqa: B009 # a setting that the call declares

    def perform(self, job: Job, **instead: Any) -> Simulation:
        """Play the run's events, or the dip made by hand, through the model of
        `task.parameters`.
        """
        if self.parameters:
            instead["model"] = Identification(load(Path(self.parameters)))
        instead["records"] = () if self.by_hand else [*job.events.train, *job.events.validate]
        return super().perform(job, **instead)

    def collect_log(self, job: Job, result: Simulation) -> dict[str, Any]:
        """The errors of each event for MLflow."""
        errors = {
            f"event_{k}_epsilon_{c}": error
            for k, one in enumerate(result.responses, start=1)
            for c, error in zip("pqi", (*(one.epsilon or (None, None)), one.epsilon_i), strict=True)
        }
        metrics = {key: error for key, error in errors.items() if error is not None}
        return {"name": "simulation", "values": dict(result.values), "metrics": metrics}
