"""What is fitted in an investigation, for the analytic tests of its steps."""

from made_dips import FEW, base

from tractexp.inference.base_fit import fit_base_model
from tractexp.inference.catalogue import build_catalogue
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.records import Records


def bench(model, made, only=FEW, bounds=None, **settings):
    """The free numbers of a model and of some effects beside these events."""
    missing = build_catalogue(model, made, only)
    records = Records.from_events(made)
    return Context.from_records(
        model, missing, records, bounds or {}, {}, Criteria(), Effort(), **settings
    )


def fitted_base(made, only=FEW):
    """The base model as it fits these events by itself."""
    return fit_base_model(bench(base(), made, only))
