"""The bases a load is composed of. A part writes its equations into the declaration; nothing else."""

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tractexp.plugin import Plugin

if TYPE_CHECKING:
    from tractexp.model.drive import Drive
    from tractexp.model.equations import Equations


class Part(Plugin):
    """A part of a load that draws power of its own.

    `reads` names the recorded channels (`f`, `U2`) without which its parameters cannot be identified.
    """

    reads: ClassVar[tuple[str, ...]] = ()

    def declare(self, eq: "Equations") -> None:
        """Declare parameters, states and named quantities in `eq`, and what the part draws (`eq.consume`)."""


class Motor(Part):
    """Base of the motor plugins, chosen by `model/motor=NAME`."""

    group: ClassVar[str] = "model/motor"


class Static(Part):
    """Base of the static load plugins, chosen by `model/static=NAME`.

    A static load draws `eq.P_s0` and `eq.Q_s0` before the event: what the other parts leave.
    """

    group: ClassVar[str] = "model/static"


class Effect(Plugin):
    """Base of the effects a model may lack, named in `model.effects=[...]`: an edit of the equations.

    The parameters that say how large the effect is have a `null` at which the edited equations are the unedited
    ones; `relevant` is the smallest departure from it that matters. The others vanish there, and `grid` names the
    values of each at which to look for the effect. `needs` names the quantities it edits or uses, `reads` the
    recorded channels without which it cannot be seen (`f`, `U2`), `confused_with` the effects that look alike on
    ordinary dips.
    """

    group: ClassVar[str] = "effect"
    chosen: ClassVar[bool] = False
    order: ClassVar[int] = 0  # edits of a higher order come later: those that copy what others have edited
    needs: ClassVar[tuple[str, ...]] = ()
    reads: ClassVar[tuple[str, ...]] = ()
    grid: ClassVar[dict[str, tuple[float, ...]]] = {}
    relevant: ClassVar[dict[str, float]] = {}
    confused_with: ClassVar[tuple[str, ...]] = ()

    def refusal(self, eq: "Equations") -> str | None:
        """Why this effect makes no sense for the equations in `eq`, as a sentence; None where it does."""
        missing = [name for name in self.needs if not eq.has(name)]
        return f"its equations have no {' and no '.join(missing)}" if missing else None

    def edit(self, eq: "Equations") -> None:
        """Edit the declared equations: rename nothing, add what is new, call `eq.edit` on what changes."""


class Measurement(Effect):
    """Base of the effects of the measurement chain: they act on the calculated power, not on the equations."""

    def edit(self, eq: "Equations") -> None:
        eq.declare(self.parameters)

    def observe(self, power: np.ndarray, drive: "Drive", values: dict[str, np.ndarray]) -> np.ndarray:
        """P and Q (2, n, N) as the recorder would show them; `values` {parameter: (E, n)}."""
        return power
