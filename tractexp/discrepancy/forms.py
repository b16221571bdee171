"""The form of each effect named: where it acts, what it does there, and by which law, with the
curve found.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.precision import compute_covariance
from tractexp.inference.interval import compute_interval_factor
from tractexp.model.parts import Curve, Effect

CATALOGUE, OTHER = "catalogue", "other"
SLOPE_STEP = 0.05  # of a standard error: the step by which a curve's slopes are taken


def describe_forms(findings: Findings) -> list[tuple[str, dict[str, Any]]]:
    """The catalogue's name of each effect of the verdict, and its form as `discrepancy.json` has
    it: of the member of its family that is in the model.
    """
    at = findings.catalogue
    rows = []
    for name in findings.names:
        effect = at[name].effect
        form = {
            "place": list(effect.places),
            "kind": effect.kind,
            "law": OTHER if effect.family else CATALOGUE,
            "differs": effect.differs,
            "effect": effect.name,
            "curve": _describe_curve(findings, effect),
        }
        rows.append((at.family(name), form))
    return rows


def key_forms(forms: Sequence[tuple[str, dict[str, Any]]]) -> dict[str, dict[str, Any]]:
    """Forms by the catalogue's names; a second one of a family by its own."""
    rows: dict[str, dict[str, Any]] = {}
    for name, form in forms:
        rows[form["effect"] if name in rows else name] = form
    return rows


def _describe_curve(findings: Findings, effect: Effect) -> dict[str, Any] | None:
    """The law found with its 95 % band, by the slopes of the curve along the parameters, and the
    textbook law that fits best; None of what is no curve.
    """
    at, unit, tests = findings.context.coordinates, findings.extended_fit.unit, findings.tests
    values = {p.name: at.value(p.name, unit) for p in effect.parameters}
    curve = effect.curve(**values)
    if curve is None:
        return None
    names, spread = compute_covariance(tests, list(values))
    free = [k for k in range(len(names)) if spread[k, k] > 0]
    J = np.array(
        [_differentiate_curve(effect, values, names[k], spread[k, k] ** 0.5) for k in free]
    ).reshape(-1, len(curve.y))
    half = compute_interval_factor(tests.freedom) * np.sqrt(
        np.einsum("kn,kl,ln->n", J, spread[np.ix_(free, free)], J)
    )
    return {
        "x": curve.x.tolist(),
        "y": curve.y.tolist(),
        "lower": (curve.y - half).tolist(),
        "upper": (curve.y + half).tolist(),
        "textbook": _draw_textbook_law(findings, effect, values, curve).tolist(),
        "x_label": curve.x_label,
        "y_label": curve.y_label,
    }


def _differentiate_curve(
    effect: Effect, values: Mapping[str, float], name: str, error: float
) -> np.ndarray:
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
    at = findings.context.coordinates
    fit = findings.explanations.refits.get((effect.family or effect.name,))
    start = dict(values)
    if effect.as_textbook and fit is not None:
        start |= {own: at.value(theirs, fit.unit) for own, theirs in effect.as_textbook.items()}
    drawn = effect.curve(**(default | start | {name: default[name] for name in effect.likely}))
    return curve.y if drawn is None else drawn.y
