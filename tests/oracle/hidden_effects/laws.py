"""Effects of the catalogue's kinds by other laws and at other places: what nature does that uses no
formula of ours.

Each belongs to the family of a catalogue's effect, `FAMILY` says which; its formula is not that
effect's, and that of another plugin only where `MEMBERS_LAW` says so. Circuits of constant elements
(resistance, feeder, capacitor, negative sequence, a second group) and definitions (skew, window,
powers of the frequency) have one law; all other effects have two and more that no plugin has.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hidden_effects.controls import (
    CurrentControlled,
    DeadBand,
    Held,
    InputFilter,
    IntegralLink,
    Ramped,
    Rectifier,
    ResistiveInrush,
    Staged,
    SusceptanceControl,
    SwitchedBanks,
    SynchronousMotor,
    Tapped,
    Thermostat,
    TwoPaces,
    VoltageLink,
)
from hidden_effects.devices import Converter, Inrush, Link
from hidden_effects.effects import UndervoltageTrip
from hidden_effects.hidden import Hidden, beside, lowest, motors
from hidden_effects.site import Site
from hidden_effects.supply import Profile, Relay
from independent.source import OMEGA, Dip

STAGES = (0.9, 0.8, 0.7)  # levels over the voltage before


def together(site: Site, relays: Sequence[Relay]) -> Profile:
    """How many of some relays have acted."""
    opened = [r.opened(site.dip, site.recorder.duration) for r in relays]
    knots = sorted({t for profile in opened for t in profile.times})
    return Profile(tuple(knots), tuple(sum(profile(t) for profile in opened) for t in knots))


@dataclass(frozen=True)
class StaticTrip(UndervoltageTrip):
    """The relay opens a share of the static load only: contactors of lighting and electronics."""

    reference, largest, unit = 0.1, 0.9, "1"

    def apply(self, site: Site) -> Site:
        return replace(
            site, static_opened=self.amount * self.relay.opened(site.dip, site.recorder.duration)
        )


@dataclass(frozen=True)
class MotorTrip(UndervoltageTrip):
    """The relay opens a share of the motors only."""

    reference, largest, unit = 0.1, 0.9, "1"

    def apply(self, site: Site) -> Site:
        return replace(
            site, motors_opened=self.amount * self.relay.opened(site.dip, site.recorder.duration)
        )


@dataclass(frozen=True)
class TwoStageTrip(UndervoltageTrip):
    """A second relay, later and for deeper dips, opens as much again; both return as the first
    does.
    """

    reference, largest, unit = 0.05, 0.45, "1"
    further: float = 0.85  # level of the second relay over that of the first
    later: float = 0.1  # s, delay of the second beyond the first

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {**super().details(rng, dips), "later": float(rng.uniform(0.03, 0.08))}

    def apply(self, site: Site) -> Site:
        first = self.relay
        second = replace(
            first,
            level=self.further * self.level,
            delay=self.delay + self.later,
            wait=self.wait + 0.15,
        )
        return replace(site, opened=self.amount * together(site, (first, second)))


@dataclass(frozen=True)
class InverseTimeTrip(UndervoltageTrip):
    """A relay that waits less the deeper the dip: its delay falls with what the voltage lacks to
    its level.

    Source: inverse-time undervoltage characteristics, t = k/(1 - U/U_s), as IEC 60255-127 has them.
    """

    def apply(self, site: Site) -> Site:
        delay = 0.3 * self.delay / max(1 - lowest([site.dip]) / self.level, 0.05)
        relay = replace(self.relay, delay=delay)
        return replace(site, opened=self.amount * relay.opened(site.dip, site.recorder.duration))


@dataclass(frozen=True)
class ContactorsOneByOne(UndervoltageTrip):
    """Five contactors of as much load each, with levels about the relay's and waits
    of their own.
    """

    def apply(self, site: Site) -> Site:
        contactors = [
            Relay(
                self.level + 0.02 * k,
                self.reset + 0.01 * k,
                self.delay * (1 + 0.1 * k),
                self.wait + 0.06 * k,
                0.01,
            )
            for k in range(-2, 3)
        ]
        return replace(site, opened=self.amount / len(contactors) * together(site, contactors))


@dataclass(frozen=True)
class DriftFromDip(Hidden):
    """Customers switch on after they noticed the dip: the static load grows steadily from its
    beginning.
    """

    reference, largest, unit = 0.02, 0.3, "1/s"

    def apply(self, site: Site) -> Site:
        static = replace(site.static, growth=self.amount * site.S, grows_from=site.dip.start)
        return replace(site, static=static, breaks=(*site.breaks, site.dip.start))


@dataclass(frozen=True)
class KneeSaturation(Hidden):
    """A magnetizing table with a knee: straight below it, a line up to the flux before the event.

    `amount` is by how much the magnetizing admittance falls until the knee is reached.
    """

    reference, largest, unit = 0.3, 0.9, "1"
    knee: float = 0.8

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"knee": float(rng.uniform(0.75, 0.9))}

    def apply(self, site: Site) -> Site:
        return motors(site, saturation=self.amount, knee=self.knee)


@dataclass(frozen=True)
class ActivePowerDrift(Hidden):
    """Heating is switched on, customer by customer: active power alone grows."""

    reference, largest, unit = 0.01, 0.3, "1/s"

    def apply(self, site: Site) -> Site:
        return replace(site, static=replace(site.static, growth=complex(self.amount * site.S.real)))


@dataclass(frozen=True)
class AcceleratingDrift(Hidden):
    """Customers who come faster and faster: the static load grows with the square of time."""

    reference, largest, unit = 0.01, 0.3, "1/s²"

    def apply(self, site: Site) -> Site:
        t = np.linspace(0.0, site.recorder.duration, 101)
        grown = Profile(tuple(t.tolist()), tuple((-self.amount * t**2).tolist()))
        return replace(site, static_opened=grown)


@dataclass(frozen=True)
class FroelichSaturation(Hidden):
    """A magnetizing curve of bounded flux, psi = a i/(b + i); `amount` is the flux before the event
    over a.

    Source: Froelich 1881, as in Kundur 1994, section 3.8.2 among representations of saturation.
    """

    reference, largest, unit = 0.4, 0.85, "1"

    def apply(self, site: Site) -> Site:
        return motors(site, saturation=self.amount, ceiling=True)


@dataclass(frozen=True)
class ViscousTorque(Hidden):
    """A share of the driven machines are conveyors and extruders, whose torque grows with the
    speed.
    """

    reference, largest, unit = 0.7, 1.0, "1"

    def apply(self, site: Site) -> Site:
        return motors(site, fan=self.amount, fan_power=1.0)


@dataclass(frozen=True)
class StaticHeadTorque(Hidden):
    """A share of the driven machines pump against a height: below a speed they move nothing."""

    reference, largest, unit = 0.3, 1.0, "1"
    head: float = 0.8

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"head": float(rng.uniform(0.6, 0.85))}

    def apply(self, site: Site) -> Site:
        return motors(site, fan=self.amount, head=self.head)


@dataclass(frozen=True)
class RectifiedPower(Hidden):
    """Diode bridges that feed constant dc power: commutation costs voltage and power factor."""

    reference, largest, unit = 0.15, 0.9, "1"
    overlap: float = 0.12

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"overlap": float(rng.uniform(0.06, 0.18))}

    def apply(self, site: Site) -> Site:
        return beside(site, Rectifier(self.amount * site.S.real, overlap=self.overlap))


@dataclass(frozen=True)
class CurrentLoopConverter(Hidden):
    """Converters with a current loop and an integrator of their power."""

    reference, largest, unit = 0.2, 0.9, "1"
    rate: float = 80.0
    limit: float = 1.3

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"rate": float(rng.uniform(60.0, 120.0)), "limit": float(rng.uniform(1.1, 1.5))}

    def apply(self, site: Site) -> Site:
        return beside(
            site, CurrentControlled(self.amount * site.S.real, rate=self.rate, limit=self.limit)
        )


@dataclass(frozen=True)
class FleetOfConverters(Hidden):
    """Converters of five sizes, more or less loaded, so that they reach their limits of current one
    after the other.
    """

    reference, largest, unit = 0.15, 0.9, "1"
    spread: float = 0.15

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"spread": float(rng.uniform(0.1, 0.25))}

    def apply(self, site: Site) -> Site:
        power, limits = self.amount * site.S.real / 5, 1.3 + self.spread * np.linspace(-1, 1, 5)
        return beside(
            site, *(Converter(power, limit=limit, filter=0.004) for limit in limits.tolist())
        )


@dataclass(frozen=True)
class DelayedPowerLimit(Hidden):
    """Trains that must take less where the line voltage is low, which they measure over some
    cycles.
    """

    reference, largest, unit = 0.15, 0.9, "1"
    measured: float = 0.05

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"measured": float(rng.uniform(0.03, 0.08))}

    def apply(self, site: Site) -> Site:
        power = self.amount * site.S.real
        return beside(
            site, Converter(power, full=0.9, empty=0.7, rest=0.1, limit=1.5, filter=self.measured)
        )


@dataclass(frozen=True)
class StagedPowerLimit(Hidden):
    """Trains that give up their power in three stages, each with a level and a time of its own."""

    reference, largest, unit = 0.15, 0.9, "1"
    delay: float = 0.02
    wait: float = 0.2

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"delay": float(rng.uniform(0.01, 0.04)), "wait": float(rng.uniform(0.1, 0.4))}

    def apply(self, site: Site) -> Site:
        stages = [
            Relay(level, level + 0.03, self.delay, self.wait * k, 0.1)
            for k, level in enumerate(STAGES, 1)
        ]
        profile = together(site, stages)
        device = Staged(self.amount * site.S.real, profile=1 / len(stages) * profile)
        return replace(beside(site, device), breaks=(*site.breaks, *profile.times))


@dataclass(frozen=True)
class HeldPowerLimit(Hidden):
    """Trains that give up power along a curve at once, and take it back slowly and only once the
    line is back.
    """

    reference, largest, unit = 0.15, 0.9, "1"
    rate: float = 1.0

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"rate": float(rng.uniform(0.7, 3.0))}

    def apply(self, site: Site) -> Site:
        return beside(site, Held(self.amount * site.S.real, rate=self.rate))


@dataclass(frozen=True)
class FleetPowerLimit(Hidden):
    """A fleet of five sorts of trains, each of which begins to take less at a level of its own and
    ends at another.
    """

    reference, largest, unit = 0.15, 0.9, "1"
    spread: float = 0.1

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"spread": float(rng.uniform(0.06, 0.14))}

    def apply(self, site: Site) -> Site:
        power, levels = self.amount * site.S.real / 5, 0.88 + self.spread * np.linspace(-1, 1, 5)
        alike = Converter(power, rest=0.2, limit=1.5, filter=0.006)
        return beside(
            site, *(replace(alike, full=full, empty=full - 0.15) for full in levels.tolist())
        )


@dataclass(frozen=True)
class LinkVoltageControl(Hidden):
    """Converters that control the voltage of their dc link, with a limit of current."""

    reference, largest, unit = 0.15, 0.9, "1"
    lag: float = 0.05

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"lag": float(rng.uniform(0.02, 0.08))}

    def apply(self, site: Site) -> Site:
        storage = 0.06
        return beside(
            site, VoltageLink(self.amount * site.S.real, storage=storage, gain=storage / self.lag)
        )


@dataclass(frozen=True)
class LinkWithIntegralControl(Hidden):
    """Converters whose control of the dc voltage has an integral part, so that the link swings back
    to its voltage.
    """

    reference, largest, unit = 0.15, 0.9, "1"
    frequency: float = 4.0

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"frequency": float(rng.uniform(2.0, 6.0))}

    def apply(self, site: Site) -> Site:
        return beside(site, IntegralLink(self.amount * site.S.real, frequency=self.frequency))


@dataclass(frozen=True)
class RampedReturn(Hidden):
    """Converters that drop their current with the voltage and take it back along a ramp."""

    reference, largest, unit = 0.1, 0.9, "1"
    rate: float = 5.0

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"rate": float(rng.uniform(2.0, 8.0))}

    def apply(self, site: Site) -> Site:
        return beside(site, Ramped(self.amount * site.S.real, rate=self.rate))


@dataclass(frozen=True)
class FleetOfLinks(Hidden):
    """Converters of two generations, whose dc links store little and much."""

    reference, largest, unit = 0.1, 0.9, "1"
    quick: float = 0.02
    slow: float = 0.2

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"quick": float(rng.uniform(0.01, 0.03)), "slow": float(rng.uniform(0.12, 0.3))}

    def apply(self, site: Site) -> Site:
        power = self.amount * site.S.real / 2
        return beside(site, *(Link.lagging(power, lag) for lag in (self.quick, self.slow)))


@dataclass(frozen=True)
class FilterOscillation(Hidden):
    """Drives of constant power that ring with their input filters."""

    reference, largest, unit = 0.1, 0.9, "1"
    frequency: float = 4.0
    damping: float = 0.08

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {
            "frequency": float(rng.uniform(2.0, 8.0)),
            "damping": float(rng.uniform(0.05, 0.15)),
        }

    def apply(self, site: Site) -> Site:
        return beside(
            site,
            InputFilter(self.amount * site.S.real, frequency=self.frequency, damping=self.damping),
        )


@dataclass(frozen=True)
class SynchronousSwing(Hidden):
    """A rotary frequency converter swings against the grid after each dip."""

    reference, largest, unit = 0.1, 0.9, "1"
    frequency: float = 2.5
    damping: float = 0.08

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {
            "frequency": float(rng.uniform(1.5, 3.5)),
            "damping": float(rng.uniform(0.05, 0.15)),
        }

    def apply(self, site: Site) -> Site:
        return beside(
            site,
            SynchronousMotor(
                self.amount * site.S.real, frequency=self.frequency, damping=self.damping
            ),
        )


@dataclass(frozen=True)
class IntegralCompensator(Hidden):
    """A thyristor-controlled compensator that integrates what the voltage lacks."""

    reference, largest, unit = 0.05, 1.0, "pu"
    integral: float = 120.0

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"integral": float(rng.uniform(60.0, 240.0))}

    def apply(self, site: Site) -> Site:
        return beside(site, SusceptanceControl(self.amount, integral=self.integral))


@dataclass(frozen=True)
class SwitchedCapacitors(Hidden):
    """Capacitor banks that thyristors switch in one after the other while the voltage is low."""

    reference, largest, unit = 0.05, 1.0, "pu"
    delay: float = 0.02

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"delay": float(rng.uniform(0.01, 0.03))}

    def apply(self, site: Site) -> Site:
        banks = [Relay(level, level + 0.02, self.delay, self.delay, 1e-3) for level in STAGES]
        profile = together(site, banks)
        device = SwitchedBanks(self.amount, profile=1 / len(banks) * profile)
        return replace(beside(site, device), breaks=(*site.breaks, *profile.times))


@dataclass(frozen=True)
class ThermostatRecovery(Hidden):
    """Heating under thermostats comes back to its heat, and overshoots when the voltage returns."""

    reference, largest, unit = 0.15, 0.9, "1"
    pace: float = 0.5

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"pace": float(rng.uniform(0.3, 1.2))}

    def apply(self, site: Site) -> Site:
        return beside(site, Thermostat(self.amount * site.S.real, pace=self.pace))


@dataclass(frozen=True)
class TapRecovery(Hidden):
    """A share of the load stands behind a transformer whose quick tap changer restores its voltage
    step by step.
    """

    reference, largest, unit = 0.3, 0.9, "1"
    pause: float = 0.1
    step: float = 0.02

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"pause": float(rng.uniform(0.05, 0.15))}

    def apply(self, site: Site) -> Site:
        t = np.arange(0.0, site.recorder.duration, self.pause / 50)
        ratio, since, changes = 0.0, 0.0, []
        for now, u in zip(
            t.tolist(), (site.dip.magnitude(t) / site.dip.before).tolist(), strict=True
        ):
            off = 1 - u * (1 + ratio)
            since = now if abs(off) < self.step else since
            if now - since >= self.pause and abs(ratio + np.sign(off) * self.step) < 0.15:
                ratio, since = float(ratio + np.sign(off) * self.step), now
                changes.append((now, ratio))
        profile = Profile.steps(0.0, *changes) if changes else Profile()
        device = Tapped(self.amount * site.S.real, profile=profile)
        return replace(beside(site, device), breaks=(*site.breaks, *profile.times))


@dataclass(frozen=True)
class RecoveryAtTwoPaces(Hidden):
    """Load that comes back to its current, some of it soon, such as drives, and some of it late,
    such as processes.
    """

    reference, largest, unit = 0.3, 0.9, "1"
    soon: float = 0.1
    late: float = 1.0

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"soon": float(rng.uniform(0.05, 0.15)), "late": float(rng.uniform(0.6, 1.5))}

    def apply(self, site: Site) -> Site:
        return beside(site, TwoPaces(self.amount * site.S.real, soon=self.soon, late=self.late))


@dataclass(frozen=True)
class DeadBandCompensator(Hidden):
    """A compensator that does nothing within a band of the voltage and whose current changes
    slowly.
    """

    reference, largest, unit = 0.05, 1.0, "pu"
    band: float = 0.08
    rate: float = 10.0

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"band": float(rng.uniform(0.04, 0.12)), "rate": float(rng.uniform(5.0, 20.0))}

    def apply(self, site: Site) -> Site:
        return beside(site, DeadBand(self.amount, band=self.band, rate=self.rate))


@dataclass(frozen=True)
class InrushWithResistance(Hidden):
    """Cores driven into saturation, whose offset the current's own resistance drives back, fast at
    first.
    """

    reference, largest, unit = 0.3, 10.0, "pu"

    def apply(self, site: Site) -> Site:
        return beside(site, ResistiveInrush(self.amount, site.dip.depth, decay=1.0))


@dataclass(frozen=True)
class InrushByInstant(Hidden):
    """Inrush whose offset is set by the instant at which the voltage returns, another in each
    event.
    """

    reference, largest, unit = 0.3, 10.0, "pu"
    decay: float = 0.3

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"decay": float(rng.uniform(0.15, 0.6))}

    def apply(self, site: Site) -> Site:
        turned = abs(np.cos(OMEGA * (site.dip.start + site.dip.duration)))
        offset = 0.4 + 0.6 * float(turned)
        return beside(site, Inrush(self.amount, site.dip.depth, self.decay, offset=offset))


LAWS = {
    "static_part_trip": StaticTrip,
    "motor_share_trip": MotorTrip,
    "trip_in_two_stages": TwoStageTrip,
    "inverse_time_trip": InverseTimeTrip,
    "contactors_one_by_one": ContactorsOneByOne,
    "drift_that_begins_at_the_dip": DriftFromDip,
    "drift_of_active_power": ActivePowerDrift,
    "accelerating_drift": AcceleratingDrift,
    "knee_saturation": KneeSaturation,
    "froelich_saturation": FroelichSaturation,
    "viscous_torque": ViscousTorque,
    "static_head_torque": StaticHeadTorque,
    "rectified_power": RectifiedPower,
    "current_loop_converter": CurrentLoopConverter,
    "fleet_of_converters": FleetOfConverters,
    "delayed_power_limit": DelayedPowerLimit,
    "staged_power_limit": StagedPowerLimit,
    "held_power_limit": HeldPowerLimit,
    "fleet_power_limit": FleetPowerLimit,
    "link_voltage_control": LinkVoltageControl,
    "link_with_integral_control": LinkWithIntegralControl,
    "ramped_return": RampedReturn,
    "fleet_of_links": FleetOfLinks,
    "filter_oscillation": FilterOscillation,
    "synchronous_swing": SynchronousSwing,
    "integral_compensator": IntegralCompensator,
    "switched_capacitors": SwitchedCapacitors,
    "dead_band_compensator": DeadBandCompensator,
    "thermostat_recovery": ThermostatRecovery,
    "tap_recovery": TapRecovery,
    "recovery_at_two_paces": RecoveryAtTwoPaces,
    "inrush_with_resistance": InrushWithResistance,
    "inrush_by_instant": InrushByInstant,
}
FAMILY = {
    "static_part_trip": "undervoltage_trip",
    "motor_share_trip": "undervoltage_trip",
    "trip_in_two_stages": "undervoltage_trip",
    "inverse_time_trip": "undervoltage_trip",
    "contactors_one_by_one": "undervoltage_trip",
    "drift_that_begins_at_the_dip": "load_change",
    "drift_of_active_power": "load_change",
    "accelerating_drift": "load_change",
    "knee_saturation": "magnetic_saturation",
    "froelich_saturation": "magnetic_saturation",
    "viscous_torque": "speed_dependent_torque",
    "static_head_torque": "speed_dependent_torque",
    "rectified_power": "constant_power_converter",
    "current_loop_converter": "constant_power_converter",
    "fleet_of_converters": "constant_power_converter",
    "delayed_power_limit": "voltage_dependent_power_limit",
    "staged_power_limit": "voltage_dependent_power_limit",
    "held_power_limit": "voltage_dependent_power_limit",
    "fleet_power_limit": "voltage_dependent_power_limit",
    "link_voltage_control": "dc_link_lag",
    "ramped_return": "dc_link_lag",
    "fleet_of_links": "dc_link_lag",
    "link_with_integral_control": "dc_link_lag",
    "filter_oscillation": "low_frequency_oscillation",
    "synchronous_swing": "low_frequency_oscillation",
    "integral_compensator": "static_var_compensator",
    "switched_capacitors": "static_var_compensator",
    "dead_band_compensator": "static_var_compensator",
    "thermostat_recovery": "exponential_recovery",
    "tap_recovery": "exponential_recovery",
    "recovery_at_two_paces": "exponential_recovery",
    "inrush_with_resistance": "transformer_inrush",
    "inrush_by_instant": "transformer_inrush",
}
# hidden laws that members of families were built to tell: by other code, no longer by another law
MEMBERS_LAW = {
    "static_part_trip": "static_trip",
    "motor_share_trip": "motor_trip",
    "trip_in_two_stages": "two_stage_trip",
    "drift_that_begins_at_the_dip": "load_change_from_dip",
    "rectified_power": "rectifier",
    "delayed_power_limit": "power_limit_curve",
    "ramped_return": "ramped_current",
    "thermostat_recovery": "thermostatic_load",
    "switched_capacitors": "switched_banks",
    "staged_power_limit": "staged_power_limit",
    "link_voltage_control": "limited_link",
}
