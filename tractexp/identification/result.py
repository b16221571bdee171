"""What an identification found: the estimate, how well it fits each event, and its file
`result.json`.
"""

import functools
import json
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build
from tractexp.domain import DOMAINS, find_domain
from tractexp.errors import UserError
from tractexp.identification import stored
from tractexp.identification.adequacy import ACCEPTED
from tractexp.identification.fit import TRAIN
from tractexp.identification.forecast import Forecast
from tractexp.identification.search import History
from tractexp.inference.model_error import format_percent
from tractexp.model.drive import PHASORS
from tractexp.model.model import CLASSICAL, Model, compose
from tractexp.outcome import Plain
from tractexp.record import OwnBase, Record, find_dips
from tractexp.record.identity import Identity
from tractexp.record.own_base import scale_parameter
from tractexp.storage import files

BEFORE = ("U0", "P0", "Q0", "frequency")  # of the first event, what its steady state stands on
SMALL_Q = 0.3  # of S: with less, an epsilon_q beyond Eq. (20) may be a small error of the load
FILE = "result.json"  # in the folder of a run


def build_parts(
    node: Mapping[str, Any],
) -> tuple[Any, Any, list[Any], str, str, float | str | None]:
    """The motor, static load and effects a model configuration names, built; integration, domain,
    recorder's window.
    """
    effects = [build("effect", {"name": name}) for name in node.get("effects", ())]
    motor = build("model/motor", node["motor"])
    static = build("model/static", node["static"])
    return (
        motor,
        static,
        effects,
        node.get("integration", CLASSICAL),
        node.get("domain", PHASORS),
        node.get("window"),
    )


def name_by_event(
    values: Mapping[str, float], per_event: Mapping[str, Sequence[float]]
) -> dict[str, float]:
    """Parameters by name, with T_m[1], T_m[2], ... where each event has its own."""
    own = {
        f"{name}[{k}]": value
        for name, each in per_event.items()
        for k, value in enumerate(each, start=1)
    }
    return {**values, **own}


@dataclass(frozen=True)
class Result(Plain):
    """The content of `result.json`. `model` and `before` are what it takes to simulate it again.

    Parameters, errors, intervals and verdicts belong to the estimate; `search` is where the
    optimizer itself end, and simulations, iterations, seconds and status are what it took to get
    there. Everything is on the record's own base; `own_base` says which that is, and
    `parameters_on_given_base` are the parameters on that of the file where it differs.
    """

    parameters: dict[str, float]
    objective: float
    epsilon_p: float
    epsilon_q: float
    simulations: int
    refused: int
    iterations: int
    seconds: float
    status: str
    seed: int
    events: list[dict[str, Any]]
    at_bound: list[str]
    units: dict[str, str]
    bounds: dict[str, list[float]]
    model: dict[str, Any]
    before: dict[str, float]
    # {effect of the model that the records show: how}
    shown_effects: dict[str, str] = field(default_factory=dict)
    optimizer: str = ""
    search: dict[str, Any] = field(default_factory=dict)
    # grade, sentence, p; empty where it was not judged
    adequacy: dict[str, Any] = field(default_factory=dict)
    # value, interval, of_S of the fitted events; held_out the same of those; events: name, role,
    # value, interval, of_S
    model_error: dict[str, Any] = field(default_factory=dict)
    # the best one beside it: `compare_with_network`
    linear_network: dict[str, Any] = field(default_factory=dict)
    # the band of P and Q for a dip that was not seen: `forecast_next_dip`
    next_dip: dict[str, Any] = field(default_factory=dict)
    # name, model_error, parameters
    rival_structures: list[dict[str, Any]] = field(default_factory=list)
    # structures that were raced: name, parameters, fitted, predicted, why; the winner first
    race: list[dict[str, Any]] = field(default_factory=list)
    # the optimum of a fit whose machine is held to no range; empty: none of these holds the fit
    free_optimum: dict[str, Any] = field(default_factory=dict)
    # of inputs that the records lack, by channel: size, words, moves {parameter: by how much},
    # beyond, course, remedy
    unrecorded: dict[str, dict[str, Any]] = field(default_factory=dict)
    # speeds {event: from that at rest}, errors [%], parameters; empty: a steady start does as well
    unsteady_start: dict[str, Any] = field(default_factory=dict)
    # of the motors, where the records bound it from below alone: low, high, profile, sentence
    share_bound: dict[str, Any] = field(default_factory=dict)
    advice: list[str] = field(default_factory=list)  # what to do next, the most pressing first
    notes: list[str] = field(default_factory=list)
    # of which `parameters` holds the mean
    per_event: dict[str, list[float]] = field(default_factory=dict)
    standard_errors: dict[str, float | None] = field(default_factory=dict)  # None: not identifiable
    intervals: dict[str, list[float]] = field(default_factory=dict)  # 95 %
    verdicts: dict[str, str] = field(default_factory=dict)
    uncertainty: dict[str, Any] = field(default_factory=dict)
    # of the descents to the estimate, the best first
    starts: list[dict[str, Any]] = field(default_factory=list)
    # name, role, sha256 of its channels, source, base ...
    records: list[dict[str, Any]] = field(default_factory=list)
    # power and file_power, in MVA where known; origin
    own_base: dict[str, Any] = field(default_factory=dict)
    parameters_on_given_base: dict[str, float] = field(default_factory=dict)
    tractexp_version: str = ""
    commit: str = ""  # of the package's repository; "" for a wheel

    def to_dict(self) -> dict[str, Any]:
        """All fields, as plain data."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: Any) -> "Result":
        """What `to_dict` gave. Raises `UserError` as `from_content` does."""
        return cls.from_content(content, "the saved result")

    @classmethod
    def from_content(cls, content: Any, where: str) -> "Result":
        """The result that a file holds; `where` names it. Values outside their bounds are warned
        of.

        Raises `UserError` for what no identification writes: other keys or kinds, a model that is
        none, parameters that are missing or no finite numbers.
        """
        stored.check_fields(cls, content, where)
        result = cls(**stored.replace_nulls(cls, content))
        for name in ("parameters", "per_event", "before", "bounds"):
            stored.check_numbers(f"{where}: {name}", getattr(result, name))
        try:
            motor, static, effects, *_ = build_parts(result.model)
            ratio = result.base.ratio
        except (KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError) as error:
            raise UserError(
                f"{where}: its model or own_base is none that an identification writes"
            ) from error
        if missing := [key for key in BEFORE if key not in result.before]:
            raise UserError(f"{where}: before lacks {missing[0]}; identify again")
        if not (math.isfinite(ratio) and ratio > 0):
            raise UserError(
                f"{where}: own_base has powers that are no finite numbers above zero; identify"
                " again"
            )
        stored.check_parameters(where, result.parameters, (motor, static, *effects))
        for sentence in stored.describe_outside(
            name_by_event(result.parameters, result.per_event), result.bounds
        ):
            warnings.warn(f"{where}: {sentence}", UserWarning, stacklevel=2)
        return result

    @property
    def base(self) -> OwnBase:
        """The base of power that the parameters are on, and that of the file."""
        return OwnBase(**self.own_base)

    @property
    def identities(self) -> list[Identity]:
        """Which load each record is of, in the order of `records`."""
        return [Identity.from_content(record) for record in self.records]

    def on_base_of(self, record: Record) -> dict[str, float]:
        """The parameters on the base that a record is on."""
        ratio = self.base.compute_ratio(record)
        motor, static, effects, *_ = build_parts(self.model)
        exponents = {
            p.name: p.power_exponent for part in (motor, static, *effects) for p in part.parameters
        }
        return {
            name: scale_parameter(value, exponents[name], ratio)
            for name, value in self.parameters.items()
        }

    def on_given_base(self) -> str:
        """The parameters whose values are others on the file's base, in one line; "" where it is
        the record's own.
        """
        own = name_by_event(self.parameters, self.per_event)
        values = [f"{n} = {v:.5g}" for n, v in self.parameters_on_given_base.items() if v != own[n]]
        return f"on {self.base.file}: {', '.join(values)}" if values else ""

    @property
    def free(self) -> dict[str, float]:
        """The estimate by the names of intervals and verdicts: T_m[1], T_m[2] where events have
        values of their own.
        """
        values = name_by_event(self.parameters, self.per_event)
        return {name: values[name] for name in self.verdicts or values}

    @property
    def nuisances(self) -> dict[str, float]:
        """The parameters of the effects that are in the model because the records show them."""
        _, _, effects, *_ = build_parts(self.model)
        names = [
            p.name
            for effect in effects
            if effect.name in self.shown_effects
            for p in effect.parameters
        ]
        return {name: value for name, value in self.free.items() if name.partition("[")[0] in names}

    @property
    def epsilons(self) -> tuple[str, ...]:
        """The relative errors that each event has: of P and Q, and of waveforms of the currents."""
        return DOMAINS[self.model.get("domain", PHASORS)].epsilons

    @property
    def acceptable(self) -> bool:
        """Whether both relative errors are below the 5 % of Eq. (20)."""
        return self.epsilon_p < ACCEPTED and self.epsilon_q < ACCEPTED

    @property
    def acceptance(self) -> str:
        """Whether Eq. (20) accepts the model, in a sentence; where Q is small, what its error is
        divided by.
        """
        holds = "holds" if self.acceptable else "does NOT hold"
        limit = format_percent(ACCEPTED)
        sentence = f"acceptance of Eq. (20), epsilon_p and epsilon_q below {limit}: {holds}"
        shares = [e["Q_over_S"] for e in self.events if e["role"] == TRAIN and "Q_over_S" in e]
        if shares and min(shares) < SMALL_Q and self.epsilon_q >= ACCEPTED > self.epsilon_p:
            sentence += f" (epsilon_q divides by Q alone, here {format_percent(min(shares))} of S)"
        return sentence

    def write(self, path: Path) -> Path:
        """Write the file in one move, so that no half-written one is ever seen."""
        return files.write(
            path,
            json.dumps(files.make_plain(asdict(self)), indent=2, ensure_ascii=False) + "\n",
        )

    def predict(
        self, t: Any, U: Any, f: Any = None, P0: float | None = None, Q0: float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """P and Q [pu] for a new voltage U [pu] at uniform times t [s]; f [Hz] where the frequency
        is known.

        Powers, given and calculated, are on the file's base. The voltage before the first dip (all
        of it where there is none) gives the steady state. P0 and Q0 are the power drawn there; by
        default that of the event the model was identified on. Of a model identified in waveforms
        the voltage is taken as balanced, and the power is instantaneous. Raises `UserError` for
        what is no finite number, and where there is no steady state.
        """
        P, Q = self.base.ratio * self._drive(t, U, f, P0, Q0).power
        return P, Q

    def find_band(
        self, t: Any, U: Any, f: Any = None, P0: float | None = None, Q0: float | None = None
    ) -> tuple[float, float] | None:
        """Half the bands of P and Q [pu] in which a load stays in 95 % of dips that was identified
        so, of what `predict` gives for the same; None of a result of an earlier version.
        """
        driven = self._drive(t, U, f, P0, Q0)
        forecast = Forecast.from_content(self.next_dip, driven.model.names, driven.values)
        if forecast is None:
            return None
        half = forecast.find_half_width(
            driven.calculate, driven.power_before, driven.t, driven.start, self.before["frequency"]
        )
        P, Q = (self.base.ratio * half).tolist()
        return P, Q

    def _drive(self, t: Any, U: Any, f: Any, P0: float | None, Q0: float | None) -> "Driven":
        """The model at a voltage that is checked."""
        model = compose(*build_parts(self.model))
        drawn = {key: value for key, value in {"P0": P0, "Q0": Q0}.items() if value is not None}
        stored.check_numbers("predict()", drawn)
        signals = stored.read_signals({"t": t, "U": U, "f": f})
        t, U, f = signals["t"], signals["U"], signals.get("f")
        dips = find_dips(t, U)
        start = max(dips[0][0], 1) if dips else None
        nominal = 2 * np.pi * self.before["frequency"]
        omega_s = None if f is None else 2 * np.pi * f - nominal
        powers = {key: value / self.base.ratio for key, value in drawn.items()}
        before = self.before | powers | {"U0": float(U[:start].mean())}
        values = np.array([self.parameters[name] for name in model.names])
        driven = Driven(model, values, t, U, before, start or 0, omega_s)
        if not np.isfinite(driven.power).all():
            raise UserError(
                "the response to this voltage grows beyond all bounds: the parameters suit no such"
                " event"
            )
        return driven


@dataclass(frozen=True, eq=False)
class Driven:
    """A model at values (d,), driven by a voltage U (N,) [pu] at times t (N,) [s] that dips first
    at sample `start`.

    `before` are U0, P0, Q0 [pu] and the frequency [Hz]. omega_s (N,) [rad/s] is the deviation of
    the frequency, None where unknown. All is on the model's own base.
    """

    model: Model
    values: np.ndarray
    t: np.ndarray
    U: np.ndarray
    before: Mapping[str, float]
    start: int
    omega_s: np.ndarray | None

    @functools.cached_property
    def power(self) -> np.ndarray:
        """P and Q (2, N) [pu]."""
        return self.calculate(self.values)

    @property
    def power_before(self) -> complex:
        """S before the dip [pu]."""
        return complex(self.before["P0"], self.before["Q0"])

    def calculate(self, values: np.ndarray) -> np.ndarray:
        """P and Q (2, N) [pu] at other values (d,)."""
        omega_s0 = 0.0 if self.omega_s is None else float(self.omega_s[: self.start or None].mean())
        play = find_domain(self.model).play
        power = play(self.model, values, self.t, self.U, self.before, self.omega_s, omega_s0)
        return np.stack(power)


def write_history(path: Path, history: History) -> Path:
    """Write the search as CSV, one row per iteration: simulations and seconds spent, best objective
    so far [pu²].
    """
    rows = zip(history.simulations, history.seconds, history.objective, strict=True)
    lines = [
        f"{k},{n},{s:.4f},{f!r}"
        for k, (n, s, f) in enumerate((int(n), float(s), float(f)) for n, s, f in rows)
    ]
    return files.write(path, "\n".join(["iteration,simulations,seconds,objective", *lines]) + "\n")


def parse_history(text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `write_history` wrote: simulations, seconds and the best objective so far [pu²], (n,)
    each. Raises `ValueError` for a text that is none.
    """
    rows = [line for line in text.splitlines()[1:] if line.strip()]
    if not rows:
        raise ValueError("the text has no row")
    _, simulations, seconds, objective = np.loadtxt(rows, delimiter=",", ndmin=2).T
    return simulations, seconds, objective


def load(path: Path) -> Result:
    """Read a `result.json`, or that of a run's folder. Raises `UserError` where it is missing or
    not one of ours.
    """
    if path.is_dir():
        path = path / FILE
    try:
        return Result.from_content(files.read_json(path), str(path))
    except FileNotFoundError:
        raise UserError(
            f"there is no result file {path}; run an identification first, it writes {FILE}"
        ) from None
