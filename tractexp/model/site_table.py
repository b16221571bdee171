"""What stands at the sites of a model, and which registered effects edit it."""

from typing import Any

from tractexp.errors import UserError
from tractexp.model.model import Model
from tractexp.model.sites import SITES
from tractexp.outcome import Table
from tractexp.plugin import discover, get


def sites(model: Any) -> Table:
    """The sites of a model: what stands at each, and the registered effects that edit it.

    Every registered effect is tried on the model, which takes seconds the first time and is remembered then.
    """
    model = getattr(model, "model", model)  # what compose() returns carries it
    if not isinstance(model, Model):
        raise UserError(f"sites() takes a model, as compose() makes one, not a {type(model).__name__}")
    eq, effects = model.equations, discover().get("effect", {})
    here = {effect.name for effect in model.effects}
    edits = {name: model.acceptance(get("effect", name)()).edits for name in effects if name not in here}
    rows = []
    for s in (site for site in SITES.values() if site in eq):
        by = ", ".join(sorted(name for name, edited in edits.items() if s.name in edited))
        rows.append((s.name, s.owner, s.kind, s.unit, s.about, str(eq.expression(s)), by))
    return Table(("site", "of", "kind", "unit", "what", "expression", "edited by"), rows, f"Sites of {model.title}")
