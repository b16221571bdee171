"""The seven thresholds by which an investigation decides: what each means and where its value comes
from.

Two kinds of origin are told apart. *Derived* values follow from the false-alarm rate or from a
quantile and need no data. *Chosen* ones were set while the development set of
`benchmarks/hidden_effects_study.py` was looked at, whose seeds are the CRC-32 series of
`hidden_effects.cases.seeds`. The figures of docs/judgement.md are of the judgement set, whose seeds
follow from the hash of a later commit.

Numbers of one algorithm alone, such as tolerances of fits and numbers of draws, stand beside it.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tractexp.errors import TASK, UserError, check_range, list_allowed
from tractexp.inference.goodness_of_fit import ADEQUATE_P

DERIVED, CHOSEN = "derived", "chosen"
# Part of the false alarms that chance's draws may give to naming. With the doubts by what is left a
# level of 0.02 takes 0.029 of data sets, one of 0.04 takes 0.061: the draws lack the tail of small
# p (benchmarks/false_alarms.py).
NAMING_SHARE = 0.4


def _declare_criterion(
    default: float, bounds: tuple[float, float], about: str, origin: str, why: str
) -> Any:
    """A threshold with its bounds, its meaning, and where its value comes from."""
    return dataclasses.field(
        default=default, metadata={"bounds": bounds, "about": about, "origin": origin, "why": why}
    )


@dataclass(frozen=True)
class Criteria:
    """The decision thresholds of an investigation; set single ones by
    `task.criteria.NAME=value`.
    """

    false_alarms: float = _declare_criterion(
        0.05,
        (0.001, 0.5),
        "probability of naming or doubting anything where nothing is missing",
        DERIVED,
        "the usual level of a test; the user's to set",
    )
    adequate_p: float = _declare_criterion(
        ADEQUATE_P,
        (0.0, 1.0),
        "p of what a fit leaves, below which it leaves something",
        CHOSEN,
        "the same as in an identification",
    )
    further_name_p: float = _declare_criterion(
        1e-5,
        (0.0, 1.0),
        "p that a second name must undercut, and by which another law or place must explain more"
        " than"
        " the catalogue's, its further parameters paid for; at 0 neither is tried",
        CHOSEN,
        "a second name spoils a right first one, or patches up a wrong one",
    )
    rejected: float = _declare_criterion(
        0.05,
        (1e-9, 1.0),
        "relative likelihood, by Akaike's criterion, below which a rival is rejected",
        DERIVED,
        "one to twenty, the usual level of a test",
    )
    shown: float = _declare_criterion(
        10.8,
        (0.0, 1e6),
        "gain of the deviance by which held-out events show an explanation, and each of two effects"
        " over the other alone, and that a recorder's window must have; events of which less is"
        " expected are too mild"
        " to show one",
        DERIVED,
        "(2 x 1.645)^2: a true explanation of which so much is expected gains nothing in 5 % of"
        " cases",
    )
    divides: float = _declare_criterion(
        2.25,
        (1.0, 1e6),
        "factor by which a name must divide the error on the held-out events not to be doubted, and"
        " by which it, or all of the best sets that have it, must where it leaves more than noise",
        CHOSEN,
        "of loud development sets four effects that are there divide it by 1.7 to 4, the best"
        " imitations of five"
        " strangers by less than 1.6 but for one, by 3.6",
    )
    ahead: float = _declare_criterion(
        1.5,
        (1.0, 1e6),
        "factor by which the error of a set that leaves more than noise must be below that of"
        " any rival of its size or smaller, that of the base model with a proposed term below its"
        " own, and that of a"
        " name which only all events show below that of the base model",
        CHOSEN,
        "a right effect by a wrong formula is no farther from a wrong effect than that, and tied"
        " with it",
    )

    def __post_init__(self) -> None:
        """Raise `UserError` for a threshold out of range."""
        for item in dataclasses.fields(self):
            section = "task" if item.name == "false_alarms" else "task.criteria"
            check_range(
                f"{section}.{item.name}", getattr(self, item.name), *item.metadata["bounds"]
            )

    @classmethod
    def from_choices(cls, chosen: Mapping[str, float]) -> "Criteria":
        """The criteria with some of them chosen. Raises `UserError` for an unknown name or a value
        out of range.
        """
        names = [item.name for item in dataclasses.fields(cls)]
        for name in chosen:
            if name not in names:
                raise UserError(
                    f"{TASK.criteria}.{name}: there is no such"
                    f" criterion{list_allowed(name, names, 'Criteria')}"
                )
        return cls(**{name: float(value) for name, value in chosen.items()})

    @property
    def naming_false_alarms(self) -> float:
        """The false-alarm rate that naming may spend."""
        return NAMING_SHARE * self.false_alarms

    def rejects(self, behind: Any) -> Any:
        """Whether a set is rejected against the best one, by its relative likelihood exp(-behind /
        2).

        Parameters
        ----------
        behind : float or (n,)
            How far it is behind in Akaike's criterion.

        Returns
        -------
        bool or (n,) bools

        Notes
        -----
        Source: Akaike 1978.

        Examples
        --------
        >>> Criteria().rejects(3.0), Criteria().rejects(9.0)
        (False, True)
        """
        return behind > -2 * math.log(self.rejected)
