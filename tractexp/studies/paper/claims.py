"""The paper's claims, each with a verdict that the measurements of a `Study` decide."""

from collections import Counter
from collections.abc import Callable, Sequence

from tractexp.studies.paper import printed
from tractexp.studies.paper.figure_claims import claim_figure3, claim_figure4, claim_figure9
from tractexp.studies.paper.study import Study
from tractexp.studies.paper.table_claims import (
    claim_agreement,
    claim_generalization,
    claim_readings,
    claim_table1,
    claim_table2,
    claim_table3,
)
from tractexp.studies.paper.verdict import CONFIRMED, DEPENDS, IMPOSSIBLE, REFUTED, Claim


def count_verdicts(claims: Sequence[Claim]) -> str:
    """How many there are and how many got which verdict: "38 claims: 7 confirmed, 31 not
    confirmed".
    """
    counts = Counter(claim.word for claim in claims)
    phrases = {
        CONFIRMED: CONFIRMED,
        DEPENDS: "depending on the reading",
        REFUTED: REFUTED,
        IMPOSSIBLE: IMPOSSIBLE,
    }
    phrases |= {word: word for word in counts if word not in phrases}
    return f"{len(claims)} claims: " + ", ".join(
        f"{counts[word]} {said}" for word, said in phrases.items() if counts[word]
    )


BY_PART: dict[str, Callable[[Study], Sequence[Claim]]] = {
    "table1": claim_table1,
    "table2": claim_table2,
    "table3": claim_table3,
    "table4": claim_generalization("table4", "interpolation", printed.INTERPOLATION),
    "table5": claim_generalization("table5", "extrapolation", printed.EXTRAPOLATION),
    "figure3": claim_figure3,
    "figure4": claim_figure4,
    "figure9": claim_figure9,
    "equations": claim_agreement,
    "readings": claim_readings,
}


def list_claims(study: Study, parts: Sequence[str]) -> list[Claim]:
    """The claims of some parts."""
    return [claim for part in parts if part in BY_PART for claim in BY_PART[part](study)]
