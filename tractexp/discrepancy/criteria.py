"""Every threshold by which an investigation decides, in one place: what it means and where its value comes from.

Two kinds of origin are told apart. *Derived* values follow from the false-alarm rate or from a quantile and need no
data. *Chosen* ones were set while the development set of `benchmarks/hidden_effects_study.py` was looked at, whose
seeds are the CRC-32 series of `hidden_effects.cases.seeds`. The figures of docs/judgement.md are of the judgement
set, whose seeds follow from the hash of a later commit.

Tolerances of fits, sizes of shortlists and numbers of draws are not decisions and stand where they are used.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tractexp.errors import TASK, UserError, among, check_range
from tractexp.identification.adequacy import ADEQUATE_P

DERIVED, CHOSEN = "derived", "chosen"


def _criterion(default: float, bounds: tuple[float, float], about: str, origin: str, why: str) -> Any:
    return dataclasses.field(default=default, metadata={"bounds": bounds, "about": about, "origin": origin, "why": why})


@dataclass(frozen=True)
class Criteria:
    """The decision thresholds of an investigation; set single ones by `task.criteria.NAME=value`."""

    false_alarms: float = _criterion(
        0.05, (0.001, 0.5), "probability of naming or doubting anything where nothing is missing", DERIVED,
        "the usual level of a test; the user's to set",
    )  # fmt: skip
    naming_share: float = _criterion(
        0.4, (0.0, 1.0), "part of the false alarms that chance's draws may give to naming", CHOSEN,
        "with the doubts by what is left a level of 0.02 takes 0.029 of data sets, one of 0.04 takes 0.061: the draws"
        " lack the tail of small p (benchmarks/false_alarms.py)",
    )  # fmt: skip
    adequate_p: float = _criterion(
        ADEQUATE_P, (0.0, 1.0), "p of what a fit leaves, below which it leaves something", CHOSEN,
        "the same as in an identification",
    )  # fmt: skip
    further_name_p: float = _criterion(
        1e-5, (0.0, 1.0), "p that a second name must undercut, and by which another law or place must explain more than"
        " the catalogue's, its further parameters paid for; at 0 neither is tried", CHOSEN,
        "a second name spoils a right first one, or patches up a wrong one",
    )  # fmt: skip
    rejected: float = _criterion(
        0.05, (1e-9, 1.0), "relative likelihood, by Akaike's criterion, below which a rival is rejected", DERIVED,
        "one to twenty, the usual level of a test",
    )  # fmt: skip
    mended: float = _criterion(
        0.05, (0.0, 1.0), "part of what an effect explains that a fault of the measurement beside it must explain more",
        CHOSEN, "no formula is exact to this, and a fault mends a little of it",
    )  # fmt: skip
    shown: float = _criterion(
        10.8, (0.0, 1e6), "gain of the deviance by which held-out events show an explanation, and each of two effects"
        " over the other alone, and that a recorder's window must have; events of which less is expected are too mild"
        " to show one", DERIVED,
        "(2 x 1.645)^2: a true explanation of which so much is expected gains nothing in 5 % of cases",
    )  # fmt: skip
    evident: float = _criterion(
        100.0, (0.0, 1e9), "deviance that an explanation must explain of the fitted events where the held-out ones are"
        " too mild to show it, or had to be fitted, too", CHOSEN,
        "loads that no model fits to 1 % leave 12 to 80 to effects that imitate them, effects of four limits 250",
    )  # fmt: skip
    divides: float = _criterion(
        2.25, (1.0, 1e6), "factor by which a name must divide the error on the held-out events not to be doubted, and"
        " by which it, or all of the best sets that have it, must where it leaves more than noise", CHOSEN,
        "of loud development sets four effects that are there divide it by 1.7 to 4, the best imitations of five"
        " strangers by less than 1.6 but for one, by 3.6",
    )  # fmt: skip
    ahead: float = _criterion(
        1.5, (1.0, 1e6), "factor by which the error of a set that leaves more than noise must be below that of"
        " any rival of its size or smaller, and that of the base model with a proposed term below its own", CHOSEN,
        "a right effect by a wrong formula is no farther from a wrong effect than that, and tied with it",
    )  # fmt: skip
    window_share: float = _criterion(
        0.5, (0.0, 1.0), "part of what the best effect explains that a window must explain", CHOSEN,
        "what lacks something large takes a wrong window for a part of it",
    )  # fmt: skip
    blurred: float = _criterion(
        0.5, (0.0, 1e6), "variance from noise of the voltage, over that of the power, from which the measurement is not"
        " judged", CHOSEN, "whatever smooths the calculated power would seem to be there",
    )  # fmt: skip
    quiet_worth: float = _criterion(
        150.0, (0.0, 1e9), "independent quiet samples below which every draw estimates its noise anew", CHOSEN,
        "the error of the estimate then is a tenth of the noise, as large as what a level of 5 % allows",
    )  # fmt: skip
    wandering: float = _criterion(
        2.0, (0.0, 1e6), "twice the log-likelihood from which a load is said to wander before its events; twice that by"
        " what the events show", CHOSEN,
        "half a chi-square of one degree is beyond it in 8 % of channels; a wandering that is not there costs little",
    )  # fmt: skip
    measurement_prior: float = _criterion(
        5.0, (1e-3, 1e6), "standard deviation of a fault of the measurement before anything is seen, in its relevant"
        " sizes", CHOSEN, "clocks, windows and drifts beyond that are seen before a record is used",
    )  # fmt: skip
    frequency_swing: float = _criterion(
        0.05, (0.0, 10.0), "change of the frequency [Hz] below which effects of it cannot be tested", CHOSEN,
        "a thousandth of nominal: a load of exponent 2 moves by 0.2 % of its power",
    )  # fmt: skip
    testable: float = _criterion(
        0.8, (0.0, 1.0), "power at the smallest relevant size below which an effect is called not testable", DERIVED,
        "the usual power of a planned test (Saris, Satorra and van der Veld 2009)",
    )  # fmt: skip
    proposal_p: float = _criterion(
        0.01, (0.0, 1.0), "how often noise may give the best term of the whole library as much", CHOSEN,
        "it guards against the library's size alone; held-out events do the rest",
    )  # fmt: skip
    decided: float = _criterion(
        0.95, (0.0, 1.0), "probability with which a recommended dip must tell tied sets apart", DERIVED,
        "one miss in twenty, as for the tests",
    )  # fmt: skip

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            section = "task" if item.name == "false_alarms" else "task.criteria"
            check_range(f"{section}.{item.name}", getattr(self, item.name), *item.metadata["bounds"])

    @classmethod
    def of(cls, chosen: Mapping[str, float]) -> "Criteria":
        """The criteria with some of them chosen. Raises `UserError` for an unknown name or a value out of range."""
        names = [item.name for item in dataclasses.fields(cls)]
        for name in chosen:
            if name not in names:
                raise UserError(f"{TASK.criteria}.{name}: there is no such criterion{among(name, names, 'Criteria')}")
        return cls(**{name: float(value) for name, value in chosen.items()})

    @property
    def naming(self) -> float:
        """The false-alarm rate that naming may spend."""
        return self.naming_share * self.false_alarms

    def knows_noise(self, worth: float) -> bool:
        """Whether quiet stretches worth so many independent samples tell the noise exactly enough."""
        return worth >= self.quiet_worth

    def least_window(self, best: float) -> float:
        """The deviance that a recorder's window must explain where the best effect explains `best`."""
        return max(self.shown, self.window_share * best)

    def stands_out(self, drop: float, explained: float) -> bool:
        """Whether a fault of the measurement does more for the deviance than mend an effect that explains so much."""
        return drop > self.mended * explained

    def rejects(self, behind: Any) -> Any:
        """Whether a rival this far behind the best set in Akaike's criterion is rejected; a number, or an array (n,).

        exp(-behind / 2) is its relative likelihood (Akaike 1978).
        """
        return behind > -2 * math.log(self.rejected)
