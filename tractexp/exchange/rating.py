"""A motor on its own rating: the figures that a planner compares with a data sheet, beside those of
typical machines.

No record tells what is written on the motors' plates. Their rating is taken to be what they draw
before the dip, in apparent power: at a lower loading X' and X are larger in
proportion, and H is smaller.
"""

from dataclasses import dataclass
from functools import cache
from math import pi, sqrt

import numpy as np

from tractexp.errors import UserError
from tractexp.exchange.circuit import TCircuit
from tractexp.exchange.format import Identified
from tractexp.identification.result import Result

SOURCE = (
    "IEEE Task Force on Load Representation 1995, IEEE Trans. Power Systems 10(3) 1302, seven types"
    " of induction motor, from small industrial to air conditioners"
)
NOMINAL_SPEED = 2 * pi * 60  # rad/s, of the types
# R_s, X_s, X_m, R_1, X_1 [pu of the rating], H [s]. The article itself was not at hand: R_s, X_s
# and R_1 of the water pump were found again elsewhere, as defaults of a public library's motor.
TYPES = (
    (0.031, 0.100, 3.20, 0.018, 0.180, 0.70),  # small industrial motor
    (0.013, 0.067, 3.80, 0.009, 0.170, 1.50),  # large industrial motor
    (0.013, 0.140, 2.40, 0.009, 0.120, 0.80),  # water pump
    (0.013, 0.140, 2.40, 0.009, 0.120, 1.50),  # power plant auxiliary
    (0.077, 0.107, 2.22, 0.079, 0.098, 0.74),  # aggregate of residential motors
    (0.035, 0.094, 2.80, 0.048, 0.163, 0.93),  # aggregate of residential and industrial motors
    (0.064, 0.091, 2.23, 0.059, 0.071, 0.34),  # aggregate of air conditioners
)
ABOUT = {
    "X_prime": ("transient reactance X'", "pu"),
    "X": ("open-circuit reactance X", "pu"),
    "T0_prime": ("open-circuit time constant T0'", "s"),
    "H": ("inertia constant H", "s"),
    "slip": ("slip at the rating", "%"),
    "starting": ("starting current over that at the rating", "1"),
}


@dataclass(frozen=True)
class RatedQuantity:
    """A figure of the motor on its own rating.

    Attributes
    ----------
    name, about, unit : str
        Its name, what it is, and its unit.
    value : float
        Of this motor.
    low, high : float
        The least and the largest of typical machines.
    """

    name: str
    about: str
    value: float
    unit: str
    low: float
    high: float

    @property
    def place(self) -> str:
        """Where the value lies: `within`, `below` or `above` what is typical."""
        if self.low <= self.value <= self.high:
            return "within"
        return "below" if self.value < self.low else "above"


@dataclass(frozen=True)
class RatedMachine:
    """The motor's rating, per unit of the fit, and its figures on it."""

    rating: float
    quantities: tuple[RatedQuantity, ...]


def compute_rating(result: Result) -> float:
    """The apparent power that the motor draws before the dip [pu of the fit].

    It stands for the motor's rating. Raises `UserError` where the model has no motor that draws
    power.
    """
    before = Identified(result).steady_state
    drawn = float(np.hypot(before.get("P_motor", 0.0), before.get("Q_motor", 0.0)))
    if not drawn > 0:
        raise UserError("the model has no motor that draws power, so there is no rating of one")
    return drawn


def rate_machine(result: Result) -> RatedMachine:
    """The motor of a model on its own rating, beside typical machines.

    Parameters
    ----------
    result : Result
        The identification.

    Returns
    -------
    RatedMachine

    Raises
    ------
    UserError
        Where the model has no motor, or none that is a single machine.
    """
    rating = compute_rating(result)
    load = Identified(result, ratio=1 / rating)
    if lacking := {"T_prime", "X_prime", "C", "M"} - load.values.keys():
        raise UserError(
            f"the motor '{result.model['motor']['name']}' has no {sorted(lacking)[0]}, so that its"
            " figures are those of no single machine"
        )
    circuit, slip = load.circuit, -load.steady_state.get("omega_before", 0.0) / load.omega_n
    own, typical = _list_figures(circuit, load.inertia, slip), compute_typical_figures()
    return RatedMachine(
        rating,
        tuple(
            RatedQuantity(name, about, own[name], unit, *typical[name])
            for name, (about, unit) in ABOUT.items()
        ),
    )


@cache
def compute_typical_figures() -> dict[str, tuple[float, float]]:
    """The least and the largest of each figure among the types of motor."""
    rows = []
    for *elements, inertia in TYPES:
        circuit = TCircuit(NOMINAL_SPEED, *elements)
        rows.append(_list_figures(circuit, inertia, _find_rated_slip(circuit)))
    return {name: (min(r[name] for r in rows), max(r[name] for r in rows)) for name in ABOUT}


def _list_figures(circuit: TCircuit, inertia: float, slip: float) -> dict[str, float]:
    """The figures of a circuit per unit of its rating, by their names."""
    running, standing = (abs(circuit.impedance(s)) for s in (slip, 1.0))
    return {
        "X_prime": circuit.X_prime,
        "X": circuit.X,
        "T0_prime": circuit.T0_prime,
        "H": inertia,
        "slip": 100 * slip,
        "starting": running / standing,
    }


def _find_rated_slip(circuit: TCircuit) -> float:
    """The slip at which a machine of one cage draws its rated current at nominal voltage.

    There its impedance is 1, which is a quadratic equation in R_1 over the slip.
    """
    rotor = circuit.X_1 + circuit.X_m
    blocked = circuit.X_s * rotor + circuit.X_m * circuit.X_1
    a = circuit.R_s**2 + circuit.X**2 - 1
    b = circuit.R_s * circuit.X_m**2
    c = blocked**2 + (circuit.R_s * rotor) ** 2 - rotor**2
    return circuit.R_1 * a / (sqrt(b**2 - a * c) - b)
