"""The form of each effect named: where it acts, what it does there, and by which law, with the
curve found.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.precision import covariance
from tractexp.inference.interval import interval_factor
from tractexp.model.parts import Curve, Effect

CATALOGUE, OTHER = "catalogue", "other"
SLOPE_STEP = 0.05  # of a standard error: the step by which a curve's slopes are taken


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """A law as it was found: `curve`, its 95 % band (2, n), and the `textbook` law that fits best,
    (n,).
    """

    curve: Curve
    band: np.ndarray
    textbook: np.ndarray


@dataclass(frozen=True, eq=False)
class EffectForm:
    """One effect named: `name` is the catalogue's, `effect` the member of its family that is in the
    model.
    """

    name: str
    effect: Effect
    law_fit: FittedLaw | None

    @property
    def law(self) -> str:
        """Whether it is the catalogue's place and formula, or another."""
        return OTHER if self.effect.family else CATALOGUE

    def to_dict(self) -> dict[str, Any]:
        """As `discrepancy.json` holds it."""
        law = self.law_fit
        return {
            "place": list(self.effect.places),
            "kind": self.effect.kind,
            "law": self.law,
            "differs": self.effect.differs,
            "effect": self.effect.name,
            "curve": law
            and {
                "x": law.curve.x.tolist(),
                "y": law.curve.y.tolist(),
                "lower": law.band[0].tolist(),
                "upper": law.band[1].tolist(),
                "textbook": law.textbook.tolist(),
                "x_label": law.curve.x_label,
                "y_label": law.curve.y_label,
            },
        }


def forms(findings: Findings) -> list[EffectForm]:
    """The form of each effect of the verdict."""
    at = findings.catalogue
    return [
        EffectForm(at.family(name), at[name].effect, _curve(findings, at[name].effect))
        for name in findings.names
    ]


def by_name(forms: Sequence[EffectForm]) -> dict[str, dict[str, Any]]:
    """Forms by the catalogue's names; a second one of a family by its own."""
    rows: dict[str, dict[str, Any]] = {}
    for form in forms:
        rows[form.effect.name if form.name in rows else form.name] = form.to_dict()
    return rows


def _curve(findings: Findings, effect: Effect) -> FittedLaw | None:
    """The law found with its band, by the slopes of the curve along the parameters; None of what is
    no curve.
    """
    at, unit, tests = findings.context.coordinates, findings.extended_fit.unit, findings.tests
    values = {p.name: at.value(p.name, unit) for p in effect.parameters}
    curve = effect.curve(**values)
    if curve is None:
        return None
    names, spread = covariance(tests, list(values))
    free = [k for k in range(len(names)) if spread[k, k] > 0]
    J = np.array([_slope(effect, values, names[k], spread[k, k] ** 0.5) for k in free]).reshape(
        -1, len(curve.y)
    )
    half = interval_factor(tests.freedom) * np.sqrt(
        np.einsum("kn,kl,ln->n", J, spread[np.ix_(free, free)], J)
    )
    return FittedLaw(
        curve,
        np.stack([curve.y - half, curve.y + half]),
        _draw_textbook_law(findings, effect, values, curve),
    )


def _slope(effect: Effect, values: Mapping[str, float], name: str, error: float) -> np.ndarray:
    """How the curve (n,) moves with one parameter."""
    h = SLOPE_STEP * error
    up, down = (effect.curve(**{**values, name: values[name] + side * h}) for side in (1, -1))
    assert up is not None
    assert down is not None
    return (up.y - down.y) / (2 * h)


def _draw_textbook_law(
    findings: Findings, effect: Effect, values: Mapping[str, float], curve: Curve
) -> np.ndarray:
    """The catalogue's law of the same effect, y (n,) at the x of `curve`: the law found is drawn
    beside it.

    Its parameters are those of the catalogue's effect where that was fitted to these events, else
    `values` of the law found; parameters of shape (`Effect.likely`) stand at their defaults, where
    a law is the catalogue's.
    """
    default = {p.name: p.default for p in effect.parameters}
    at, fit = (
        findings.context.coordinates,
        findings.explanations.refits.get((effect.family or effect.name,)),
    )
    start = dict(values)
    if effect.as_textbook and fit is not None:
        start |= {own: at.value(theirs, fit.unit) for own, theirs in effect.as_textbook.items()}
    drawn = effect.curve(**(default | start | {name: default[name] for name in effect.likely}))
    return curve.y if drawn is None else drawn.y
