"""How well each parameter is known at a fit: its standard error, its 95 % interval, and the verdict in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri

from tractexp import files
from tractexp.discrepancy.disagreement import Disagreement
from tractexp.identification.uncertainty import LEVEL
from tractexp.identification.verdict import BOUND, judge
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.information import Information
from tractexp.parameter import Parameter
from tractexp.wording import with_error

BLIND = 1e-6  # ranges: what even by itself is not known to a million of them changes nothing
WIDE = float(ndtri((1 + LEVEL) / 2))  # standard errors in half of an interval: the samples are many


@dataclass(frozen=True, eq=False)
class ParameterEstimate:
    """One parameter at a fit: `error` is its standard error, nan where it rests on a bound or is not computed."""

    parameter: Parameter
    value: float
    error: float
    verdict: str = ""

    def __str__(self) -> str:
        unit = "" if self.parameter.unit == "1" else f" {self.parameter.unit}"
        return f"{self.parameter.name} {with_error(self.value, self.error)}{unit}"

    @property
    def half(self) -> float:
        """Half of the 95 % interval; nan without a standard error."""
        return WIDE * self.error

    @property
    def interval(self) -> tuple[float, float]:
        """95 %, inside the bounds; nan without a standard error."""
        ends = np.clip(self.value + self.half * np.array([-1.0, 1.0]), *self.parameter.bounds)
        return float(ends[0]), float(ends[1])

    def plain(self) -> dict[str, Any]:
        """As `discrepancy.json` has it."""
        return files.plain({"value": self.value, "standard_error": self.error, "interval": self.interval})


def standard_errors(tests: Disagreement) -> dict[str, float]:
    """Of the base model's parameters and those of the effects in a fit, from the curvature there.

    A parameter that rests on its bound has none; that of one without effect at the fit is inf.
    """
    at = tests.context.coordinates
    labels = {k: name for name, k in at.column.items() if k not in tests.tangent.held}
    columns = at.nuisances(tests.fit.names)
    seen = np.where(np.linalg.norm(tests.root, axis=0) > BLIND, tests.root, 0.0)
    ranges = np.ones(len(columns))
    spread = Information(tuple(map(str, columns)), 0 * ranges, ranges, seen).standard_errors
    return {labels[k]: float(s * at.width(labels[k])) for k, s in zip(columns, spread, strict=True) if k in labels}


def effect_sizes(
    context: Context, fit: Refit, names: Sequence[str], tests: Disagreement | None
) -> list[ParameterEstimate]:
    """How large the named effects are in a fit; with standard errors where its `tests` were made."""
    errors = {} if tests is None else standard_errors(tests)
    at, own = context.coordinates, context.catalogue.sizes(names)
    return [ParameterEstimate(p, at.value(p.name, fit.unit), errors.get(p.name, np.nan)) for p in own]


def covariance(tests: Disagreement, names: Sequence[str]) -> tuple[list[str], np.ndarray]:
    """Covariance (k, k) of those of the named parameters that the fit tells, and which they are."""
    at = tests.context.coordinates
    columns = at.nuisances(tests.fit.names)
    inverse = np.linalg.pinv(tests.root, rcond=1e-10)
    identified = [n for n in names if at.column[n] in columns]
    rows = inverse[[columns.index(at.column[n]) for n in identified]]
    width = np.array([at.width(n) for n in identified])
    return identified, (rows @ rows.T) * np.outer(width, width)


def estimates(tests: Disagreement, unit: np.ndarray, effects: Sequence[str]) -> list[ParameterEstimate]:
    """The base model's parameters and those of the named effects at coordinates (D,), as the tests of a fit know them.

    The words are those of an identification.
    """
    context = tests.context
    at, errors = context.coordinates, standard_errors(tests)
    own = context.catalogue.parameters(effects)
    declared = {p.name: p for p in (*context.problem.parameters, *own)}
    names = [*(at.names[k] for k in at.base), *(p.name for p in own)]
    seen = [n for n in names if n in errors]
    values = {n: at.value(n, unit) for n in names}
    words = _words(tests, seen, [values[n] for n in seen], [errors[n] for n in seen])
    held = {n for n in names if at.column[n] in tests.tangent.held}
    words |= {n: f"{BOUND}: better values lie beyond it" for n in held}
    return [ParameterEstimate(declared[n], values[n], errors.get(n, np.nan), words.get(n, "not judged")) for n in names]


def _words(
    tests: Disagreement, names: Sequence[str], values: Sequence[float], errors: Sequence[float]
) -> dict[str, str]:
    """The verdict of each parameter, with all other coordinates left free beside them."""
    at, R = tests.context.coordinates, tests.root
    columns = at.nuisances(tests.fit.names)
    own = [columns.index(at.column[n]) for n in names]
    others = [i for i in range(len(columns)) if i not in own]
    lower, upper = (np.array([bound[at.column[n]] for n in names]) for bound in (at.lower, at.upper))
    information = Information.of(names, np.array(values), upper - lower, R[:, own], R[:, others])
    assessment = judge(information, lower, upper, WIDE * np.array(errors), np.full(len(errors), WIDE))
    return {name: str(verdict) for name, verdict in assessment.items()}
