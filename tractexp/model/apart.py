"""The equations as one of several machines at the bus writes into them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import sympy

from tractexp.errors import UserError
from tractexp.kernel.graph import Symbol
from tractexp.model.sites import Site

if TYPE_CHECKING:
    from tractexp.model.equations import Equations


class Apart:
    """A view of `Equations` that ends every name in a suffix: what a second motor declares is a
    second motor.

    What it puts at sites are quantities with a name like any other, for a site belongs to the
    first; what it only reads (voltages, speeds, the words of the equations) is everyone's.
    """

    def __init__(self, eq: "Equations", suffix: str):
        """The equations of the model, for a motor group whose words end in `suffix`."""
        self._eq, self._suffix = eq, suffix

    def __getattr__(self, name: str) -> Any:
        """A word that all groups share."""
        return getattr(self._eq, name)

    def __contains__(self, what: Site | str) -> bool:
        """Whether this group has a site or a quantity."""
        return self._add_suffix(what) in self._eq

    def __getitem__(self, what: Site | str) -> Symbol:
        """The symbol at a site or of a word of this group, else of the whole model."""
        return self._eq[self._add_suffix(what) if what in self else what]

    def _add_suffix(self, what: Site | str) -> str:
        """The word of this group."""
        return (what.name if isinstance(what, Site) else what) + self._suffix

    def _latex(self, latex: str) -> str:
        """The symbol with the group's suffix."""
        return rf"{{{latex}}}{self._suffix}"

    @property
    def omega(self) -> Symbol:
        """The speed of this machine."""
        return self._eq["omega" + self._suffix]

    def define(self, name: str, expression: sympy.Expr, latex: str) -> Symbol:
        """Define a quantity of this group."""
        return self._eq.define(name + self._suffix, expression, self._latex(latex))

    def place(self, site: Site, expression: sympy.Expr, latex: str | None = None) -> Symbol:
        """Put an expression at a site of this group."""
        return self.define(site.name, expression, latex or site.latex)

    def compute(
        self, name: str, expression: sympy.Expr, before: sympy.Expr | None = None
    ) -> Symbol:
        """Compute a quantity of this group once per sample."""
        return self._eq.compute(name + self._suffix, expression, before)

    def edit(
        self, site: Site | str, change: Callable[[sympy.Expr], sympy.Expr], shown: object = None
    ) -> None:
        """Raise `UserError`: of several groups only effects edit sites."""
        raise UserError(
            f"a motor edits the site {site}; of several motor groups only effects edit sites"
        )

    def flux(self, name: str, latex: str) -> Symbol:
        """A state of this group that is a flux."""
        return self._eq.flux(name + self._suffix, self._latex(latex))

    def lag(self, name: str, latex: str) -> Symbol:
        """A state of this group that follows late."""
        return self._eq.lag(name + self._suffix, self._latex(latex))

    def lag_vector(self, name: str, latex: str) -> Symbol:
        """A complex state of this group that follows late."""
        return self._eq.lag_vector(name + self._suffix, self._latex(latex))

    def memory(self, name: str, latex: str) -> Symbol:
        """A value of this group that is kept from sample to sample."""
        return self._eq.memory(name + self._suffix, self._latex(latex))

    def speed(self, latex: str = r"\omega") -> Symbol:
        """The speed of this group."""
        return self._eq.speed(self._latex(latex), "omega" + self._suffix)

    def branch(self, name: str, latex: str, *circuit: Any, **further: Any) -> sympy.Expr:
        """The current of a branch of this group."""
        return self._eq.branch(name + self._suffix, self._latex(latex), *circuit, **further)

    def require(self, slack: sympy.Expr, sentence: str, shown: sympy.Expr | None = None) -> None:
        """A condition on this group's parameters, whose sentence names the group."""
        self._eq.require(slack, f"of motor group {self._suffix.strip('_')}: {sentence}", shown)
