"""How sure: the sets of names that the data do not reject, and whether any of them is an adequate explanation.

A rival is rejected by its relative likelihood (Akaike 1978). That weighs fits which leave noise only; sets that leave
more are judged by what they predict. Adequacy is tested at each survivor: what is named must leave nothing that a push
into some balance, or other parameters in each event, would still explain.
"""

from dataclasses import dataclass, replace

from tractexp.discrepancy.disagreement import Disagreement, examined
from tractexp.discrepancy.explanations import Explanations
from tractexp.inference.fitting import Refit, refit

MOST = 6  # survivors whose adequacy is tested


@dataclass(frozen=True, eq=False)
class Rival:
    """A set of names of the chosen size: how far behind it is, and whether the data reject it."""

    fit: Refit
    lowered: float  # by how much its deviance is below that of the base model, nan of a fit by least squares
    behind: float  # of Akaike's criterion
    rejected: bool
    tests: Disagreement | None = None  # at its fit, where they were made

    @property
    def adequate(self) -> bool:
        """Whether nothing is left that a push into some balance explains."""
        return self.tests is not None and self.tests.adequate


@dataclass(frozen=True, eq=False)
class Survivors:
    """The sets that are not rejected, their adequacy tested, and all rivals; the chosen one first, then the best."""

    explanations: Explanations
    retained: tuple[Rival, ...]
    rivals: tuple[Rival, ...]

    @property
    def adequate(self) -> tuple[Rival, ...]:
        """Those that leave nothing; none where the chosen one does not."""
        return tuple(s for s in self.retained if s.adequate) if self.retained and self.retained[0].adequate else ()


def survivors(explained: Explanations, seed: int) -> Survivors:
    """Test every refitted set of the chosen size against the chosen one."""
    everyone, last = rivals(explained), explained.last
    left = [r for r in everyone if not r.rejected][:MOST]

    def tested(k: int) -> Rival:
        fit = left[k].fit
        tests = last if k == 0 else examined(explained.base.quiet, fit, last.noise, seed + 100 + k, plain=True)
        return replace(left[k], tests=tests)

    retained = [tested(k) for k in range(len(left))]
    by_name = {r.fit.names: r for r in retained}
    return Survivors(explained, tuple(retained), tuple(by_name.get(r.fit.names, r) for r in everyone))


def rivals(explained: Explanations) -> list[Rival]:
    """Every refitted set of the chosen size under the noise of the last tests: the chosen one, then the best first."""
    context, noise, chosen = explained.base.context, explained.last.noise, explained.chosen.names
    wanted = [(f.names, f.unit) for f in explained.refits.values() if len(f.names) == len(chosen)]
    fits = sorted(refit(context, noise, wanted), key=lambda fit: fit.names != chosen)
    base = refit(context, noise, [((), explained.steps[0].fit.unit)])[0]
    best = fits[0]
    ranked = []
    for fit in fits:
        behind = fit.cost - best.cost
        rejected = fit is not best and context.criteria.rejects(behind)
        ranked.append(Rival(fit, base.deviance - fit.deviance, behind, rejected))
    return ranked
