"""What a part of a load does in a dip, drawn."""

import functools
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import tractexp
from tractexp.blocks import style
from tractexp.errors import UserError
from tractexp.kernel.layout import INPUTS
from tractexp.model.drive import WAVES, Drive
from tractexp.model.model import Model, compose
from tractexp.model.parts import Effect, Motor, Part
from tractexp.testing import drives, models

DEPTH = 0.4  # pu
WIDTH, HEIGHT = 4.8, 1.4  # inches, the height of a panel: legible on a phone
POWER = (("P [pu]", style.ACTIVE), ("Q [pu]", style.REACTIVE))
CURRENT = (
    ("current in phase\nwith the voltage [pu]", style.ACTIVE),
    ("current in\nquadrature [pu]", style.REACTIVE),
    ("zero-sequence\ncurrent [pu]", style.PALETTE[2]),
)


@functools.cache
def usual() -> Model:
    """The model that is identified where none is chosen."""
    return tractexp.compose().model


@functools.cache
def pair(cls: type[Part]) -> tuple[Model, Model]:
    """The load without a part and with it: the usual model and the part in it, or a load that takes
    it.

    A motor or a static load takes the place of the usual one.
    """
    base, own = usual(), cls()
    if isinstance(own, Effect):
        if cls.waves_only or base.acceptance(own).refusal is not None:
            return models.build_base_model(cls), models.with_part(cls)
        return base, compose(base.motor, base.static, [own])
    of = compose(own, base.static) if isinstance(own, Motor) else compose(base.motor, own)
    try:
        _ = of.equations
    except UserError:
        of = models.with_part(cls)
    return base, of


def values(of: Model) -> dict[str, float]:
    """Every parameter at its default, the sizes of an effect clearly beyond what matters."""
    own = {p.name for effect in of.effects for p in effect.parameters}
    return {
        p.name: models.choose_active_size(p) if p.name in own else p.default for p in of.parameters
    }


def played(of: Model, drive: Drive) -> np.ndarray | None:
    """P and Q (2, N), or currents (3, N); None where the load has no steady state
    before the dip.
    """
    try:
        return models.play(of, drive, np.array([*values(of).values()]))[:, 0]
    except AssertionError:
        return None


def draw(cls: type[Part], path: Path) -> str:
    """Draw what a part does in a dip and return the caption, in Markdown; "" where nothing can be
    drawn.
    """
    base, of = pair(cls)
    drive = drives.drive(DEPTH, domain=of.domain)
    beside = None if base.title == of.title or base.domain != of.domain else played(base, drive)
    power = played(of, drive)
    if power is None:
        return ""
    _save(drive, beside, power, CURRENT if of.waves else POWER, path)
    return _caption(of, base if beside is not None else None)


def _save(
    drive: Drive, beside: np.ndarray | None, power: np.ndarray, panels: tuple, path: Path
) -> None:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    known = [power] if beside is None else [power, beside]
    drawn = [
        k
        for k, p in enumerate(power)
        if k < 2 or max(np.abs(each[k]).max() for each in known) > 1e-6
    ]
    t = drive.inputs[INPUTS.index("t")]
    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(WIDTH, 0.5 + HEIGHT * len(drawn)), layout="constrained")
        axes = figure.subplots(len(drawn), 1, sharex=True)
        for axis, k in zip(axes, drawn, strict=True):
            if beside is not None:
                axis.plot(*style.thin(t, beside[k]), color=style.MEASURED, linewidth=2.2)
            axis.plot(*style.thin(t, power[k]), color=panels[k][1])
            axis.set_ylabel(panels[k][0])
        axes[-1].set_xlabel("t [s]")
        style.save(figure, path)


def _caption(of: Model, base: Model | None) -> str:
    how = (
        "50 ms, unbalanced and with a jump of the angle"
        if of.domain == WAVES
        else "0.15 s, while frequency sags"
    )
    grey = f"Grey: {_titled(base)}. Color: " if base else ""
    own = {p.name for effect in of.effects for p in effect.parameters if p.null is not None}
    sizes = _joined({name: value for name, value in values(of).items() if name in own})
    return f"A dip of {DEPTH:.0%} for {how}. {grey}{_titled(of)}{f', {sizes}' * bool(sizes)}."


def _titled(of: Model) -> str:
    load = f"`{of.motor.label}` motor beside `{of.static.name}` static load"
    return " with ".join([load, *(f"`{effect.name}`" for effect in of.effects)])


def _joined(sizes: Mapping[str, float]) -> str:
    return ", ".join(f"`{name}` = {value:.3g}" for name, value in sizes.items())
