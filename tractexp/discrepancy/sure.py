"""How sure: the set of names that the data do not reject, and whether any of them is an adequate explanation.

A rival is rejected when, were it the truth, the chosen set would not fit as well as it does (a test of separate
hypotheses, Cox 1961): with lambda the squared distance between the two fitted curves in standard deviations, the
rival's advantage would be normal with mean lambda and variance 4 lambda. Curves closer than the test's own quantile,
and rivals that explain nearly as much, are never told apart: effects are formulas, not the physics. Adequacy is
tested at each survivor: what is named must leave nothing that a push into some balance, or other parameters in each
event, would still explain.
"""

from dataclasses import dataclass, replace

import numpy as np

from tractexp.discrepancy.kernels import each_apart
from tractexp.discrepancy.study import Refit, Study
from tractexp.discrepancy.which import Explanation, Stage, stage
from tractexp.noise.model import Noise

ONE_SIDED = 1.6449  # standard deviations: 5 %
REJECTED = 3.5  # standard deviations: more than chance asks for, since a true effect's formula is not quite its physics
ALIKE = 0.05  # of what the best explains: no rival this near is rejected, for no formula is that exact


@dataclass(frozen=True, eq=False)
class Rival:
    """A set of names of the chosen size: how far behind, how far apart, and whether the data reject it."""

    fit: Refit
    lowered: float  # by how much its deviance is below that of the base model
    behind: float  # of Akaike's criterion
    distance: float  # lambda, squared standard deviations
    rejected: bool
    stage: Stage | None = None  # the tests at its fit, where they were made

    @property
    def adequate(self) -> bool:
        """Whether nothing is left that a push into some balance explains."""
        return self.stage is not None and self.stage.adequate


def rivals(study: Study, explanation: Explanation) -> tuple[list[Rival], Noise]:
    """Every refitted set of the chosen size under the noise of the final stage, the best first."""
    last = explanation.stages[-1]
    size = len(last.fit.names)
    wanted = [(f.names, f.unit) for f in explanation.refits.values() if len(f.names) == size]
    fits = study.refit(last.noise, wanted)
    base = study.refit(last.noise, [((), explanation.stages[0].fit.unit)])[0]
    alike = ALIKE * max(base.cost - fits[0].cost, 0.0)
    chain = study.parameters(study.catalogue.chain)
    rows = study.rows(np.array([f.unit for f in fits]), last.noise, chain, [f.names for f in fits])
    distance = ((rows - rows[0]) ** 2).sum(axis=1)
    found = []
    for fit, apart in zip(fits, distance, strict=True):
        behind = fit.cost - fits[0].cost
        noise = fit.parameters + fits[0].parameters  # the fits' own noise moves the curves apart too
        far = max(float(apart) - noise, REJECTED**2)
        rejected = behind > max(2 * REJECTED * np.sqrt(far) - far, alike)
        found.append(
            Rival(fit, base.deviance - fit.deviance, behind, float(apart), bool(rejected and fit is not fits[0]))
        )
    return found, last.noise


def surviving(study: Study, explanation: Explanation, seed: int, most: int = 6) -> tuple[list[Rival], list[Rival]]:
    """(survivors with their adequacy tested, all rivals), the best first."""
    everyone, noise = rivals(study, explanation)

    def tested(k: int, rival: Rival) -> Rival:
        at = explanation.stages[-1] if k == 0 else stage(study, rival.fit, noise, seed + 100 + k, plain=True)
        return replace(rival, stage=at)

    left = [r for r in everyone if not r.rejected][:most]
    survivors = each_apart(lambda k: tested(k, left[k]), range(len(left)))
    known = {r.fit.names: r for r in survivors}
    return survivors, [known.get(r.fit.names, r) for r in everyone]
