"""An induction motor as its T-circuit: rotor flux linkages and speed, the air-gap node solved at
every instant.

Source: Krause, Wasynczuk and Sudhoff 2002, chapters 4 (flux linkages) and 8 (stator transients
neglected); Lesenne, Notelet and Seguier 1981 for the saturated air-gap node. Per unit of the
motor's own rating, in the frame that turns with the bus voltage.
"""

from dataclasses import dataclass, replace

import numpy as np

from hidden_effects.supply import Moment
from independent.machine import Machine
from independent.source import OMEGA


@dataclass(frozen=True)
class Motor:
    """A group of motors of `rating` [pu of the record's base]; each further field is a piece of
    physics, off at 0.

    States: rotor flux linkage, speed, then those of the second cage and of the stator where there
    are any.
    """

    machine: Machine
    rating: float
    torque: float  # pu of the rating, at the speed before the event
    # share of the torque that grows with the square of the speed, or with another power of it
    fan: float = 0.0
    fan_power: float = 2.0
    head: float = 0.0  # speed below which that share is nothing: a pump's, against a static head
    saturation: float = 0.0  # relative growth of the magnetizing current per pu² of air-gap flux
    ceiling: bool = False  # the magnetizing curve is Froelich's, flux bounded, instead
    # of the air-gap flux before the event: below it the core is straight, above it a table's line
    knee: float = 0.0
    cage: float = 0.0  # a second, outer cage: its admittance over the standard one's
    cage_resistance: float = 6.0  # of the outer cage, over the inner one's, at cage = 1
    braking: float = 0.0  # share of the negative-sequence current and torque
    stator: bool = False  # stator transients
    speed: float = 0.0  # pu, before the event; set by `settled`
    flux: float = 0.0  # pu², square of the air-gap flux before the event; set by `settled`

    def settled(self, V: complex) -> tuple["Motor", list[complex]]:
        """The motor in the steady state on the voltage V [pu], and its states; raises `Stall` if
        there is none.
        """
        stator, rotor, speed = self.machine.steady_state(V, self.torque).tolist()
        states = [rotor, speed.real]
        if self.cage:
            states = self._settled_with_cage(V, states)
        if self.stator:
            states.append(stator)
        gap = self.circuit(V, states)[0]
        return replace(self, speed=states[1].real, flux=abs(gap) ** 2), states

    def _settled_with_cage(self, V: complex, states: list[complex]) -> list[complex]:
        from scipy.optimize import fsolve

        still = replace(self, speed=states[1], stator=False)
        now = Moment(0.0, abs(V), 1.0, 0.0, 0.0, 0.0)

        def rates(x: np.ndarray) -> list[float]:
            at = [complex(x[0], x[1]), x[2], complex(x[3], x[4])]
            rotor, swing, outer = still.flow(now, V, at)[1]
            return [
                rotor.real / OMEGA,
                rotor.imag / OMEGA,
                swing.real,
                outer.real / OMEGA,
                outer.imag / OMEGA,
            ]

        begin = [states[0].real, states[0].imag, states[1], states[0].real, states[0].imag]
        x = fsolve(rates, begin, xtol=1e-13).tolist()
        return [complex(x[0], x[1]), x[2], complex(x[3], x[4])]

    def circuit(self, V: complex, x: list[complex]) -> tuple[complex, complex]:
        """Air-gap flux and stator current: the node where stator, cages and magnetizing branch
        meet.
        """
        m = self.machine
        admittance, source = 1 / m.Xr, x[0] / m.Xr
        if self.cage:
            admittance += self.cage / m.Xr
            source += x[2] * self.cage / m.Xr
        if self.stator:
            admittance += 1 / m.Xs
            source += x[-1] / m.Xs
        else:
            leakage = m.Rs + 1j * m.Xs
            admittance += 1j / leakage
            source += V / leakage
        gap = source / (admittance + 1 / m.Xm)
        if self.saturation and self.speed:
            gap = self._saturated(gap, admittance, source)
        return gap, (x[-1] - gap) / m.Xs if self.stator else (V - 1j * gap) / leakage

    def _saturated(self, gap: complex, admittance: complex, source: complex) -> complex:
        """The node with a magnetizing curve: i_m = psi/Xm (1 + k (|psi|² - |psi_0|²)), by repeated
        substitution.
        """
        Xm, k = self.machine.Xm, self.saturation
        for _ in range(60):
            last, gap = gap, source / (admittance + self._magnetizing(abs(gap), k) / Xm)
            if abs(gap - last) < 1e-13:
                return gap
        raise ArithmeticError(
            f"the saturated air gap does not settle at a flux of {abs(gap):.3g} pu"
        )

    def _magnetizing(self, psi: float, k: float) -> float:
        """Magnetizing admittance over that before: cubic, by Froelich's curve of the ceiling 1/k of
        the flux before (psi = a i/(b + i)), or by the table (knee, 1 - k), (flux before, 1).
        """
        if self.ceiling:
            return (1 - k) / (1 - k * min(psi / self.flux**0.5, 1.1))
        if not self.knee:
            return 1 + k * (psi**2 - self.flux)
        knee, before = self.knee * self.flux**0.5, self.flux**0.5
        return 1 - k * (1 - max(psi - knee, 0.0) / (before - knee))

    def negative(self, now: Moment, speed: float) -> tuple[complex, float]:
        """Negative-sequence power [pu] and its braking torque, from the equivalent circuit at slip
        2 - s.
        """
        m, slip = self.machine, now.f + speed
        rotor = m.Rr / slip + 1j * m.Xr
        gap = 1j * m.Xm * rotor / (1j * m.Xm + rotor)
        current = now.U2 / (m.Rs + 1j * m.Xs + gap)
        power = self.braking * now.U2 * current.conjugate()
        return power, self.braking * abs(current * gap / rotor) ** 2 * m.Rr / slip

    def driven(self, w: float) -> float:
        """What fans and pumps ask for at the speed w over that before, over what they asked for
        then.
        """
        lost = self.head**self.fan_power
        return max(max(w, 0.0) ** self.fan_power - lost, 0.0) / (1 - lost)

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        """Current on the record's base [pu] and the time derivative of the states [1/s]."""
        m, speed = self.machine, x[1].real
        gap, current = self.circuit(V, x)
        slip = now.f - speed
        load = self.torque
        if self.fan:
            load *= 1 - self.fan + self.fan * self.driven(speed / self.speed)
        torque = (gap.conjugate() * current).imag - load
        drawn = current
        if self.braking and now.U2:
            power, brake = self.negative(now, speed)
            torque -= brake
            drawn = current + (power / V).conjugate()  # the meter adds up three phases
        rates = [OMEGA * (-m.Rr * (x[0] - gap) / m.Xr - 1j * slip * x[0]), torque / (2 * m.H)]
        if self.cage:
            Rc = self.cage_resistance * m.Rr / self.cage
            rates.append(OMEGA * (-Rc * (x[2] - gap) * self.cage / m.Xr - 1j * slip * x[2]))
        if self.stator:
            rates.append(OMEGA * (V - m.Rs * current - 1j * now.f * x[-1]))
        return self.rating * drawn, rates
