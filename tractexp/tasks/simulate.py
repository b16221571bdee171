"""Play a voltage through a load model with given parameters."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, among, check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import say, table
from tractexp.tasks.task import LOAD, Job, Task


@plugin
class Simulate(Task):
    """Simulate recorded events (`data=...`) or, where a depth is given, the dip that `depth`, `duration` ... describe.

    The parameters are those of a `result.json`, with its model, or `values` for the model chosen; values also replace
    single parameters of the result.
    """

    reads = ("data", *LOAD)
    instead = {
        "model": "with task.parameters the model is that of the result",
        "data": "with task.depth no record is played",
    }

    parameters: str | None = None  # path of a result.json
    values: dict[str, float] = field(default_factory=dict)  # {name: value}
    depth: float | None = None  # pu of the voltage before; null: play the recorded data
    duration: float = 0.15  # s, from the start of the fall to the start of the recovery
    fall: float = 0.02  # s
    recovery: float = 0.05  # s
    start: float = 0.5  # s
    length: float = 3.0  # s
    rate: float = 1000.0  # samples per second
    U0: float | None = None  # pu, voltage before the dip; null: the result's, or 1
    P0: float | None = None  # pu, power before the dip; null: the result's, or 1
    Q0: float | None = None  # pu; null: the result's, or 0.5

    def needless(self) -> tuple[str, ...]:
        return (*(LOAD if self.parameters else ()), *(("data",) if self.depth is not None else ()))

    def check(self):
        if self.depth is not None:
            check_range("task.depth", self.depth, 0.0, 1.0)
        for name, low in {"duration": 0.0, "fall": 0.0, "recovery": 0.0, "start": 0.0}.items():
            check_range(f"task.{name}", getattr(self, name), low)
        check_range("task.rate", self.rate, 1.0, 1e5)
        check_range("task.length", self.length, max(20 / self.rate, self.start + self.duration), 3600.0)

    def run(self, job: Job) -> None:
        from tractexp.identification.result import load

        result = load(Path(self.parameters)) if self.parameters else None
        model = _model(result, job)
        values = chosen(model.names, result.parameters if result else {}, self.values)
        if self.depth is None:
            played = list(recorded(model, values, job))
        else:
            played = [self._dip(model, values, result.before if result else {})]
        say(f"model: {model.title}")
        table(
            ["parameter", "value", "unit"],
            [[p.name, f"{v:.6g}", p.unit] for p, v in zip(model.parameters, values, strict=True)],
        )
        report(played)
        paths = [path for k, one in enumerate(played, start=1) for path in one.write(job.folder, k)]
        for path in paths:
            say(f"  {path}")
        track(job, dict(zip(model.names, values.tolist(), strict=True)), played, paths)

    def _dip(self, model: Any, values: np.ndarray, before: Mapping[str, float]) -> "Played":
        from tractexp.model.drive import Drive, Excitation

        known = {"U0": 1.0, "P0": 1.0, "Q0": 0.5, "frequency": 50.0} | dict(before)
        known |= {name: getattr(self, name) for name in ("U0", "P0", "Q0") if getattr(self, name) is not None}
        t = np.arange(round(self.length * self.rate) + 1) / self.rate
        fallen = smooth((t - self.start) / max(self.fall, 1e-9))
        back = smooth((t - self.start - self.duration) / max(self.recovery, 1e-9))
        U = known["U0"] * (1 - self.depth * fallen * (1 - back))
        unknown = np.full(len(t), np.nan)
        nominal = 2 * np.pi * known["frequency"]
        event = Excitation(1 / self.rate, U, unknown, unknown, known["U0"], known["P0"], known["Q0"], omega_n=nominal)
        drive = Drive.of([event])
        if refusal := model.refusal(values, drive):
            raise UserError(refusal)
        response = model.simulate(drive, values, model.substeps(drive, values)[0])
        title = f"dip of {self.depth:.0%} for {self.duration:g} s"
        return Played(title, t, U, response.P[0], response.Q[0])


def smooth(x: np.ndarray) -> np.ndarray:
    """Raised cosine from 0 (x <= 0) to 1 (x >= 1)."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(x, 0.0, 1.0))


def chosen(names: tuple[str, ...], found: Mapping[str, float], given: Mapping[str, float]) -> np.ndarray:
    """Values (d,) in the model's order. Raises `UserError` for unknown names and for what is missing."""
    for name in given:
        if name not in names:
            raise UserError(
                f"task.values.{name}: this model has no parameter '{name}'{among(name, names, 'Parameters')}"
            )
    values = {**found, **given}
    if missing := [name for name in names if name not in values]:
        raise UserError(
            f"no value for {', '.join(missing)}: give task.parameters=result.json of an identification,"
            f" or task.values={{{', '.join(f'{name}: ...' for name in missing)}}}"
        )
    return np.array([values[name] for name in names], dtype=float)


def _model(result: Any, job: Job) -> Any:
    from tractexp.identification.result import parts
    from tractexp.model.model import compose

    return compose(*parts(result.model)) if result else job.model


@dataclass(frozen=True, eq=False)
class Played:
    """One event played through the model; `measured` and `epsilon` (of Eq. (20)) where it was recorded."""

    title: str
    t: np.ndarray
    U: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    measured: tuple[np.ndarray, np.ndarray] | None = None
    epsilon: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    def write(self, folder: Path, number: int) -> list[Path]:
        """response.csv and response.svg, with a number from the second event on."""
        from tractexp.report import figures

        stem = folder / ("response" if number == 1 else f"response_{number}")
        columns = {"t": self.t, "U": self.U, "P": self.P, "Q": self.Q}
        if self.measured:
            columns |= {"P_measured": self.measured[0], "Q_measured": self.measured[1]}
        rows = np.column_stack(list(columns.values()))
        path = stem.with_suffix(".csv")
        np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")
        figure = stem.with_suffix(".svg")
        calculated = self.P, self.Q
        if self.measured and self.epsilon:
            figures.fit(
                figure,
                self.t,
                self.U,
                self.measured,
                calculated,
                title=self.title,
                epsilon=self.epsilon,
                notes=self.notes,
            )
        else:
            figures.response(figure, self.t, self.U, calculated, title=self.title, notes=self.notes)
        return [path, figure]


def recorded(model: Any, values: np.ndarray, job: Job) -> Iterator[Played]:
    """The recorded events, fitted and held out alike, played through the model."""
    from tractexp.identification.result import respond

    events = job.events()
    for event in (*events.train, *events.validate):
        fit, record = respond(model, values, event, "validate"), event.record
        measured, epsilon = (record.P, record.Q), (fit.epsilon_p, fit.epsilon_q)
        yield Played(record.name, record.t, record.U, fit.P, fit.Q, measured, epsilon, tuple(record.notes))


def report(played: list[Played]) -> None:
    """Print what each response amounts to."""
    rows = []
    for one in played:
        errors = [f"{e:.3%}" for e in one.epsilon] if one.epsilon else ["", ""]
        rows.append(
            [
                one.title,
                *(f"{v:.4f}" for v in (one.U.min(), one.P.min(), one.P.max(), one.Q.min(), one.Q.max())),
                *errors,
            ]
        )
    table(["event", "U min", "P min", "P max", "Q min", "Q max", "epsilon_p", "epsilon_q"], rows)


def track(job: Job, values: dict[str, float], played: list[Played], paths: list[Path]) -> None:
    metrics = {}
    for k, one in enumerate(played, start=1):
        if one.epsilon:
            metrics |= {f"event_{k}_epsilon_p": one.epsilon[0], f"event_{k}_epsilon_q": one.epsilon[1]}
    job.log(name="simulation", values=values, metrics=metrics, artifacts=[*paths, job.folder / ".hydra"])
