"""Parameters that others' simulators were run with, recovered from their records: python
benchmarks/recovery.py

A numbered table of cases, like the PEtab test suite: a load of known parameters, played by ANDES or
by motulator, is identified by the public calls from what it drew, and each parameter must come back
within the tolerance of its case. Tolerances are a few times what was reached when the case was
added. Those of ANDES come from its trapezoidal steps of 1 ms; motulator integrates to 1e-10. No
case holds noise: what is tested is the way from a record to a parameter.
"""

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import andes_check
import motulator_check
import numpy as np

import tractexp
from tractexp.configuration.plugin import build
from tractexp.exchange.format import Identified
from tractexp.record import Event, Record, detect
from tractexp.record.phasor_measurement import measure
from tractexp.record.record import Base
from tractexp.record.waves import Waves
from tractexp.recording.estimator import estimator_of

STEP = 1e-3  # s, of ANDES
RATE, BEFORE = 5000.0, 10  # Hz of motulator's samples, and cycles before the dip
ESTIMATOR = {"name": "one_cycle"}
POWER_BEFORE = {"U0": 1.0, "P0": 1.0, "Q0": 0.6, "frequency": andes_check.FREQUENCY}


@dataclass(frozen=True)
class Case:
    """A load and what must come back: `within` is {name or "one / other": relative tolerance}.

    `model` are the arguments of `compose`, `truth` the load's values, `depths` those of ANDES's
    dips.
    """

    number: int
    title: str
    simulator: str
    model: Mapping[str, object]
    truth: Mapping[str, float]
    within: Mapping[str, float]
    depths: tuple[float, ...] = (0.4,)
    bounds: Mapping[str, list[float]] = field(default_factory=dict)

    @property
    def interpreter(self) -> str | None:
        """A Python that has the simulator, or None."""
        return SIMULATORS[self.simulator][0]()

    def records(self) -> list[Event]:
        """The dips that the simulator makes of the load."""
        return SIMULATORS[self.simulator][1](self)


def by_andes(case: Case) -> list[Event]:
    """The load's tables as they are exported, played in ANDES."""
    settings = {
        "motor": {"name": case.model["motor"]},
        "static": {"name": case.model["static"]},
        "effects": list(case.model.get("effects", ())),
    }
    load = Identified(andes_check.result(dict(case.truth), settings, POWER_BEFORE))
    tables = json.loads(build("format", {"name": "andes"}).text(load))
    records = []
    for depth in case.depths:
        seen = andes_check.andes(tables, andes_check.dip(STEP, depth=depth), STEP)
        f = andes_check.FREQUENCY + np.gradient(seen["angle"], STEP, edge_order=2) / (2 * np.pi)
        t = np.arange(len(f)) * STEP
        records += tractexp.read(
            t=t, U=seen["U"], P=seen["P"], Q=seen["Q"], f=f, name=f"dip of {depth:.0%}"
        )
    return records


def by_motulator(case: Case) -> list[Event]:
    """Samples of motulator's machine, and the phasors that a recorder would keep of them."""
    seen = motulator_check.theirs(RATE)
    turn = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]
    samples = np.concatenate([np.real(seen["u"] * turn), np.real(seen["i"] * turn)]) / 1e3  # kV, kA
    cycle = samples[:, : round(RATE / motulator_check.FREQUENCY)]  # the first one is before the dip
    samples = np.concatenate([np.tile(cycle, BEFORE), samples], axis=1)
    kV, kA = motulator_check.PEAK / 1e3, motulator_check.RATED / 1e3
    base = Base(np.sqrt(1.5) * kV, 1.5 * kV * kA, motulator_check.FREQUENCY)
    phasors = measure(
        samples, RATE, motulator_check.FREQUENCY, 0.0, window=estimator_of(ESTIMATOR).averager
    )
    powers = {"U": phasors.U, "P": phasors.S.real, "Q": phasors.S.imag, "U2": phasors.U2}
    waves = Waves(samples, 0.0, RATE, ESTIMATOR)
    record = Record(
        "machine",
        t=phasors.t,
        f=phasors.f,
        base=base,
        source="motulator",
        waves=waves,
        **base.per_unit(powers),
    )
    return [detect(record.check())]


SIMULATORS: dict[str, tuple[Callable[[], str | None], Callable[[Case], list[Event]]]] = {
    "ANDES": (andes_check.interpreter, by_andes),
    "motulator": (motulator_check.interpreter, by_motulator),
}

MOTOR, CAGES = andes_check.EXPORTS["electromechanical"], andes_check.EXPORTS["double_cage"]
EXPONENTS, COMPOSITION = andes_check.STATICS["exponential"], andes_check.STATICS["zip"]
PLAIN = {"T_prime": 1e-3, "M": 1e-3, "T_m": 2e-4}  # what every record of a motor sees

CASES = (
    Case(
        1,
        "third-order motor, exponential load (Motor3, FLoad)",
        "ANDES",
        {"motor": "electromechanical", "static": "exponential"},
        MOTOR | EXPONENTS,
        PLAIN | {"X_prime": 2e-3, "C": 2e-3, "p_v": 5e-4, "q_v": 2e-2},
        (0.4, 0.25),
    ),
    Case(
        2,
        "third-order motor, ZIP load (Motor3, ZIP)",
        "ANDES",
        {"motor": "electromechanical", "static": "zip"},
        MOTOR | COMPOSITION,
        PLAIN | {"C / X_prime": 2e-3, "a_Z": 1e-2, "a_I": 1e-2},
        (0.4, 0.25),
    ),
    Case(
        3,
        "third-order motor, constant impedance: C and X' are one number",
        "ANDES",
        {"motor": "electromechanical", "static": "constant_impedance"},
        MOTOR,
        PLAIN | {"C / X_prime": 1e-3},
    ),
    Case(
        4,
        "double cage, exponential load (Motor5, FLoad)",
        "ANDES",
        {"motor": "double_cage", "static": "exponential"},
        CAGES | EXPONENTS,
        PLAIN
        | {
            "X_prime": 3e-3,
            "C": 3e-3,
            "T_second": 1e-2,
            "X_second": 5e-3,
            "p_v": 5e-4,
            "q_v": 3e-2,
        },
        (0.4, 0.25),
    ),
    Case(
        5,
        "third-order motor with stator resistance, exponential load (Motor3, FLoad)",
        "ANDES",
        {"motor": "electromechanical", "static": "exponential", "effects": ["stator_resistance"]},
        MOTOR | EXPONENTS | {"R_s": 0.02},
        PLAIN | {"R_s": 5e-3, "C": 2e-3, "X_prime": 2e-3, "p_v": 5e-4},
        (0.4, 0.25),
    ),
    Case(
        6,
        "fifth-order motor in waveforms, an unbalanced dip (2.2 kW induction machine)",
        "motulator",
        {"motor": "stator_flux", "static": "none", "domain": "waves"},
        motulator_check.parameters(),
        dict.fromkeys(["T_prime", "X_prime", "C", "M", "T_m", "R_s"], 1e-5),
        bounds={"M": [1e-4, 0.05]},
    ),
)


def identified(case: Case) -> dict[str, float]:
    """The values that come back from the records of a case, in the base of its truth."""
    model = tractexp.compose(**case.model, bounds=dict(case.bounds))
    fit = tractexp.identify(
        case.records(),
        model,
        optimizer="multistart_least_squares",
        seed=1,
        check_intervals=False,
        progress=False,
    )
    return {name: estimate.value for name, estimate in fit.on_given_base.items()}


def errors(case: Case, values: Mapping[str, float]) -> dict[str, float]:
    """The relative error of each parameter, or ratio of two, that a case says is recovered."""
    return {name: abs(ratio(values, name) / ratio(case.truth, name) - 1) for name in case.within}


def ratio(values: Mapping[str, float], name: str) -> float:
    """The value of a name, or of "one / other"."""
    one, _, other = name.partition(" / ")
    return values[one] / values[other] if other else values[one]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("numbers", nargs="*", type=int, help="of the cases; by default all")
    chosen = parser.parse_args().numbers
    for case in CASES:
        if chosen and case.number not in chosen:
            continue
        print(f"{case.number:04d} {case.simulator}: {case.title}")
        if case.interpreter is None:
            print(f"     {case.simulator} is not installed")
            continue
        for name, error in errors(case, identified(case)).items():
            print(f"     {name:<12} off by {error:.1e}, within {case.within[name]:.0e}")


if __name__ == "__main__":
    main()
