"""What stands at the sites of a model, which of its effects edit it, and which others could."""

from collections.abc import Collection, Mapping
from typing import Protocol

from tractexp.blocks import Table
from tractexp.configuration.plugin import discover, get
from tractexp.errors import UserError
from tractexp.model.model import Model
from tractexp.model.sites import SITES


class HoldsModel(Protocol):
    """An object that carries a composed model, as `tractexp.compose` gives."""

    @property
    def model(self) -> Model:
        """The composed model, which simulates."""
        ...


def sites(model: "Model | HoldsModel") -> Table:
    """The sites of a model: what stands at each, which of its effects edit it, and which other ones
    could.

    Every registered effect is tried on the model, which takes seconds the first time and is
    remembered then.

    Parameters
    ----------
    model : LoadModel or Model
        As `tractexp.compose` makes one.

    Returns
    -------
    Table
        A row for each site: its name, the part that owns it, kind, unit, what it is, the expression
        there, and the effects.

    Raises
    ------
    UserError
        For anything that is no model.
    """
    model = getattr(model, "model", model)  # what compose() returns carries it
    if not isinstance(model, Model):
        raise UserError(
            f"sites() takes a model, as compose() makes one, not a {type(model).__name__}"
        )
    eq = model.equations
    effects = discover().get("effect", {})
    here = {effect.name for effect in model.effects}
    could = {
        name: model.acceptance(get("effect", name)()).edits for name in effects if name not in here
    }
    rows = []
    for s in (site for site in SITES.values() if site in eq):
        by = _name_editors(eq.edits, s.name), _name_editors(could, s.name)
        rows.append((s.name, s.owner, s.kind, s.unit, s.about, str(eq.expression(s)), *by))
    columns = (
        "site",
        "of",
        "kind",
        "unit",
        "what",
        "expression",
        "edited by",
        "could be edited by",
    )
    return Table(columns, rows, f"Sites of {model.title}")


def _name_editors(edits: Mapping[str, Collection[str]], site: str) -> str:
    """The effects that edit a site, by {effect: sites}, with commas."""
    return ", ".join(sorted(name for name, edited in edits.items() if site in edited))
