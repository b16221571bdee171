"""What an identification found: the model again, how well it fits each event, and its file `result.json`."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tractexp import files
from tractexp.errors import UserError
from tractexp.identification.problem import Problem, excitation
from tractexp.identification.search import REFUSED, Found, History
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import Model, compose
from tractexp.plugin import build
from tractexp.record import Event, find_dips

ACCEPTED = 0.05  # Eq. (20): a load model is acceptable below 5 %


def parts(node: Mapping[str, Any]) -> tuple[Any, Any, list[Any]]:
    """The motor, static load and effects a model configuration names, built."""
    effects = [build("effect", {"name": name}) for name in node.get("effects", ())]
    return build("model/motor", node["motor"]), build("model/static", node["static"]), effects


@dataclass(frozen=True, eq=False)
class Fit:
    """Measured and calculated power of one event, (N,) each, and the relative errors of Eq. (20), as fractions."""

    event: Event
    role: str  # "train" or "validate"
    P: np.ndarray  # calculated, pu
    Q: np.ndarray
    epsilon_p: float
    epsilon_q: float


def relative_error(measured: np.ndarray, calculated: np.ndarray) -> float:
    """epsilon of Eq. (20) as a fraction: RMS of the difference over RMS of the measurement, gaps left out."""
    known = np.isfinite(measured)
    return float(np.linalg.norm((calculated - measured)[known]) / np.linalg.norm(measured[known]))


def respond(model: Model, values: np.ndarray, event: Event, role: str) -> Fit:
    """Play one event through the model. Raises `UserError` where these parameters have no steady state there."""
    drive = Drive.of([excitation(event)])
    if refusal := model.refusal(values, drive):
        raise UserError(f"{event.record.name}: {refusal}")
    substeps, _ = model.substeps(drive, values)
    response = model.simulate(drive, values, substeps)
    P, Q = response.P[0], response.Q[0]
    errors = relative_error(event.record.P, P), relative_error(event.record.Q, Q)
    return Fit(event, role, P, Q, *errors)


@dataclass(frozen=True)
class Result:
    """The content of `result.json`. `model` and `before` are what it takes to simulate it again."""

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
    optimizer: str = ""
    notes: list[str] = field(default_factory=list)
    per_event: dict[str, list[float]] = field(default_factory=dict)  # of which `parameters` holds the mean
    standard_errors: dict[str, float | None] = field(default_factory=dict)  # None: not identifiable
    intervals: dict[str, list[float]] = field(default_factory=dict)  # 95 %, about the most likely values
    verdicts: dict[str, str] = field(default_factory=dict)
    uncertainty: dict[str, Any] = field(default_factory=dict)

    @property
    def acceptable(self) -> bool:
        """Whether both relative errors are below the 5 % of Eq. (20)."""
        return self.epsilon_p < ACCEPTED and self.epsilon_q < ACCEPTED

    def write(self, path: Path) -> Path:
        """Write the file in one move, so that no half-written one is ever seen."""
        return files.write(path, json.dumps(asdict(self), indent=2, ensure_ascii=False) + "\n")

    def predict(
        self,
        t: np.ndarray,
        U: np.ndarray,
        f: np.ndarray | None = None,
        P0: float | None = None,
        Q0: float | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """P and Q [pu] for a new voltage U [pu] at uniform times t [s]; f [Hz] where the frequency is known.

        The voltage before the first dip (all of it where there is none) gives the steady state. P0 and Q0 are
        the power drawn there; by default that of the event the model was identified on.
        """
        model = compose(*parts(self.model))
        t, U = np.asarray(t, dtype=float), np.asarray(U, dtype=float)
        dips = find_dips(t, U)
        steady = slice(0, max(dips[0][0], 1) if dips else None)
        nominal = 2 * np.pi * self.before["frequency"]
        omega_s = None if f is None else 2 * np.pi * np.asarray(f, dtype=float) - nominal
        drive = Drive.of(
            [
                Excitation(
                    step=float((t[-1] - t[0]) / (len(t) - 1)),
                    U=U,
                    P=np.full(len(U), np.nan),
                    Q=np.full(len(U), np.nan),
                    U0=float(U[steady].mean()),
                    P0=self.before["P0"] if P0 is None else P0,
                    Q0=self.before["Q0"] if Q0 is None else Q0,
                    omega_s=omega_s,
                    omega_s0=0.0 if omega_s is None else float(omega_s[steady].mean()),
                    omega_n=nominal,
                )
            ]
        )
        values = np.array([self.parameters[name] for name in model.names])
        if refusal := model.refusal(values, drive):
            raise UserError(refusal)
        response = model.simulate(drive, values, model.substeps(drive, values)[0])
        return response.P[0], response.Q[0]


def write_history(path: Path, history: History) -> Path:
    """Write the search as CSV, one row per iteration: simulations and seconds spent, best objective so far [pu²]."""
    rows = zip(history.simulations, history.seconds, history.objective, strict=True)
    lines = [f"{k},{n},{s:.4f},{f!r}" for k, (n, s, f) in enumerate((int(n), float(s), float(f)) for n, s, f in rows)]
    return files.write(path, "\n".join(["iteration,simulations,seconds,objective", *lines]) + "\n")


def load(path: Path) -> Result:
    """Read a `result.json`. Raises `UserError` where it is missing or not one of ours."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        return Result(**content)
    except FileNotFoundError:
        raise UserError(f"there is no result file {path}; run an identification first, it writes result.json") from None
    except (json.JSONDecodeError, TypeError) as error:
        raise UserError(f"{path} is not a result.json of an identification: {error}") from None


def conclude(
    problem: Problem, found: Found, validate: Sequence[Event], seed: int, settings: Mapping[str, Any], optimizer: str
) -> tuple[Result, list[Fit]]:
    """Judge what a search found on the fitted and the held-out events.

    Raises `UserError` where no candidate at all had a steady state.
    """
    model = problem.model
    if found.objective >= REFUSED:
        raise UserError(
            f"none of the {found.simulations} parameter sets tried could be simulated:"
            f" {model.refusal(problem.full(found.values)[0], problem.drive) or 'all diverged'};"
            " widen model.bounds or free model.fixed"
        )
    values = problem.full(found.values)[0]
    own = problem.by_event(found.values)[:, 0]
    fits = [respond(model, v, event, "train") for v, event in zip(own, problem.events, strict=True)]
    fits += [respond(model, values, event, "validate") for event in validate]
    trained = [fit for fit in fits if fit.role == "train"]
    measured = {c: np.concatenate([getattr(f.event.record, c) for f in trained]) for c in "PQ"}
    calculated = {c: np.concatenate([getattr(f, c) for f in trained]) for c in "PQ"}
    first = problem.events[0]
    result = Result(
        parameters={name: float(v) for name, v in zip(model.names, values, strict=True)},
        objective=found.objective,
        epsilon_p=relative_error(measured["P"], calculated["P"]),
        epsilon_q=relative_error(measured["Q"], calculated["Q"]),
        simulations=found.simulations,
        refused=found.refused,
        iterations=found.iterations,
        seconds=found.seconds,
        status=found.status,
        seed=seed,
        events=[
            {"name": f.event.record.name, "role": f.role, "epsilon_p": f.epsilon_p, "epsilon_q": f.epsilon_q}
            for f in fits
        ],
        at_bound=at_bound(problem, found.values),
        units={p.name: p.unit for p in problem.parameters},
        bounds={p.name: list(p.bounds) for p in problem.parameters},
        model=dict(settings),
        before={"U0": first.U0, "P0": first.P0, "Q0": first.Q0, "frequency": first.record.base.frequency},
        optimizer=optimizer,
        per_event={name: own[:, model.names.index(name)].tolist() for name in problem.per_event},
        notes=[note for f in fits for note in f.event.record.notes],
    )
    return result, fits


def at_bound(problem: Problem, values: np.ndarray, share: float = 1e-3) -> list[str]:
    """Names of the free parameters within a thousandth of their range of a bound."""
    unit = problem.space.to_unit(values)
    return [n for n, z in zip(problem.space.names, unit, strict=True) if z < share or z > 1 - share]
