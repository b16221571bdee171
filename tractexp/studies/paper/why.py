"""Why the searches rank as they do: do they miss the right valley, or do they not get to the bottom
of theirs?
"""

from collections.abc import Sequence
from dataclasses import dataclass

from tractexp.studies.comparison.statistics import (
    SIGNIFICANCE_LEVEL,
    compute_vargha_delaney,
    correct_by_holm,
    run_wilcoxon_test,
)
from tractexp.studies.paper.study import OptimizerPair, Shares, Study

SPARROWS, RIVAL = ("issa", "ssa"), "pso"


def run_fisher_test(a: Shares, b: Shares, of: str) -> float:
    """Two-sided p of Fisher's exact test: as many searches of both reach the "valley" or the
    "floor".
    """
    from scipy.stats import fisher_exact

    rows = [[getattr(s, of), s.n - getattr(s, of)] for s in (a, b)]
    return float(fisher_exact(rows)[1])  # type: ignore[arg-type]


def is_significant(pairs: Sequence[OptimizerPair], k: int) -> bool:
    """Whether the first of pair k ends lower, corrected for all pairs."""
    return bool(
        correct_by_holm([pair.p for pair in pairs])[k] < SIGNIFICANCE_LEVEL and pairs[k].A > 0.5
    )


@dataclass(frozen=True)
class Test:
    """p of no difference, corrected, and whether what is tested has less than what it is compared
    with.
    """

    p: float
    less: bool

    @property
    def lacks(self) -> bool:
        """Whether a search has less than random points, by more than chance."""
        return self.less and self.p < SIGNIFICANCE_LEVEL


@dataclass(frozen=True)
class Lack:
    """The tests of a sparrow search beside PSO and beside random points."""

    name: str
    # depth in its own valley, paired with PSO's: the objective over that of the bottom
    convergence: Test
    valley: Test  # searches in the right valley, beside PSO's
    random: Test  # searches in the right valley, beside random points that descend there
    best: Test  # the same, beside searches for the best of as many random points
    polished: Test  # objectives paired with PSO's, once least squares have ended both

    @property
    def exploration(self) -> bool:
        """Whether it lacks exploration, by any of three tests."""
        return self.valley.lacks or self.random.lacks or self.best.lacks


def compare_with_ssa(study: Study) -> list[Lack]:
    """ISSA's and SSA's; the p-values are corrected over the tests of both."""
    tests = [test for name in SPARROWS for test in _list_tests(study, name)]
    corrected = correct_by_holm([test.p for test in tests]).tolist()
    final = [Test(p, test.less) for p, test in zip(corrected, tests, strict=True)]
    each = len(final) // len(SPARROWS)
    return [Lack(name, *final[each * k : each * (k + 1)]) for k, name in enumerate(SPARROWS)]


def _list_tests(study: Study, name: str) -> list[Test]:
    """Not yet corrected."""
    own, control = study.shares(name), study.control_shares
    rival, best = (study.shares(other) for other in (RIVAL, "random_search"))
    above, beside = study.above_bottom(name), study.above_bottom(RIVAL)
    ended, other = study.ends[name].objective, study.ends[RIVAL].objective
    return [
        Test(run_wilcoxon_test(above, beside)[0], compute_vargha_delaney(above, beside) < 0.5),
        Test(run_fisher_test(own, rival, "valley"), own.valley < rival.valley),
        Test(
            run_fisher_test(own, control, "valley"), own.valley * control.n < control.valley * own.n
        ),
        Test(run_fisher_test(own, best, "valley"), own.valley < best.valley),
        Test(run_wilcoxon_test(ended, other)[0], compute_vargha_delaney(ended, other) < 0.5),
    ]


def answer(searches: Sequence[Lack]) -> str:
    """Whether "convergence at the end, not exploration, is what the sparrows lack" holds."""
    converging, exploring = (
        all(lack.convergence.lacks for lack in searches),
        any(lack.exploration for lack in searches),
    )
    if converging:
        return "holds only in half, for they lack both" if exploring else "holds"
    return (
        "does not hold: it is exploration"
        if exploring
        else "is not shown: neither test is significant"
    )
