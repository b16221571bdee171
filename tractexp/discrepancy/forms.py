"""The form of each effect named: where it acts, what it does there, and by which law, with the curve found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.discrepancy.investigate import Findings
from tractexp.discrepancy.precision import WIDE, covariance
from tractexp.model.parts import Curve, Effect

CATALOGUE, OTHER = "catalogue", "other"
STEP = 0.05  # of a standard error: the step by which a curve's slopes are taken


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """A law as it was found: `curve`, its 95 % band (2, n), and the `textbook` law that fits best, (n,)."""

    curve: Curve
    band: np.ndarray
    textbook: np.ndarray


@dataclass(frozen=True, eq=False)
class EffectForm:
    """One effect named: `name` is the catalogue's, `effect` the member of its family that is in the model."""

    name: str
    effect: Effect
    found: FittedLaw | None

    @property
    def law(self) -> str:
        """Whether it is the catalogue's place and formula, or another."""
        return OTHER if self.effect.family else CATALOGUE

    def told(self) -> dict[str, Any]:
        """As `discrepancy.json` holds it."""
        found = self.found
        return {
            "place": list(self.effect.places),
            "kind": self.effect.kind,
            "law": self.law,
            "differs": self.effect.differs,
            "effect": self.effect.name,
            "curve": found and {
                "x": found.curve.x.tolist(), "y": found.curve.y.tolist(), "lower": found.band[0].tolist(),
                "upper": found.band[1].tolist(), "textbook": found.textbook.tolist(),
                "x_label": found.curve.x_label, "y_label": found.curve.y_label,
            },
        }  # fmt: skip


def forms(found: Findings) -> list[EffectForm]:
    """The form of each effect of the verdict."""
    at = found.catalogue
    return [EffectForm(at.family(name), at[name].effect, _curve(found, at[name].effect)) for name in found.names]


def told_by_name(found: Sequence[EffectForm]) -> dict[str, dict[str, Any]]:
    """Forms by the catalogue's names; a second one of a family by its own."""
    told: dict[str, dict[str, Any]] = {}
    for form in found:
        told[form.effect.name if form.name in told else form.name] = form.told()
    return told


def _curve(found: Findings, effect: Effect) -> FittedLaw | None:
    """The law found with its band, by the slopes of the curve along the parameters; None of what is no curve."""
    at, unit, tests = found.bench.coordinates, found.extended.unit, found.verdict.chosen.tests or found.last
    values = {p.name: at.value(p.name, unit) for p in effect.parameters}
    curve = effect.curve(**values)
    if curve is None:
        return None
    names, spread = covariance(tests, list(values))
    told = [k for k in range(len(names)) if spread[k, k] > 0]
    J = np.array([_slope(effect, values, names[k], spread[k, k] ** 0.5) for k in told]).reshape(-1, len(curve.y))
    half = WIDE * np.sqrt(np.einsum("kn,kl,ln->n", J, spread[np.ix_(told, told)], J))
    return FittedLaw(curve, np.stack([curve.y - half, curve.y + half]), _textbook(found, effect, values, curve))


def _slope(effect: Effect, values: Mapping[str, float], name: str, error: float) -> np.ndarray:
    """How the curve (n,) moves with one parameter."""
    h = STEP * error
    up, down = (effect.curve(**{**values, name: values[name] + side * h}) for side in (1, -1))
    assert up is not None
    assert down is not None
    return (up.y - down.y) / (2 * h)


def _textbook(found: Findings, effect: Effect, values: Mapping[str, float], curve: Curve) -> np.ndarray:
    """The textbook's law (n,) as it fitted these events, beside the curve found; the shapes at their defaults."""
    default = {p.name: p.default for p in effect.parameters}
    at, fit = found.bench.coordinates, found.explanations.refits.get((effect.family or effect.name,))
    known = dict(values)
    if effect.as_textbook and fit is not None:
        known |= {own: at.value(theirs, fit.unit) for own, theirs in effect.as_textbook.items()}
    drawn = effect.curve(**(default | known | {name: default[name] for name in effect.likely}))
    return curve.y if drawn is None else drawn.y
