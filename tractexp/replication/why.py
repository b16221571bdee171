"""Why the searches rank as they do: do they miss the right valley, or do they not get to the bottom of theirs?"""

from collections.abc import Sequence
from dataclasses import dataclass

from tractexp.comparison.statistics import ALPHA, holm, vargha_delaney, wilcoxon
from tractexp.replication.study import Pair, Shares, Study

SPARROWS, RIVAL = ("issa", "ssa"), "pso"


def fisher(a: Shares, b: Shares, of: str) -> float:
    """Two-sided p of Fisher's exact test: as many searches of both reach the "valley", the "floor", or are "done"."""
    from scipy.stats import fisher_exact

    rows = [[getattr(s, of), s.n - getattr(s, of)] for s in (a, b)]
    return float(fisher_exact(rows).pvalue)


def significant(pairs: Sequence[Pair], k: int) -> bool:
    """Whether the first of pair k ends lower, corrected for all pairs."""
    return bool(holm([pair.p for pair in pairs])[k] < ALPHA and pairs[k].A > 0.5)


@dataclass(frozen=True)
class Lack:
    """What a sparrow search lacks beside PSO: p-values, corrected over the tests of both searches, and effects."""

    name: str
    done: float  # p of as many searches at the bottom of their own valley as PSO's
    valley: float  # p of as many in the right valley as PSO's
    random: float  # p of as many there as random points descend to
    polished: float  # p of equal objectives, paired by seed, once least squares have ended both
    A: float  # the probability that it is the lower then
    less_done: bool
    less_valley: bool
    less_random: bool

    @property
    def convergence(self) -> bool:
        """It gets to the bottom of its valley less often."""
        return self.less_done and self.done < ALPHA

    @property
    def exploration(self) -> bool:
        """It finds the right valley less often than PSO, or than random points do."""
        return (self.less_valley and self.valley < ALPHA) or (self.less_random and self.random < ALPHA)


def lacks(study: Study) -> list[Lack]:
    """ISSA's and SSA's, beside PSO and beside random points."""
    rival, control = study.shares(RIVAL), study.control_shares
    shares = {name: study.shares(name) for name in SPARROWS}
    tests = []
    for name in SPARROWS:
        own = shares[name]
        tests += [fisher(own, rival, "done"), fisher(own, rival, "valley"), fisher(own, control, "valley")]
        tests.append(wilcoxon(study.ends[name].objective, study.ends[RIVAL].objective)[0])
    corrected = holm(tests).tolist()
    made = []
    for k, name in enumerate(SPARROWS):
        own, A = shares[name], vargha_delaney(study.ends[name].objective, study.ends[RIVAL].objective)
        less = own.done < rival.done, own.valley < rival.valley, own.valley * control.n < control.valley * own.n
        made.append(Lack(name, *corrected[4 * k : 4 * k + 4], A, *less))
    return made


def answer(found: Sequence[Lack]) -> str:
    """Whether "convergence at the end, not exploration, is what the sparrows lack" holds."""
    if all(lack.convergence and not lack.exploration for lack in found):
        return "holds"
    if any(lack.exploration for lack in found):
        both = all(lack.convergence for lack in found)
        return "does not hold: they lack exploration" + (" as well" if both else "")
    return "does not hold: they do not lack convergence"
