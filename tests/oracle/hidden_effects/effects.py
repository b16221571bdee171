"""The catalogue's effects, hidden: each is built of physics in `motor`, `devices`, `site` and
`recorder`.

An amount is on the record's base. Names are those of the catalogue; nothing of its plugins is used.
"""

from dataclasses import dataclass, replace

from hidden_effects.devices import Capacitor, Converter, Inrush, Link, Statcom
from hidden_effects.hidden import Hidden, beside, lowest, motors, split
from hidden_effects.site import Site
from hidden_effects.supply import Relay


@dataclass(frozen=True)
class StatorResistance(Hidden):
    """Copper in the stator branch of the T-circuit."""

    reference, unit = 0.02, "pu"

    def apply(self, site: Site) -> Site:
        changed = (
            replace(m, machine=replace(m.machine, Rs=m.machine.Rs + self.amount * m.rating))
            for m in site.motors
        )
        return replace(site, motors=tuple(changed))


@dataclass(frozen=True)
class SpeedDependentTorque(Hidden):
    """A share of the driven machines are fans and pumps, whose torque grows with the square of the
    speed.
    """

    reference, largest, unit = 0.5, 1.0, "1"

    def apply(self, site: Site) -> Site:
        return motors(site, fan=self.amount)


@dataclass(frozen=True)
class MagneticSaturation(Hidden):
    """A cubic magnetizing curve of the air gap, which leaves Xm at its value before the event as it
    is.
    """

    reference, largest, unit = 0.4, 2.5, "1/pu²"

    def apply(self, site: Site) -> Site:
        return motors(site, saturation=self.amount)


@dataclass(frozen=True)
class SecondMotorGroup(Hidden):
    """A share of the motors has another inertia."""

    reference, largest, unit = 0.15, 0.9, "1"
    ratio: float = 4.0

    @classmethod
    def details(cls, rng, dips):
        return {"ratio": float(rng.choice([1 / 3, 3.0, 4.0, 6.0]))}

    def apply(self, site: Site) -> Site:
        first = site.motors[0]
        slower = replace(first, machine=replace(first.machine, H=self.ratio * first.machine.H))
        return split(site, self.amount, slower)


@dataclass(frozen=True)
class FrequencyDependence(Hidden):
    """The static load goes with powers of the frequency: `amount` for P, `reactive` times as much
    for Q.
    """

    reference, largest, unit = 1.5, 20.0, "1"
    needs = "swing"
    reactive: float = -0.7

    def apply(self, site: Site) -> Site:
        return replace(
            site, static=replace(site.static, k_p=self.amount, k_q=self.reactive * self.amount)
        )


@dataclass(frozen=True)
class ExponentialRecovery(Hidden):
    """Thermostats and tap changers within: active power creeps back towards a smaller exponent."""

    reference, largest, unit = 0.6, 4.0, "1"
    pace: float = 0.6

    @classmethod
    def details(cls, rng, dips):
        return {"pace": float(rng.uniform(0.3, 1.2))}

    def apply(self, site: Site) -> Site:
        return replace(site, static=replace(site.static, recovery=self.amount, pace=self.pace))


@dataclass(frozen=True)
class UndervoltageTrip(Hidden):
    """A relay with timers opens a share of the whole load; contactors bring it back
    along a ramp.
    """

    reference, largest, unit = 0.05, 0.9, "1"
    level: float = 0.8
    reset: float = 0.9
    delay: float = 0.04
    wait: float = 0.3
    ramp: float = 0.2

    @classmethod
    def details(cls, rng, dips):
        # some dip gets below it
        level = max(0.45, 1 - float(rng.uniform(0.4, 0.8)) * (1 - lowest(dips)))
        delay = float(rng.uniform(0.2, 0.5)) * min(d.duration for d in dips)
        return {
            "level": level,
            "reset": max(level, 0.85),
            "delay": delay,
            "wait": float(rng.uniform(0.1, 0.5)),
            "ramp": float(rng.uniform(0.02, 0.4)),
        }

    @property
    def relay(self) -> Relay:
        return Relay(self.level, self.reset, self.delay, self.wait, self.ramp)

    def apply(self, site: Site) -> Site:
        return replace(
            site, opened=self.amount * self.relay.opened(site.dip, site.recorder.duration)
        )


@dataclass(frozen=True)
class ConstantPowerConverter(Hidden):
    """Converters with a current limit, of `amount` times the power before, in place of
    static load.
    """

    reference, largest, unit = 0.2, 0.9, "1"
    limit: float = 1.3

    @classmethod
    def details(cls, rng, dips):
        return {"limit": float(rng.uniform(1.05, 1.5))}

    def apply(self, site: Site) -> Site:
        return beside(site, Converter(self.amount * site.S.real, limit=self.limit))


@dataclass(frozen=True)
class VoltageDependentPowerLimit(Hidden):
    """Trains that must take less where the line voltage is low: all at `full`, auxiliaries only at
    `empty`.
    """

    reference, largest, unit = 0.15, 0.9, "1"
    full: float = 0.9
    empty: float = 0.7
    rest: float = 0.1

    def apply(self, site: Site) -> Site:
        power = self.amount * site.S.real
        return beside(
            site, Converter(power, full=self.full, empty=self.empty, rest=self.rest, limit=1.5)
        )


@dataclass(frozen=True)
class DcLinkLag(Hidden):
    """Converters whose dc link restores their power with a lag."""

    reference, largest, unit = 0.15, 0.9, "1"
    lag: float = 0.05

    @classmethod
    def details(cls, rng, dips):
        return {"lag": float(rng.uniform(0.02, 0.1))}

    def apply(self, site: Site) -> Site:
        return beside(site, Link.lagging(self.amount * site.S.real, self.lag))


@dataclass(frozen=True)
class FeederImpedance(Hidden):
    """The whole load stands behind R + jX; `amount` is X."""

    reference, largest, unit = 0.04, 0.35, "pu"
    ratio: float = 0.4  # R/X

    @classmethod
    def details(cls, rng, dips):
        return {"ratio": float(rng.uniform(0.2, 0.8))}

    def apply(self, site: Site) -> Site:
        return replace(site, feeder=self.amount * (self.ratio + 1j))


@dataclass(frozen=True)
class ShuntCapacitor(Hidden):
    """A fixed bank, which gives with the square of the voltage and with frequency; no larger than
    what it serves.
    """

    reference, largest, unit = 0.3, 0.5, "pu"

    def apply(self, site: Site) -> Site:
        return beside(site, Capacitor(self.amount))


@dataclass(frozen=True)
class NegativeSequenceBraking(Hidden):
    """The motors' negative-sequence circuit brakes and draws power; 1 is what the
    T-circuit says.
    """

    reference, largest, unit = 1.0, 8.0, "1"
    needs = "negative"

    def apply(self, site: Site) -> Site:
        return motors(site, braking=self.amount)


@dataclass(frozen=True)
class TransformerInrush(Hidden):
    """Cores driven into saturation as the voltage returns; `amount` is their saturated
    susceptance.
    """

    reference, largest, unit = 0.3, 10.0, "pu"
    decay: float = 0.3

    @classmethod
    def details(cls, rng, dips):
        return {"decay": float(rng.uniform(0.15, 0.6))}

    def apply(self, site: Site) -> Site:
        return beside(site, Inrush(self.amount, site.dip.depth, self.decay))


@dataclass(frozen=True)
class LowFrequencyOscillation(Hidden):
    """Converters whose dc-link control is badly damped ring after each change of the voltage."""

    reference, largest, unit = 0.1, 0.9, "1"
    frequency: float = 4.0
    damping: float = 0.08

    @classmethod
    def details(cls, rng, dips):
        return {
            "frequency": float(rng.uniform(2.0, 8.0)),
            "damping": float(rng.uniform(0.04, 0.15)),
        }

    def apply(self, site: Site) -> Site:
        return beside(site, Link.ringing(self.amount * site.S.real, self.frequency, self.damping))


@dataclass(frozen=True)
class StaticVarCompensator(Hidden):
    """A compensator that gives reactive current while the voltage is low; `amount`
    is its rating.
    """

    reference, largest, unit = 0.05, 1.0, "pu"
    delay: float = 0.03

    @classmethod
    def details(cls, rng, dips):
        return {"delay": float(rng.uniform(0.01, 0.05))}

    def apply(self, site: Site) -> Site:
        return beside(site, Statcom(self.amount, delay=self.delay))


@dataclass(frozen=True)
class TimeSkew(Hidden):
    """Power reaches the record later than the voltage it belongs to."""

    reference, unit = 0.002, "s"

    def apply(self, site: Site) -> Site:
        return replace(site, recorder=replace(site.recorder, skew=self.amount))


@dataclass(frozen=True)
class MeasurementWindow(Hidden):
    """A transducer averages power over a window, voltage is not averaged."""

    reference, largest, unit = 0.02, 0.25, "s"

    def apply(self, site: Site) -> Site:
        return replace(site, recorder=replace(site.recorder, window=self.amount))


@dataclass(frozen=True)
class PhasorWindow(Hidden):
    """A phasor unit forms voltage and current by a discrete Fourier transform over one window: no
    effect, a nuisance.

    Both channels see the same window, so that a linear load would not show it at all.
    """

    reference, largest, unit = 0.02, 0.1, "s"

    def apply(self, site: Site) -> Site:
        return replace(site, recorder=replace(site.recorder, phasor_window=self.amount))


@dataclass(frozen=True)
class LoadChange(Hidden):
    """Customers switch on: the static load grows steadily, by `amount` of the whole power per
    second.
    """

    reference, largest, unit = 0.01, 0.3, "1/s"

    def apply(self, site: Site) -> Site:
        return replace(site, static=replace(site.static, growth=self.amount * site.S))


PHYSICAL = {
    "stator_resistance": StatorResistance,
    "speed_dependent_torque": SpeedDependentTorque,
    "magnetic_saturation": MagneticSaturation,
    "second_motor_group": SecondMotorGroup,
    "frequency_dependence": FrequencyDependence,
    "exponential_recovery": ExponentialRecovery,
    "undervoltage_trip": UndervoltageTrip,
    "constant_power_converter": ConstantPowerConverter,
    "voltage_dependent_power_limit": VoltageDependentPowerLimit,
    "dc_link_lag": DcLinkLag,
    "feeder_impedance": FeederImpedance,
    "shunt_capacitor": ShuntCapacitor,
    "negative_sequence_braking": NegativeSequenceBraking,
    "transformer_inrush": TransformerInrush,
    "low_frequency_oscillation": LowFrequencyOscillation,
    "static_var_compensator": StaticVarCompensator,
}
MEASUREMENT = {
    "time_skew": TimeSkew,
    "measurement_window": MeasurementWindow,
    "load_change": LoadChange,
}
CATALOG = PHYSICAL | MEASUREMENT
NUISANCES = MEASUREMENT | {"phasor_window": PhasorWindow}
