"""Orders and signs of channels that make no sense, and those that should be meant."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.record.phasor import compute_sequences
from tractexp.recording.feeder import Feeder
from tractexp.recording.label import name_channel, order
from tractexp.recording.line_voltage import is_taken_to_ground
from tractexp.recording.live_phasors import (
    LivePhasors,
    compute_power,
    find_answer,
    format_power,
    measure_angle,
    measure_zero_sequence,
)
from tractexp.recording.recording import Recording

UNEVEN = 0.25  # V2 over V1 in the calm: no network's voltages are so uneven
LARGEST_SENSIBLE_UNBALANCE = 0.5  # I2 over I1 of an order that makes sense
SENSIBLE = 75.0  # degrees between V1 and I1 that a load has at most
BACKWARD = 135.0  # degrees from which on the current is turned round, or power fed back
LARGEST_REACTIVE_ANGLE = 2.0  # degrees about 90: a capacitor bank or a reactor, whatever its order
TURNED = (
    "has the opposite polarity of the other two; mend its sign in the file (in a .cfg, that of its"
    " factor)"
)


class OtherOrder(UserError):
    """An order of channels that makes no sense, with another one that should."""

    def __init__(
        self, why: str, remedy: str, voltages: Sequence[int], currents: Sequence[int]
    ) -> None:
        """Why an order of channels cannot be right, what mends it, and the channels in the order
        that may.
        """
        super().__init__(f"{why}{remedy}")
        self.why, self.voltages, self.currents = why, tuple(voltages), tuple(currents)


def check_voltages(recording: Recording, feeder: Feeder, live: LivePhasors) -> None:
    """Refuse voltages whose negative sequence exceeds the positive one while they are alive."""
    V1, V2 = (float(np.median(np.abs(x)[live.calm])) for x in compute_sequences(live.V))
    if UNEVEN * V1 < V2 <= V1:
        names = ", ".join(name_channel(recording, i) for i in feeder.voltages)
        raise UserError(
            f"{DATA.voltages}={[*feeder.voltages]}: in the calm, the negative sequence is"
            f" {100 * V2 / V1:.0f} % of the positive one: {names} are not the voltages of one bus;"
            " 'tractexp look' shows what the file holds"
        )
    if V2 <= V1:
        return
    k = _find_reversed_phase(live.V[:, live.calm])
    if is_taken_to_ground(feeder) and k is not None:
        raise UserError(
            f"{DATA.voltages}={[*feeder.voltages]}: {name_channel(recording, feeder.voltages[k])}"
            f" {TURNED}"
        )
    voltages, currents = _propose_other_order(feeder)
    raise OtherOrder(
        f"{DATA.voltages}={[*feeder.voltages]}: the phases are not in the order a, b, c: while"
        f" alive, the negative sequence is {V2 / max(V1, 1e-12):.3g} times the positive one",
        f"; give {_describe_arrangement(voltages, currents)}",
        voltages,
        currents,
    )


def _propose_other_order(feeder: Feeder) -> tuple[list[int], Sequence[int]]:
    """(voltages, currents) in the other order of phases, in ascending numbers where that is
    possible.
    """
    n = len(feeder.voltages)
    turns = (
        [(0, 2, 1), (2, 1, 0), (1, 0, 2)]
        if n == 3 == len(feeder.currents)
        else [(*range(n)[::-1],)]
    )
    best = min(turns, key=lambda p: [feeder.voltages[k] for k in p])
    currents = (
        [feeder.currents[k] for k in best] if len(feeder.currents) == n else feeder.currents[::-1]
    )
    return [feeder.voltages[k] for k in best], currents


def _find_reversed_phase(X: np.ndarray) -> int | None:
    """The one of three phasors that must be turned round for them to be balanced; None where that
    does not help.
    """
    for k in range(3):
        tried = X.copy()
        tried[k] *= -1
        first, second = (float(np.median(np.abs(x))) for x in compute_sequences(tried))
        if max(second, float(np.median(measure_zero_sequence(tried)))) < 0.3 * first:
            return k
    return None


def _describe_arrangement(voltages: Sequence[int] | None, currents: Sequence[int]) -> str:
    """The settings that name these channels."""
    currents_text = f"{DATA.currents}=[{', '.join(map(str, currents))}]"
    return (
        currents_text
        if voltages is None
        else f"{DATA.voltages}=[{', '.join(map(str, voltages))}] {currents_text}"
    )


def check_labels(recording: Recording, feeder: Feeder, live: LivePhasors | None) -> str:
    """Refuse currents that are labelled in another order than the voltages; what is said where the
    waves contradict.
    """
    channels = recording.channels
    volts, amps = (
        order([channels[i] for i in each]) for each in (feeder.voltages, feeder.currents)
    )
    if volts is None or amps is None or volts[1] or amps[1] or volts[0] == amps[0]:
        return ""
    (v, _), (c, _) = volts, amps
    if len(v) < 3 or len(c) < 3:
        return ""
    labelled = tuple(feeder.currents[c.index(k)] for k in v)
    said = (
        f"{DATA.currents} are the phases {_name_phases(c)} where {DATA.voltages} are"
        f" {_name_phases(v)}, says "
    )
    both = ""
    if live is not None:
        present, other = (0, 1, 2), tuple(feeder.currents.index(i) for i in labelled)
        if _is_balanced(live, present) and not _is_balanced(live, other):
            return f"{said}the file; the waves say that they are in the same order, which is taken"
        both = (
            f", which gives {format_power(compute_power(live, other))} where the present order has"
            f" {format_power(compute_power(live, present))}"
        )
    raise OtherOrder(
        f"{said}{recording.source}",
        f"; give both in the same order: {_describe_arrangement(None, labelled)}{both}",
        feeder.voltages,
        labelled,
    )


def _is_balanced(live: LivePhasors, permutation: tuple[int, ...]) -> bool:
    """Whether currents in an order have a positive sequence, and an angle that a load has or power
    fed back.
    """
    first, second = (
        np.median(np.abs(x)[live.calm]) for x in compute_sequences(live.I[[*permutation]])
    )
    angle = abs(measure_angle(compute_power(live, permutation)))
    return bool(second < LARGEST_SENSIBLE_UNBALANCE * first) and not SENSIBLE < angle < BACKWARD


def _name_phases(places: Sequence[int]) -> str:
    """ "A, C" of the places 0 and 2."""
    return ", ".join("ABC"[k] for k in places)


def check_currents(recording: Recording, feeder: Feeder, live: LivePhasors) -> None:
    """Refuse an order of the currents that is impossible, or that makes no sense where another
    does.
    """
    I1, I2 = (float(np.median(np.abs(x)[live.calm])) for x in compute_sequences(live.I))
    S = compute_power(live, (0, 1, 2))
    if I2 > I1:
        _refuse_negative_sequence(recording, feeder, live, S, I2 / max(I1, 1e-12))
        return
    labelled = [
        order([recording.channels[i] for i in each]) for each in (feeder.voltages, feeder.currents)
    ]
    confirmed = None not in labelled
    size = abs(measure_angle(S))
    middle = SENSIBLE < size < BACKWARD and abs(size - 90) > LARGEST_REACTIVE_ANGLE
    if confirmed or not middle or I2 > LARGEST_SENSIBLE_UNBALANCE * I1:
        return
    better = [
        p
        for p in ((1, 2, 0), (2, 0, 1))
        if abs(measure_angle(compute_power(live, p))) <= SENSIBLE and find_answer(live, p) >= 0
    ]
    if len(better) == 1:
        _refuse(
            feeder,
            live,
            better[0],
            f"P and Q make no sense ({format_power(S)}): the currents are rotated against the"
            " voltages",
        )


def _refuse_negative_sequence(
    recording: Recording, feeder: Feeder, live: LivePhasors, S: complex, ratio: float
) -> None:
    """Refuse currents of the opposite sequence where another order, or one turned round, is
    balanced.
    """
    if (k := _find_reversed_phase(live.I[:, live.calm])) is not None:
        raise UserError(
            f"{DATA.currents}={[*feeder.currents]}: {name_channel(recording, feeder.currents[k])}"
            f" {TURNED}"
        )
    tried = []
    for p in permutations(range(3)):
        first, second = (
            float(np.median(np.abs(x)[live.calm])) for x in compute_sequences(live.I[[*p]])
        )
        if second < LARGEST_SENSIBLE_UNBALANCE * first:
            tried.append(p)
    if tried:
        best = min(tried, key=lambda p: abs(measure_angle(compute_power(live, p))))
        why = (
            f"the currents' negative sequence is {ratio:.3g} times the positive one"
            f" ({format_power(S)}): two are swapped"
        )
        _refuse(feeder, live, best, why)


def _refuse(feeder: Feeder, live: LivePhasors, permutation: tuple[int, ...], why: str) -> None:
    """Raise the error that proposes currents in another order."""
    proposal = tuple(feeder.currents[k] for k in permutation)
    power = format_power(compute_power(live, permutation))
    raise OtherOrder(
        f"{DATA.currents}={[*feeder.currents]}: {why}",
        f"; {_describe_arrangement(None, proposal)} gives {power}",
        feeder.voltages,
        proposal,
    )
