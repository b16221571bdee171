"""The two bases a load is composed of. A plugin declares its equations; nothing else."""

from typing import TYPE_CHECKING, ClassVar

from tractexp.plugin import Plugin

if TYPE_CHECKING:
    import sympy

    from tractexp.model.equations import Equations


class Motor(Plugin):
    """Base of the motor plugins, chosen by `model/motor=NAME`."""

    group: ClassVar[str] = "model/motor"

    def declare(self, eq: "Equations") -> "tuple[sympy.Expr, sympy.Expr]":
        """Write the states into `eq` and return the motor's P and Q in its states and inputs."""


class Static(Plugin):
    """Base of the static load plugins, chosen by `model/static=NAME`."""

    group: ClassVar[str] = "model/static"

    def declare(self, eq: "Equations", P_s0: "sympy.Symbol", Q_s0: "sympy.Symbol") -> "tuple[sympy.Expr, sympy.Expr]":
        """Return the static load's P and Q; `P_s0`, `Q_s0` are what the motor leaves before the event."""
