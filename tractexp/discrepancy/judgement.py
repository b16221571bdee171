"""What the data say of every effect of the catalogue: relevant, irrelevant, ruled out, or not
testable, and why.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from tractexp.discrepancy.findings import Findings
from tractexp.inference.catalogue import Candidate
from tractexp.inference.score_test import Score
from tractexp.text.wording import format_probability, join_words

ONE_SIDED = 1.6449  # standard deviations: 5 %
# power at the smallest relevant size, as of a planned test (Saris, Satorra and van der Veld 2009)
TESTABLE = 0.8


@dataclass(frozen=True)
class Judgement:
    """What the data say of one effect of the catalogue: a status, the reason, and the score where
    it has one.
    """

    name: str
    status: str
    why: str
    score: Score | None = None


def judge_effects(investigation: Findings) -> list[Judgement]:
    """Every effect of the catalogue classified (Saris, Satorra and van der Veld 2009), at the
    chosen model.
    """
    criteria = investigation.context.criteria
    critical = investigation.first.chance.critical_p(criteria.naming_false_alarms)
    scores = {s.name: s for s in investigation.last.scores}
    chosen = investigation.last.fit.names
    beside = f"beside {join_words(chosen)}, " if chosen else ""
    judged_effects = [
        Judgement(name, "not testable", why)
        for name, why in investigation.catalogue.untestable.items()
    ]
    for candidate in investigation.catalogue.candidates:
        name = candidate.name
        score = scores.get(candidate.name)
        if name in investigation.names:
            judged_effects.append(Judgement(name, "relevant", "added"))
        elif name in investigation.last.fit.names:
            judged_effects.append(
                Judgement(name, "relevant", "in the best explanation, which was not accepted")
            )
        elif score is None:
            judged_effects.append(
                Judgement(name, "irrelevant", "in the fit as a nuisance, not above its noise")
            )
        else:
            status, why = assess_effect(candidate, score, critical)
            judged_effects.append(Judgement(name, status, f"{beside}{why}", score))
    return sorted(judged_effects, key=lambda j: j.name)


def assess_effect(candidate: Candidate, score: Score, critical: float) -> tuple[str, str]:
    """Status and reason of an effect outside the chosen model."""
    main = candidate.sizes[0]
    unit = "" if main.unit == "1" else f" {main.unit}"
    size, deviation, relevant = (
        score.size[main.name],
        score.deviation[main.name],
        candidate.relevant(main),
    )
    if score.p < critical:
        return (
            "relevant",
            "its score stands out: chance gives as much with a probability of"
            f" {format_probability(score.p)}",
        )
    if not np.isfinite(deviation):
        return "not testable", "these events cannot show it"
    limit = abs(size) + ONE_SIDED * deviation
    below = f"{main.name} is within {limit:.2g}{unit} of {main.absent:g}"
    if ndtr(relevant / max(deviation, 1e-300) + ndtri(critical)) < TESTABLE:
        return (
            "not testable",
            f"a size of {relevant:g}{unit} would stay in the noise on these events ({below})",
        )
    return ("ruled out" if limit < relevant else "irrelevant"), below
