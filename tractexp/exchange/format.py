"""What an export is: an identified load, and the formats that write it for other simulators."""

from abc import abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from tractexp.configuration.plugin import Plugin, build, discover
from tractexp.errors import TASK, UserError
from tractexp.exchange.circuit import TCircuit
from tractexp.identification.result import Result, build_parts
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import Model, compose
from tractexp.record.identity import label
from tractexp.record.own_base import scale_parameter
from tractexp.text.wording import join_words


@dataclass(frozen=True, eq=False)
class Identified:
    """An identified load on a bus, and the base of the export.

    Attributes
    ----------
    result : Result
        The identification.
    bus : int
        Number of the bus.
    power : float [MVA]
        One per unit of power in the export.
    voltage : float [kV]
        One per unit of voltage.
    ratio : float
        Per units of power of that base in one of the base of the fit.
    """

    result: Result
    bus: int = 1
    power: float = 100.0  # MVA
    voltage: float = 110.0  # kV
    ratio: float = 1.0

    @cached_property
    def model(self) -> Model:
        """The model in phasors, for which every format is written.

        What carries the network alone in waveforms is static load there.
        """
        motor, static, effects, integration, *_ = build_parts(self.result.model)
        own = [e for e in effects if not (e.waves_only or e.name in self.result.shown_effects)]
        return compose(motor, static, own, integration)

    @cached_property
    def values(self) -> dict[str, float]:
        """{name: value} of the parameters on the base of the export."""
        exponents = {p.name: p.power_exponent for p in self.model.parameters}
        parameters = self.result.parameters
        return {
            name: scale_parameter(value, exponents.get(name, 0), self.ratio)
            for name, value in parameters.items()
        }

    @property
    def name(self) -> str:
        """Station and load, where the record's file names them."""
        return label(self.result.identities) or "traction load"

    @property
    def omega_n(self) -> float:
        """Nominal synchronous speed [rad/s]."""
        return 2 * np.pi * self.result.before["frequency"]

    @property
    def inertia(self) -> float:
        """H [s] on the base of the export, M = 2 H/omega_n."""
        return self.values["M"] * self.omega_n / 2

    @cached_property
    def steady_state(self) -> dict[str, float]:
        """{name: value} of states and named quantities before the event, on the base of the export.

        Raises `UserError` where there is no steady state.
        """
        stored, flat = self.result.before, np.full(2, self.result.before["U0"])
        P0, Q0 = self.ratio * stored["P0"], self.ratio * stored["Q0"]
        event = Excitation(1e-3, flat, flat, flat, stored["U0"], P0, Q0, omega_n=self.omega_n)
        drive, values = (
            Drive.from_events([event]),
            np.array([self.values[name] for name in self.model.names]),
        )
        if refusal := self.model.refusal(values, drive):
            raise UserError(f"these parameters cannot be exported: {refusal}")
        return self.model.at_rest(values, drive)

    @property
    def circuit(self) -> TCircuit:
        """The motor's T-circuit: of two cages where a second one was identified."""
        names = ("T_prime", "X_prime", "C", "T_second", "X_second")
        circuit_values = {name: self.values[name] for name in names if name in self.values}
        build = TCircuit.double if "T_second" in circuit_values else TCircuit.single
        return build(**circuit_values, omega_n=self.omega_n, R_s=self.values.get("R_s", 0.0))


@dataclass(frozen=True)
class Restored:
    """A load as the numbers of a file describe it, on the base of the export.

    Attributes
    ----------
    model : mapping
        Its parts, as a model's configuration names them.
    parameters : {name: value}
        Of these.
    static : (P, Q) [pu]
        What the static part draws before the event.
    """

    model: Mapping[str, Any]
    parameters: Mapping[str, float]
    static: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Simulated:
    """The response of a load in another simulator.

    Attributes
    ----------
    by : str
        Name of the simulator.
    step : float [s]
        Between samples.
    U, P, Q : (N,) [pu of the export]
        Voltage and power.
    speed : (N,) [rad/s]
        Of the voltage's angle, relative to nominal.
    """

    by: str
    step: float
    U: np.ndarray
    speed: np.ndarray
    P: np.ndarray
    Q: np.ndarray


class Format(Plugin):
    """Base of the export formats, chosen by `task.format=NAME`.

    Attributes
    ----------
    suffix : str
        Of the file.
    motors, statics, effects : names or None
        The parts that it can represent; None: all.
    lacks : {name: reason}
        Why a part cannot be represented, where that is not plain.
    """

    group: ClassVar[str] = "format"
    chosen: ClassVar[bool] = False
    suffix: ClassVar[str]  # of the file
    motors: ClassVar[Collection[str] | None] = None  # names it can represent; None: any
    statics: ClassVar[Collection[str] | None] = None
    effects: ClassVar[Collection[str] | None] = None
    # {name of a part it cannot represent: why, where that is not plain}
    lacks: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def text(self, load: Identified) -> str:
        """The content of the file.

        Parameters
        ----------
        load : Identified
            That `check_parts` accepts.

        Returns
        -------
        str

        Raises
        ------
        UserError
            For values that the format cannot represent.
        """

    def notes(self, load: Identified) -> list[str]:
        """Sentences that a user must know to use the file."""
        return []

    def omissions(self, load: Identified) -> list[str]:
        """The properties of the motor that this format's machine lacks, a sentence each."""
        if not load.model.motor.within_a_cycle:
            return []
        return ["the stator's transients are not exported: the machine of this format has none"]

    def read_back(self, text: str, load: Identified) -> Restored | None:
        """The load that the file's own numbers describe; None where the format reads none back."""
        return None

    def play_back_dip(self, text: str, load: Identified) -> Simulated | None:
        """A dip that the simulator of this format plays through the file.

        Parameters
        ----------
        text : str
            Content of the file.
        load : Identified
            The load that was exported.

        Returns
        -------
        Simulated or None
            None where the simulator is not at hand.

        Raises
        ------
        UserError
            Where it is, and fails.
        """
        return None

    def check_parts(self, load: Identified) -> None:
        """Raise `UserError` for a part of the model that this format cannot represent, with those
        that can.
        """
        model = load.result.model
        chosen = {
            "motor": [model["motor"]["name"]],
            "static load": [model["static"]["name"]],
            "effect": [effect.name for effect in load.model.effects],
        }
        for kind, names in chosen.items():
            for name in names:
                if not self.represents(kind, name):
                    whole = f"format '{self.name}' cannot represent the {kind} '{name}'"
                    raise UserError(whole + self._instead(kind, name))

    @classmethod
    def represents(cls, kind: str, name: str) -> bool:
        """Whether this format can represent a part of the model: a "motor", a "static load" or an
        "effect".
        """
        names = cls._list_represented(kind)
        return names is None or name in names

    @classmethod
    def _list_represented(cls, kind: str) -> Collection[str] | None:
        """The parts of a kind that the format has; None: all of them."""
        return {"motor": cls.motors, "static load": cls.statics, "effect": cls.effects}[kind]

    def _instead(self, kind: str, name: str) -> str:
        """The end of a refusal: why a part cannot be represented, where that is said, what can be,
        and by which format the part itself can be.
        """
        why = f": {self.lacks[name]}" if name in self.lacks else ""
        # which refuse some yet
        formats: Mapping[str, Any] = discover()[self.group] if kind != "effect" else {}
        others = join_words(
            [other for other, cls in sorted(formats.items()) if cls.represents(kind, name)], "or"
        )
        by = f"; {TASK.format}={others} can represent '{name}'" if others else ""
        represented = ", ".join(sorted(self._list_represented(kind) or ["none"]))
        return f"{why}; it can represent {represented}{by}"


def choose_format(result: Result) -> str:
    """The first format by name that represents every part of a model; "" where none does."""
    load, formats = Identified(result), discover()[Format.group]
    for name in sorted(formats):
        try:
            build(Format.group, {"name": name}).check_parts(load)
        except UserError:
            continue
        return name
    return ""
