"""Why a fall of the voltage is no dip that can be fitted."""

import numpy as np

from tractexp.record.change import measure_smear
from tractexp.record.fall import FEWEST_BEFORE, SHALLOWEST, choose_margin
from tractexp.record.record import DEAD_VOLTAGE_SHARE, Record

OPEN_POLE = 0.25  # of the voltage: negative sequence of an open pole, of a fault as well
PHASE_GONE = 0.42  # the same where next to nothing of a phase is left
UNCLEARED = 1.5  # s: back-up protection clears a fault within about a second
# Of a current that stays: how far it moves, and for how much of the time it may move farther.
# Motors answer a fault of one phase by a tenth.
SAME_CURRENT = 0.05
LARGEST_TAP_STEP = 0.15  # of the voltage: a tap changer or a switched line moves it no farther
STEP_LASTS = 0.3  # s of a new level before it is one
UNFINISHED = 0.1  # s: a record that ends sooner in a dip shows no answer of the load
# Hz, samples: a dip of fewer samples at a lower rate shows no response
COARSE, FEWEST_INSIDE = 20.0, 5


def explain_no_such_dip(record: Record, start: int, end: int) -> str:
    """Why a fall of the voltage is not a dip that can be fitted, a clause; "" where it is one."""
    t, U = record.t, record.U
    before = float(U[:start].mean())
    inside = U[start:end]
    lowest, when = float(inside.min()), f"at t = {t[start]:g} s"
    if _does_current_stay(record, start, end):
        return (
            f"the voltage falls to {lowest:.3g} {when} while the current stays as it was: a fuse of"
            " the voltage transformers, or their wiring, and no dip of the network; choose another"
            " event"
        )
    if lowest < DEAD_VOLTAGE_SHARE * before:
        if end < len(U):
            return (
                f"the voltage is gone from t = {t[start]:g} to {t[end]:g} s (U falls to"
                f" {lowest:.3g}): an interruption, no dip, after which loads start anew; choose"
                " another event"
            )
        return (
            f"the voltage is gone from t = {t[start]:g} s on (U falls to {lowest:.3g}): the line is"
            " dead, which is no dip; choose another event"
        )
    if record.U2 is not None:
        unbalanced = record.U2[start:end] > OPEN_POLE * inside
        if np.count_nonzero(unbalanced) * record.step > UNCLEARED:
            share = float(np.median(record.U2[start:end][unbalanced] / inside[unbalanced]))
            return (
                f"U2 is {100 * share:.3g} % of U for"
                f" {np.count_nonzero(unbalanced) * record.step:.2g} s {when}, longer than a fault"
                " lasts: one pole is open, which is no dip of all phases; choose another event"
            )
    if end == len(U) and (reason := _explain_unfinished_fall(record, start, before)):
        return reason
    if record.rate < COARSE and end - start < FEWEST_INSIDE:
        return (
            f"the dip {when} has {end - start} samples at {record.rate:.3g} Hz: too coarse to show"
            f" a response; give a record of at least {COARSE:g} Hz"
        )
    return ""


def _does_current_stay(record: Record, start: int, end: int) -> bool:
    """Whether a voltage that is gone, or unbalanced for longer than a fault lasts, leaves the
    current as it was.
    """
    edge = max(1, round(measure_smear(record)))
    inside, before = (
        slice(start + edge, end - edge * (end < record.samples)),
        slice(max(0, start - 10 * edge), start),
    )
    if inside.stop - inside.start < max(3 * edge, FEWEST_INSIDE):
        return False
    U = record.U[inside]
    share = 0.0 if record.U2 is None else float(np.median(record.U2[inside] / np.maximum(U, 1e-12)))
    gone = float(np.median(U)) < DEAD_VOLTAGE_SHARE * float(record.U[:start].mean())
    if not gone and not share > (
        OPEN_POLE if (end - start) * record.step > UNCLEARED else PHASE_GONE
    ):
        return False
    usual, current = (
        np.hypot(record.P[at], record.Q[at]) / np.maximum(record.U[at], 1e-12)
        for at in (before, inside)
    )
    level = float(np.nanmedian(usual)) if np.isfinite(usual).any() else 0.0
    return level > 0 and bool(
        (np.abs(current / level - 1) < SAME_CURRENT).mean() > 1 - SAME_CURRENT
    )


def _explain_unfinished_fall(record: Record, start: int, before: float) -> str:
    """The reason against a fall that lasts to the record's end; "" where the load's answer in it is
    recorded.
    """
    t, U = record.t, record.U
    fall = 1 - float(np.median(U[start:])) / before
    level = np.abs(U[start:] / float(np.median(U[start:])) - 1) <= choose_margin(U)
    lasts = float(t[-1] - t[start])
    if fall <= LARGEST_TAP_STEP and lasts >= STEP_LASTS and level.mean() > 0.8:
        return (
            f"the voltage falls by {100 * fall:.3g} % at t = {t[start]:g} s and stays there for the"
            f" {lasts:.2g} s that remain: a step (a tap changer, or something switched), no dip;"
            " choose another event"
        )
    if lasts >= UNFINISHED and len(U) - start >= FEWEST_BEFORE:
        return ""
    return (
        f"the record is shorter than the dip: it ends at t = {t[-1]:g} s with U = {U[-1]:.3g} where"
        f" it was {before:.3g} before the dip of t = {t[start]:g} s; give a record that shows"
        f" {1000 * UNFINISHED:g} ms of the dip, better its recovery"
    )


def explain_no_dip(record: Record) -> str:
    """Why a record holds no dip, in a sentence with what its voltage does instead."""
    U, t = record.U, record.t
    reference, margin = float(np.median(U[:FEWEST_BEFORE])), choose_margin(U)
    if reference <= 0:
        return (
            f"{record.where}: there is no dip: the voltage starts at zero; give a record of a live"
            " line"
        )
    low, high = int(np.argmin(U)), int(np.argmax(U))
    fall, rise = 1 - U[low] / reference, U[high] / reference - 1
    start = f"{record.where}: there is no dip: the voltage starts at {reference:.4g} and falls"
    if fall <= margin:
        sentence = (
            f"{start} at most {100 * fall:.3g} % below it (t = {t[low]:g} s), but a dip must exceed"
            f" {100 * SHALLOWEST:g} % and the noise"
        ) + (f", here {100 * margin:.3g} %" if margin > SHALLOWEST else "")
    else:
        sentence = f"{start} by {100 * fall:.3g} % (t = {t[low]:g} s), but slowly: a ramp, no dip"
    if rise > margin:
        sentence += (
            f"; it rises by {100 * rise:.3g} % at t = {t[high]:g} s: a swell is not fitted, and a"
            " record that starts inside a dip lacks the steady state before it"
        )
    return sentence
