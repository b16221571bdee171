"""How well each parameter is known at a fit: its standard error, its 95 % interval, and the verdict
in words.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.discrepancy.disagreement import Disagreement
from tractexp.identification.verdict import BOUND, judge
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.information import Information, compute_free_standard_errors
from tractexp.inference.interval import ParameterEstimate, compute_interval_factor


def compute_standard_errors(tests: Disagreement) -> dict[str, float]:
    """Of the base model's parameters and those of the effects in a fit, from the curvature there.

    A parameter that rests on its bound has none; that of one without effect at the fit is inf.
    """
    at = tests.context.coordinates
    labels = {k: name for name, k in at.column.items() if k not in tests.tangent.held}
    columns = at.nuisances(tests.fit.names)
    spread = compute_free_standard_errors(tests.root)
    return {
        labels[k]: float(s * at.width(labels[k]))
        for k, s in zip(columns, spread, strict=True)
        if k in labels
    }


def estimate_effect_sizes(
    context: Context, fit: Refit, names: Sequence[str], tests: Disagreement | None
) -> list[ParameterEstimate]:
    """How large the named effects are in a fit; with standard errors where its
    `tests` were made.
    """
    at = context.coordinates
    own = context.catalogue.sizes(names)
    errors = compute_standard_errors(tests) if tests else {}
    freedom = tests.freedom if tests else np.inf
    return [
        ParameterEstimate(
            p, at.value(p.name, fit.unit), errors.get(p.name, np.nan), freedom=freedom
        )
        for p in own
    ]


def compute_covariance(tests: Disagreement, names: Sequence[str]) -> tuple[list[str], np.ndarray]:
    """Covariance (k, k) of those of the named parameters that the fit tells, and which they are."""
    at = tests.context.coordinates
    columns = at.nuisances(tests.fit.names)
    inverse = np.linalg.pinv(tests.root, rcond=1e-10)
    identified = [n for n in names if at.column[n] in columns]
    rows = inverse[[columns.index(at.column[n]) for n in identified]]
    width = np.array([at.width(n) for n in identified])
    return identified, (rows @ rows.T) * np.outer(width, width)


def list_estimates(
    tests: Disagreement, unit: np.ndarray, effects: Sequence[str]
) -> list[ParameterEstimate]:
    """The base model's parameters and those of the named effects at coordinates (D,), as the tests
    of a fit know them.

    The words are those of an identification.
    """
    context = tests.context
    at = context.coordinates
    errors = compute_standard_errors(tests)
    own = context.catalogue.parameters(effects)
    declared = {p.name: p for p in (*context.problem.parameters, *own)}
    names = [*(at.names[k] for k in at.base), *(p.name for p in own)]
    seen = [n for n in names if n in errors]
    values = {n: at.value(n, unit) for n in names}
    words = _judge_each(tests, seen, [values[n] for n in seen], [errors[n] for n in seen])
    held = {n for n in names if at.column[n] in tests.tangent.held}
    words |= {n: f"{BOUND}: better values lie beyond it" for n in held}
    return [
        ParameterEstimate(
            declared[n], values[n], errors.get(n, np.nan), words.get(n, "not judged"), tests.freedom
        )
        for n in names
    ]


def _judge_each(
    tests: Disagreement, names: Sequence[str], values: Sequence[float], errors: Sequence[float]
) -> dict[str, str]:
    """The verdict of each parameter, with all other coordinates left free beside them."""
    at = tests.context.coordinates
    R = tests.root
    columns = at.nuisances(tests.fit.names)
    own = [columns.index(at.column[n]) for n in names]
    others = [i for i in range(len(columns)) if i not in own]
    lower, upper = (
        np.array([bound[at.column[n]] for n in names]) for bound in (at.box.lower, at.box.upper)
    )
    information = Information.from_jacobian(
        names, np.array(values), upper - lower, R[:, own], R[:, others]
    )
    factors = np.full(len(errors), compute_interval_factor(tests.freedom))
    assessment = judge(information, lower, upper, factors * np.array(errors), factors)
    return {name: str(verdict) for name, verdict in assessment.items()}
