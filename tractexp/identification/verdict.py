"""What an interval means, in words: identified, weakly identified and why, not identifiable and
what is instead.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.inference.bounds import BOUND_DISTANCE
from tractexp.inference.information import SHARE, Information

IDENTIFIED, WEAK, UNIDENTIFIED, BOUND, END_OF_RANGE = (
    "identified",
    "weakly identified",
    "not identifiable from this record",
    "at its bound",
    "at the end of what machines have",  # of a parameter that is held to a physical range
)
HELD = "a requirement of the model holds it there: beside it there is no steady state"
# an interval of at most plus and minus this share of the value identifies a parameter
IDENTIFIED_SHARE = 0.2
# of the range: what may be zero is measured against this where its value is smaller
NEAR_ZERO = 0.1
TRADES = 0.8  # correlation from which two parameters are said to trade against each other
PARTNERS = 2  # named at most
STEEPEST_COMBINATION = 4.0  # power of a combination that is told


@dataclass(frozen=True)
class ParameterVerdict:
    """What an interval means: one of the five words, and the reason."""

    word: str
    detail: str

    def add_objection(self, also: str, *, enough: bool = True) -> "ParameterVerdict":
        """The verdict with a further reason against it.

        Parameters
        ----------
        also : str
            The reason.
        enough : bool
            Whether it makes an identified parameter a weakly identified one.

        Returns
        -------
        ParameterVerdict

        Examples
        --------
        >>> str(ParameterVerdict(IDENTIFIED, "").add_objection("with zip it is 0.4"))
        'weakly identified: with zip it is 0.4'
        """
        word = WEAK if enough and self.word == IDENTIFIED else self.word
        return replace(self, word=word, detail="; ".join(filter(None, (self.detail, also))))

    def __str__(self) -> str:
        """ "weakly identified: trades against C", or the word alone."""
        return ": ".join(filter(None, (self.word, self.detail)))


def shorten_verdict(verdict: str) -> str:
    """The word of a verdict that was written, without its reason.

    Examples
    --------
    >>> shorten_verdict("weakly identified: trades against C")
    'weakly identified'
    """
    return verdict.partition(":")[0]


def rests_on_bound(verdict: str) -> bool:
    """Whether a bound alone holds the parameter, by its verdict as written."""
    return verdict.startswith(BOUND)


def choose_scale(value: float, low: float, high: float) -> float:
    """What the width of an interval is measured against.

    Parameters
    ----------
    value, low, high : float
        An estimate and its bounds, in its unit.

    Returns
    -------
    float
        The value without its sign; a tenth of the range for a smaller one that may be zero.

    Examples
    --------
    >>> choose_scale(0.05, 0.0, 2.0), choose_scale(0.05, 0.01, 2.0)
    (0.2, 0.05)
    """
    return max(abs(value), NEAR_ZERO * (high - low)) if low <= 0 <= high else abs(value)


def format_half_width(value: float, half: float, low: float, high: float) -> str:
    """Half an interval as text: in percent of the value, or as a number where that is next to
    nothing.

    Examples
    --------
    >>> format_half_width(0.5, 0.05, 0.1, 1.0), format_half_width(0.0, 0.05, -1.0, 1.0)
    ('± 10 %', '± 0.05')
    """
    if choose_scale(value, low, high) != abs(value):
        return f"± {half:.2g}"
    return f"± {100 * half / abs(value):.2g} %" if half <= abs(value) else "wider than its value"


def judge(
    information: Information,
    lower: np.ndarray,
    upper: np.ndarray,
    half: np.ndarray,
    factors: np.ndarray,
) -> dict[str, ParameterVerdict]:
    """The verdict on each parameter.

    Parameters
    ----------
    information : Information
        What the records say of d parameters.
    lower, upper : (d,)
        Their bounds, in physical units.
    half : (d,)
        Half of each 95 % interval.
    factors : (d,)
        That over the standard error.

    Returns
    -------
    {name: ParameterVerdict}
    """
    return {
        name: _judge_parameter(information, j, (lower[j], upper[j]), half[j], factors[j])
        for j, name in enumerate(information.names)
    }


def _judge_parameter(
    information: Information, j: int, bounds: tuple[float, float], half: float, factor: float
) -> ParameterVerdict:
    """The verdict of the j-th parameter, of which `half` is half of the 95 % interval."""
    (lower, upper), value = bounds, information.values[j]
    low = value - half
    high = value + half
    at = _list_near(value, lower, upper)[:1]
    if not information.identifiable[j]:
        return ParameterVerdict(
            UNIDENTIFIED, _explain_structural(information, information.unseen, j)
        )
    if low <= lower and high >= upper:
        span = f"its 95 % interval holds its whole range {lower:g} .. {upper:g}"
        return ParameterVerdict(UNIDENTIFIED, "; ".join([span, *_trade(information, j, factor)]))
    if half > IDENTIFIED_SHARE * choose_scale(value, lower, upper):
        why = _trade(information, j, factor) or ["the record hardly changes with it"]
        edge = [f"the estimate is at its bound {bound}" for bound in at]
        return ParameterVerdict(WEAK, "; ".join([*why, *edge]))
    if at:
        name = information.names[j]
        return ParameterVerdict(
            BOUND, f"{at[0]}; the record asks for a value beyond it: widen model.bounds.{name}"
        )
    if lower <= low and high <= upper:
        return ParameterVerdict(IDENTIFIED, "")
    return ParameterVerdict(IDENTIFIED, "the interval reaches past its bounds")


def _list_near(value: float, lower: float, upper: float) -> list[str]:
    """The bounds that a value is at, as texts."""
    near = BOUND_DISTANCE * (upper - lower)
    return [f"{bound:g}" for bound in (lower, upper) if abs(value - bound) < near]


def _trade(information: Information, j: int, factor: float) -> list[str]:
    """Against which parameters this one trades, and which combination is known; empty where there
    is none.
    """
    correlation = np.where(np.arange(len(information.names)) == j, 0.0, information.correlation[j])
    partners = [
        int(k) for k in np.argsort(-np.abs(correlation))[:PARTNERS] if abs(correlation[k]) >= TRADES
    ]
    if not partners:
        return []
    named = " and ".join(
        f"{information.names[k]} (correlation {_format_correlation(correlation[k])})"
        for k in partners
    )
    sentence = [f"trades against {named}"]
    k = partners[0]
    covariance = information.covariance
    values = information.values
    if values[j] > 0 and values[k] > 0:
        exponents = np.zeros(len(values))
        exponents[j], exponents[k] = (
            1.0,
            -covariance[j, k] / covariance[k, k] * values[k] / values[j],
        )
        error = factor * information.relative_error(exponents)
        if (
            error > IDENTIFIED_SHARE
            or abs(exponents[k]) > STEEPEST_COMBINATION
            or abs(exponents[k]) < 1 / STEEPEST_COMBINATION
        ):
            return sentence  # a combination that is hardly known, or that nobody would think in
        sentence.append(
            f"{format_combination(information.names, exponents)} is known to ± {100 * error:.2g} %"
        )
    return sentence


def _format_correlation(correlation: float) -> str:
    """A correlation with two digits, with four where it is nearly one."""
    return f"{correlation:.2f}" if abs(correlation) < 0.995 else f"{correlation:.4f}"


def _explain_structural(information: Information, unseen: np.ndarray, j: int) -> str:
    """Which changes leave the record unchanged, and which combinations of these parameters it does
    see, in a sentence.
    """
    with_it = [row for row in unseen if abs(row[j]) > SHARE]
    direction = min(with_it, key=lambda row: np.count_nonzero(np.abs(row) > SHARE))
    names, pivot = information.names, j  # told from the parameter in question
    direction = direction / direction[pivot]
    members = np.flatnonzero(np.abs(direction) > SHARE)
    if information.names[j] in information.held:
        return HELD
    if len(members) == 1:
        return "the record does not change with it at all"
    moves = ", ".join(f"{names[k]} {direction[k]:+.3g} %" for k in members)
    sentence = f"{moves}, changed together, leave the record unchanged"
    seen = []
    for k in members[members != pivot]:
        exponents = np.zeros(len(names))
        exponents[pivot], exponents[k] = -direction[k], 1.0
        if np.abs(unseen @ exponents).max() < SHARE:
            seen.append(format_combination(names, exponents))
    return sentence + (f"; what it sees is {', '.join(seen)}" if seen else "")


def format_combination(names: Sequence[str], exponents: np.ndarray) -> str:
    """A product of powers as text; powers of nearly 0 are left out.

    Examples
    --------
    >>> format_combination(("X_prime", "M"), np.array([2.0, -1.0]))
    'X_prime^2 / M'
    """
    above = []
    below = []
    for name, exponent in zip(names, exponents, strict=True):
        size = abs(exponent)
        if size < 0.005:
            continue
        power = name if abs(size - 1) < 0.005 else f"{name}^{size:.3g}"
        (above if exponent > 0 else below).append(power)
    top = " ".join(above) or "1"
    return top + "".join(f" / {power}" for power in below)
