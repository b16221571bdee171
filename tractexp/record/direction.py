"""The cause of a negative P: a load whose current is counted the wrong way, or a source."""

import numpy as np

DISTURBED = 0.03  # of the voltage: a larger deviation is a disturbance, which a load answers
# of the voltage: within this deviation P counts as before the disturbance
LARGEST_CALM_DEVIATION = 0.01
FEWEST_STATE_SAMPLES = 3  # samples in either state
# exponent of |P| over U from which on power falls with the voltage as a load's does
LEAST_LOAD_EXPONENT = 0.5
STEEPEST_EXPONENT = 4.0  # exponent that no load exceeds: what falls faster was switched off
IMPEDANCE = 1.3  # exponent above that of a constant current, which a converter may keep as well
LEAST_REACTIVE_SHARE = 0.1  # of |P|: a smaller Q says nothing about the direction
LEAST_SIGN_RATIO = 3.0  # times the noise that P must exceed to have a sign
# where that is certain
OUTWARD = "its current is counted out of it, or this feeder supplies such loads"
# of |P|: positive power of this size, at normal voltage, is a train that motors and brakes
REVERSED_SHARE = 0.1
LEAST_REVERSED_TIME = 0.02  # of a record
REMEDY = "set data.reverse_current=true"


def find_values_at_level(x: np.ndarray, share: float) -> np.ndarray:
    """Which of the values (N,), positive, lie within `share` of the level that most of them have;
    the higher of two.
    """
    ordered = np.sort(x)
    counts = np.searchsorted(ordered, ordered * (1 + share), "right") - np.searchsorted(
        ordered, ordered * (1 - share)
    )
    level = ordered[len(ordered) - 1 - int(np.argmax(counts[::-1]))]
    return np.abs(x - level) <= share * level


def explain_negative_power(
    U: np.ndarray, P: np.ndarray, Q: np.ndarray, polarity: int = 0, calm: np.ndarray | None = None
) -> str:
    """Explain why P is negative before a disturbance.

    A passive load draws negative-sequence current whatever its power does. Where there is none the
    answer of P and Q to the voltage decides: a load's |P| falls with U and returns, and so does its
    inductive Q; a converter keeps P or the current, or reverses.

    Parameters
    ----------
    U, P, Q : (N,)
        Voltage and powers.
    polarity : int
        The direction that the negative sequence shows: 1 as a load's, -1 reversed, 0 where it shows
        none.
    calm : (N,) bools
        Which samples are undisturbed; by default those about the voltage that lasts longest.

    Returns
    -------
    str
        One clause: the cause, or that power flows both ways. "" if P is not negative, or no sample
        is there to tell.
    """
    valid = np.isfinite(U) & np.isfinite(P) & np.isfinite(Q)
    if not valid.any() or (calm is not None and not (calm & valid).any()):
        return ""
    U, P, Q = U[valid], P[valid], Q[valid]
    calm_deviation = max(
        LARGEST_CALM_DEVIATION, 3 * _measure_usual_step(U) / max(float(np.median(U)), 1e-12)
    )
    calm = find_values_at_level(U, calm_deviation) if calm is None else calm[valid]
    level, P0, Q0 = (float(np.median(x[calm])) for x in (U, P, Q))
    normal = np.abs(U - level) <= calm_deviation * level
    least_power = LEAST_SIGN_RATIO * _measure_usual_step(P)
    if -least_power <= P0:
        return ""
    reversed_samples = np.count_nonzero(P[normal] > REVERSED_SHARE * abs(P0))
    if reversed_samples > max(FEWEST_STATE_SAMPLES, LEAST_REVERSED_TIME * len(P)):
        return (
            "P changes its sign at normal voltage, as of a train that brakes and motors: power"
            " flows both ways"
        )
    exponent, is_known = _find_exponent(U / level, P / P0)
    return _tell_cause(polarity, exponent, is_known, P0, Q0)


def _tell_cause(polarity: int, a: float, fell: bool, P0: float, Q0: float) -> str:
    """Why P is negative, by the negative sequence, else by |P| as U to the power `a` while the
    voltage `fell`.
    """
    if polarity < 0:
        return f"the negative-sequence current is that of a load turned round: {OUTWARD} ({REMEDY})"
    if polarity > 0:
        return (
            "the negative-sequence current is that of a load, so its direction is right and this is"
            " regeneration"
        )
    ambiguous = f"which cannot separate a reversed current ({REMEDY}) from regeneration"
    if not fell:
        return f"the voltage is never disturbed, {ambiguous}"
    answer = f"|P| goes as U^{round(a, 2) + 0.0:g} when the voltage falls"
    if _load_like(a, P0, Q0):
        return f"{answer}, as a load's: {OUTWARD} ({REMEDY})"
    if a < LEAST_LOAD_EXPONENT:
        return (
            f"{answer}, as a converter's or a generator's: regeneration (a braking train), no"
            " reversed current"
        )
    return f"{answer}, {ambiguous}"


def _measure_usual_step(x: np.ndarray) -> float:
    """The median size of the steps of values (N,); 0 of a single one."""
    return float(np.median(np.abs(np.diff(x)))) if len(x) > 1 else 0.0


def _load_like(a: float, P0: float, Q0: float) -> bool:
    """Whether power answers as that of a load with its sign turned: inductive, or as
    an impedance.
    """
    inductive = -Q0 > LEAST_REACTIVE_SHARE * -P0
    return a <= STEEPEST_EXPONENT and (
        (a >= LEAST_LOAD_EXPONENT and inductive)
        or (a >= IMPEDANCE and Q0 < LEAST_REACTIVE_SHARE * -P0)
    )


def _find_exponent(u: np.ndarray, p: np.ndarray) -> tuple[float, bool]:
    """(exponent of p over u while u is low, whether u is low long enough for it); p is 1 where u is
    1.
    """
    low = (u < 1 - DISTURBED) & (u > 0.1)
    if np.count_nonzero(low) < FEWEST_STATE_SAMPLES:
        return float("nan"), False
    x = np.log(u[low])
    y = np.log(np.clip(p[low], 0.05, None))
    return float(np.median(y / x)), True
