"""The identified load before its dip: how its power divides, what the motor is as a machine, and
whether it could be.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.errors import UserError
from tractexp.exchange.format import Identified
from tractexp.identification.division import doubt_division
from tractexp.identification.result import Result
from tractexp.identification.verdict import rests_on_bound
from tractexp.text.wording import write_quantity


@dataclass(frozen=True)
class OperatingPoint:
    """The powers before the first fitted event, and the motor there.

    Attributes
    ----------
    P, Q, P_motor, Q_motor : float
        Of the load and of its motor, in `units`.
    slip : float
        Per unit of the nominal speed.
    H : float or None [s]
        On the motor's own apparent power; None where this motor has no such figure.
    starting : float or None
        Current at standstill over that before the dip.
    units : (str, str)
        MW and Mvar, or per unit of the file.
    """

    P: float
    Q: float
    P_motor: float
    Q_motor: float
    slip: float
    H: float | None
    starting: float | None
    units: tuple[str, str]

    @classmethod
    def from_result(cls, result: Result) -> "OperatingPoint | None":
        """None where the model has no motor, or no steady state of its own."""
        own = result.base
        load = Identified(result)
        try:
            before = load.steady_state
        except UserError:
            return None
        if "P_motor" not in before or "Q_motor" not in before:
            return None
        scale = own.power if own.in_mva else own.ratio
        units = ("MW", "Mvar") if own.in_mva else ("pu", "pu")
        P, Q = result.before["P0"], result.before["Q0"]
        P_motor, Q_motor = before["P_motor"], before["Q_motor"]
        S = float(np.hypot(P_motor, Q_motor))
        slip = -before.get("omega_before", 0.0) / load.omega_n
        H = load.inertia / S if "M" in load.values and S else None
        starting = None
        if {"T_prime", "X_prime", "C"} <= load.values.keys() and S:
            starting = result.before["U0"] ** 2 / (S * abs(load.circuit.impedance(1.0)))
        return cls(scale * P, scale * Q, scale * P_motor, scale * Q_motor, slip, H, starting, units)

    @property
    def share(self) -> float:
        """The motor's part of the active power; of use where that is drawn."""
        return self.P_motor / self.P if self.P else float("inf")

    @property
    def machine(self) -> str:
        """The motor's share, and what it is as a machine, in a line."""
        share = [f"{self.share:.0%} of P"] if self.P > 0 else []
        return ", ".join([*share, *self._figures])

    @property
    def _figures(self) -> list[str]:
        """Slip, H and starting current, a clause each."""
        machine = [f"slip {100 * self.slip:.2g} %"]
        if self.H is not None:
            machine.append(
                f"H {self.H:.2g} s on its own"
                f" {'MVA' if self.units[0] == 'MW' else 'apparent power'}"
            )
        if self.starting is not None:
            machine.append(f"starting current {self.starting:.2g} times that before the dip")
        return machine

    def __str__(self) -> str:
        """Powers, slip, inertia and starting current in a line."""
        share = f", {self.share:.0%} of P" if self.P > 0 else ""
        motor = self._write_power(self.P_motor, self.Q_motor) + share
        static = self._write_power(self.P - self.P_motor, self.Q - self.Q_motor)
        figures = ", ".join(self._figures)
        return f"before the dip: motor {motor}; static load {static}; {figures}"

    def _write_power(self, P: float, Q: float) -> str:
        """Active and reactive power in words."""
        return " and ".join(map(write_quantity, "PQ", (P, Q), self.units))

    @property
    def doubt(self) -> str:
        """Why no load is so, in words; "" where one may be."""
        motor = complex(self.P_motor, self.Q_motor)
        return doubt_division(complex(self.P, self.Q), motor, self.units)


def list_doubts(result: Result, point: OperatingPoint | None) -> list[str]:
    """The reasons why an identified load is no physical one, a clause each: its division between
    motor and static part, and parameters that a bound alone holds.

    The end of a physical range is no such bound: what that costs is told beside the fit.
    """
    resting = [
        name
        for name, verdict in result.verdicts.items()
        if rests_on_bound(verdict) and name not in result.nuisances
    ]
    held = f"{', '.join(resting)} {'is' if len(resting) == 1 else 'are'} held by a bound alone"
    return [*([point.doubt] if point and point.doubt else []), *([held] if resting else [])]
