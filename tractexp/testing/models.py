"""The loads in which a motor, a static load or an effect is tried, and what they answer."""

import functools
from collections.abc import Callable, Iterator

import numpy as np

from tractexp.configuration.plugin import discover
from tractexp.errors import UserError
from tractexp.kernel.layout import INPUTS
from tractexp.model.drive import PHASORS, WAVES, Drive
from tractexp.model.model import Model, compose
from tractexp.model.parts import Effect, Motor, Part, Static
from tractexp.parameter import Parameter

SUBSTEPS = 4


@functools.cache
def partners() -> tuple[type[Motor], type[Static]]:
    """The registered motor and static load a contract is played with: few parameters, a flux and a
    speed that move.
    """
    motors = [cls for cls in list_registered("model/motor") if cls.parameters and _moves(cls)]
    statics = [cls for cls in list_registered("model/static") if cls.parameters and not cls.reads]
    if not (motors and statics):
        raise UserError(
            "contracts need a registered motor with flux and speed and a static load with"
            " parameters"
        )
    return tuple(
        min(classes, key=lambda cls: (len(cls.parameters), cls.name))
        for classes in (motors, statics)
    )  # type: ignore[return-value]


def _moves(cls: type[Motor]) -> bool:
    """Whether a motor has a flux and a speed that move."""
    from tractexp.model.declaration import declare_motor_alone

    return {"flux", "speed"} <= {
        s.role for s in declare_motor_alone(cls()).states.values() if s.derivative != 0
    }


def list_registered(group: str) -> list[type]:
    """The plugins of a group, in order of name."""
    return [cls for _, cls in sorted(discover().get(group, {}).items())]


@functools.cache
def model(motor: type[Motor], static: type[Static], *effects: type[Effect]) -> Model:
    """A load of these parts with default settings."""
    return compose(
        motor(), static(), [cls() for cls in effects], domain=_domain(motor, static, *effects)
    )


def _domain(*parts: type[Part]) -> str:
    """The domain in which parts are tried: waveforms where one of them makes sense only there."""
    return WAVES if any(cls.waves_only for cls in parts) else PHASORS


def with_part(cls: type[Part]) -> Model:
    """The model a motor, a static load or an effect is tried in."""
    motor, static = partners()
    if issubclass(cls, Motor):
        return model(cls, static)
    if issubclass(cls, Static):
        return model(motor, cls)
    return model(*find_base_parts(cls), cls)


@functools.cache
def build_base_model(cls: type[Effect]) -> Model:
    """The base model of an effect, in its domain."""
    motor, static = find_base_parts(cls)
    return compose(motor(), static(), domain=with_part(cls).domain)


@functools.cache
def find_base_parts(cls: type[Effect]) -> tuple[type[Motor], type[Static]]:
    """The parts of the base model of an effect: the usual partners, or the first pair that takes
    it.
    """
    for motor, static in list_bases():
        if explain_refused_base(motor, static, cls) is None:
            return motor, static
    raise AssertionError(f"no registered motor and static load take the effect '{cls.name}'")


def list_bases() -> Iterator[tuple[type[Motor], type[Static]]]:
    """The usual partners, then each registered part beside the other of them."""
    motor, static = partners()
    yield motor, static
    yield from ((other, static) for other in list_registered("model/motor") if other is not motor)
    yield from ((motor, other) for other in list_registered("model/static") if other is not static)


def explain_refused_base(motor: type[Motor], static: type[Static], cls: type[Effect]) -> str | None:
    """Why a base model refuses an effect, None where it takes it. Anything but a sentence is
    raised.
    """
    return compose(motor(), static(), domain=_domain(motor, static, cls)).acceptance(cls()).refusal


def values(
    of: Model, pick: Callable[[Parameter], float] = lambda p: p.default, only: Part | None = None
) -> np.ndarray:
    """The defaults (d,), but `pick` for the parameters of `only`, or of all."""
    chosen = of.parameters if only is None else only.parameters
    return np.array([pick(p) if p in chosen else p.default for p in of.parameters])


def choose_active_size(p: Parameter) -> float:
    """A size halfway to its farther bound; anything else at its default."""
    null = p.null
    return p.default if null is None else (null + max(p.bounds, key=lambda b: abs(b - null))) / 2


def play(of: Model, drive: Drive, chosen: np.ndarray, substeps: int = SUBSTEPS) -> np.ndarray:
    """P and Q (2, n, N) [pu], or the current in its frame and of zero sequence (3, n, N); fails at
    no rest.
    """
    response = of.simulate(drive, chosen, substeps)
    if (response.miss != 0).any():
        missed = np.atleast_2d(chosen)[int(np.argmax((response.miss != 0).any(axis=0)))]
        why = of.refusal(missed, drive)
        raise AssertionError(
            f"{of.title} has no steady state at"
            f" {dict(zip(of.names, missed.tolist(), strict=True))}: {why}"
        )
    return select_still_outputs(of, drive, response.outputs)


def select_still_outputs(of: Model, drive: Drive, outputs: np.ndarray) -> np.ndarray:
    """The outputs that stand still where the voltage turns steadily."""
    if not of.waves:
        return outputs
    rows = dict(zip(INPUTS, drive.inputs, strict=True))
    still = (outputs[0] + 1j * outputs[1]) * (rows["turn_re"] - 1j * rows["turn_im"])
    return np.stack([still.real, still.imag, outputs[2]])
