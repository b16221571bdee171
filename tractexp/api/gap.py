"""How far a model is from its events before effects are added to it, and after."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tractexp.errors import UserError


@dataclass(frozen=True)
class Misfit:
    """How far a model is from some events: the model's error {value, interval} of the response,
    relative errors of Eq. (20), and chi-squared per sample.

    `epsilon_i` is that of the currents, where those are compared.
    """

    model_error: Mapping[str, Any]
    epsilon_p: float
    epsilon_q: float
    chi2_per_sample: float | None
    epsilon_i: float | None = None


@dataclass(frozen=True)
class Gap:
    """The misfit of the base model and of the extended one; `closed` is the share of the squared
    error that went.
    """

    before: Misfit
    after: Misfit
    closed: float | None


class NoGap:
    """In place of a gap on held-out events where there are none: it is false, and whatever is asked
    of it raises a `UserError` that says why.
    """

    def __bool__(self) -> bool:
        """False: there is no gap."""
        return False

    def __getattr__(self, name: str) -> Any:
        """Raise `UserError` that says how to hold an event out."""
        if name.startswith("__"):
            raise AttributeError(name)
        raise UserError(
            f"no event was held out, so nothing is known of its {name}: give one to"
            " tractexp.investigate(..., validate=...)"
        )

    def __repr__(self) -> str:
        """That no event was held out."""
        return "no event was held out"


@dataclass(frozen=True)
class Gaps:
    """On the fitted and on the held-out events."""

    train: Gap
    validate: Gap | NoGap
    fitted_to_both: bool
