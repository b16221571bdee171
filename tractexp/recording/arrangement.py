"""Checks of the chosen channels: phases or lines, their order, and the direction of the currents.

Each check uses times at which voltage and current are alive: a dead line after a trip has no order.
Labels and waveforms must agree. Where the order makes no sense and another one does, it is refused
and the other one proposed. It is never changed silently, because two orders can both look plausible
where the load is unusual.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from tractexp.configuration.plugin import chosen
from tractexp.errors import DATA, UserError, setting
from tractexp.record.direction import at_level, direction
from tractexp.record.phasor import sequences
from tractexp.recording.connection import usual
from tractexp.recording.feeder import Feeder
from tractexp.recording.label import (
    backward,
    find_residuals,
    groups,
    is_to_ground,
    kind,
    order,
)
from tractexp.recording.nominal_voltage import is_between_phases
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import (
    OTHER_FREQUENCY,
    frequency,
    frequency_of,
    nearest_nominal,
    network_frequency,
    snapshots,
)

LEAST_LIVE_SEQUENCE = 0.5  # of the upper level of V1: less is a fault, or a dead line
LOADED = 0.2  # of the upper level of I1, as well
LARGEST_CALM_VOLTAGE_SHARE = 0.05  # of the median V1: the state in which orders are compared
UNEVEN = 0.25  # V2 over V1 in the calm: no network's voltages are so uneven
LARGEST_SENSIBLE_UNBALANCE = 0.5  # I2 over I1 of an order that makes sense
SENSIBLE = 75.0  # degrees between V1 and I1 that a load has at most
BACKWARD = 135.0  # degrees from which on the current is turned round, or power fed back
LARGEST_REACTIVE_ANGLE = 2.0  # degrees about 90: a capacitor bank or a reactor, whatever its order
ZERO = 0.02  # V0 over V2 of line voltages in a fault to earth, whose sum is zero whatever happens
LEAST_FAULT_UNBALANCE = 0.05  # V2 over V1 of such a fault
EARTH = 0.1  # I0 over I1 of such a fault
ROOT3 = 0.02  # line over phase voltages may be so far from sqrt 3, and 3 degrees from 30
# degrees of I2 / V2 of a passive load: inductive, at most a little capacitive
ANSWERS = (-110.0, 30.0)
ADDED = 0.02  # V2 over V1 that must be added before the answer in I2 counts
# times the current before: more feeds a fault behind the current transformer, and says nothing of a
# load
FAULT = 2.5
TURNED = (
    "has the opposite polarity of the other two; mend its sign in the file (in a .cfg, that of its"
    " factor)"
)


# {recording: its voltages to ground and their levels}, which are compared with those of each load
_known_levels: WeakKeyDictionary[Recording, list[tuple[tuple[int, ...], float]]] = (
    WeakKeyDictionary()
)


@dataclass(frozen=True, eq=False)
class _LivePhasors:
    """Phasors of a feeder while it is alive, (3, M) each, and which of them are calm."""

    V: np.ndarray
    I: np.ndarray
    calm: np.ndarray
    current_turns: bool  # some current is a wave of the network's frequency, and not noise


class _OtherOrder(UserError):
    """An order of channels that makes no sense, with another one that should."""

    def __init__(
        self, why: str, remedy: str, voltages: Sequence[int], currents: Sequence[int]
    ) -> None:
        """Why an order of channels cannot be right, what mends it, and the channels in the order
        that may.
        """
        super().__init__(f"{why}{remedy}")
        self.why, self.voltages, self.currents = why, tuple(voltages), tuple(currents)


def tune_frequency(recording: Recording, numbers: Sequence[int]) -> Recording:
    """The recording with the nominal frequency that its voltages `numbers` really have, and a note
    where it differs.
    """
    f = frequency(recording, numbers)
    if (
        f is None
        or (nominal := nearest_nominal(f)) is None
        or abs(nominal / recording.frequency - 1) < OTHER_FREQUENCY
    ):
        return recording
    note = (
        f"the file declares {recording.frequency:g} Hz, but the voltage has {f:.5g} Hz while it is"
        f" alive: {nominal:.3g} Hz is taken for nominal"
    )
    return replace(recording, frequency=nominal, notes=(*recording.notes, note))


def arrange_feeder(recording: Recording, feeder: Feeder) -> Feeder:
    """The feeder unchanged, or with line voltages taken as such, and a sentence for each
    observation in `why`.

    Raises `UserError` where the order makes no sense: with another one, its P and Q, where that one
    is accepted.
    """
    try:
        return _arrange_order(recording, feeder)
    except _OtherOrder as other:
        advised = replace(feeder, voltages=other.voltages, currents=other.currents)
        refused = other
    try:
        _arrange_order(recording, advised)
    except UserError:
        raise UserError(
            f"{refused.why}; no other order of these channels makes sense either: they are not"
            " those of one load, or one is connected wrongly; 'tractexp look' shows what the file"
            " holds"
        ) from refused
    raise refused


def _arrange_order(recording: Recording, feeder: Feeder) -> Feeder:
    """As `arrange_feeder`; raises `_OtherOrder` with an order that nobody has tried yet."""
    _residuals(recording, feeder)
    feeder = _lines_by_label(recording, feeder)
    connection = chosen("connection", feeder.connection)
    live = _live_phasors(recording, feeder)
    if live is None:
        _labels(recording, feeder, None)
        return replace(
            feeder,
            why=(*feeder.why, "the order of the channels cannot be checked: nothing is alive"),
        )
    if len(live.V) < 3:
        return _note_direction(feeder, live)
    _lines(recording, feeder)
    if _to_ground(feeder) and (reason := _lines_by_shape(recording, feeder, live)):
        feeder = replace(feeder, connection=_between(feeder), why=(*feeder.why, reason))
        live = _live_phasors(recording, feeder) or live
    _voltages(recording, feeder, live)
    if connection.currents == 3 == len(live.V):
        if said := _labels(recording, feeder, live):
            feeder = replace(feeder, why=(*feeder.why, said))
        if live.current_turns:
            _currents(recording, feeder, live)
    return _note_direction(feeder, live)


def _residuals(recording: Recording, feeder: Feeder) -> None:
    """Refuse what is measured of all phases together, where a phase or a line is needed."""
    for key, numbers in (("voltages", feeder.voltages), ("currents", feeder.currents)):
        residuals = find_residuals([recording.channels[i] for i in numbers])
        if odd := [numbers[k] for k in residuals if len(numbers) > 1]:
            rest = [i for i in numbers if i not in odd]
            where = setting(f"data.{key}")
            raise UserError(
                f"{where}={[*numbers]}: {_name_channel(recording, odd[0])} is the residual of all"
                " phases, and no phase; give the phases, or with two line voltages or two current"
                f" transformers those alone: {where}={rest}"
            )


def _lines_by_label(recording: Recording, feeder: Feeder) -> Feeder:
    """Voltages that their labels call line to line, put in the order AB, BC, CA."""
    labels = (
        order([recording.channels[i] for i in feeder.voltages])
        if len(feeder.voltages) == 3
        else None
    )
    if not _to_ground(feeder) or labels is None or not labels[1]:
        return feeder
    voltages = tuple(feeder.voltages[labels[0].index(k)] for k in range(3))
    names = ", ".join(f"'{recording.channels[i].name}'" for i in voltages)
    why = (
        f"the voltages {names} are line to line, as their labels say:"
        f" data.connection={_between(feeder)} is used"
    )
    if backward([recording.channels[i] for i in voltages]):
        why += ", U21 as V1 - V2 (where it is V2 - V1, the power is the opposite)"
    return replace(feeder, voltages=voltages, connection=_between(feeder), why=(*feeder.why, why))


def _to_ground(feeder: Feeder) -> bool:
    """Whether three voltages are taken as they stand, to ground."""
    return len(feeder.voltages) == 3 and feeder.connection == usual(3, len(feeder.currents))


def _between(feeder: Feeder) -> Any:
    """The connection of the same channels with the voltages between phases."""
    return usual(len(feeder.voltages), len(feeder.currents), lines=True)


def _lines(recording: Recording, feeder: Feeder) -> None:
    """Refuse phase voltages where the connection needs line-to-line ones."""
    connection = chosen("connection", feeder.connection)
    labels = order([recording.channels[i] for i in feeder.voltages])
    if not connection.lines or labels is None or labels[1]:
        return
    names = ", ".join(
        f"{i} '{recording.channels[i].name}' [{recording.channels[i].unit}]"
        for i in feeder.voltages
    )
    raise UserError(
        f"{DATA.voltages}={[*feeder.voltages]}: {names} are labelled as phases to ground, and"
        f" {DATA.connection}={connection.name} takes line-to-line voltages; give three channels to"
        " ground, or lines"
    )


def _live_phasors(recording: Recording, feeder: Feeder) -> _LivePhasors | None:
    """The feeder's phasors while voltage and current are alive; None where they never are."""
    numbers = [*feeder.voltages, *feeder.currents]
    windows = snapshots(recording, numbers, frequency_of(recording, feeder.voltages))
    if windows is None or not any(windows.pure(i) for i in feeder.voltages):
        return None  # noise has no order
    connection = chosen("connection", feeder.connection)
    V = connection.voltage() @ windows.select_channels(feeder.voltages)
    I = (
        connection.current()
        @ windows.select_channels(feeder.currents)
        * (-1 if feeder.reverse_current else 1)
    )
    valid = np.isfinite(V).all(axis=0) & np.isfinite(I).all(axis=0)
    V, I = V[:, valid], I[:, valid]
    size, load = (np.linalg.norm(x, axis=0) for x in (V, I))
    if not V.shape[1] or size.max() == 0 or load.max() == 0:
        return None
    alive = size > LEAST_LIVE_SEQUENCE * np.percentile(size, 90)
    if len(V) == 3:
        small, large = np.sort(np.abs(sequences(V)), axis=0)  # whatever the order is
        even = alive & (small < LEAST_FAULT_UNBALANCE * large)
        even = even if even.any() else alive
    else:
        even = alive
    calm = np.zeros(len(size), bool)
    calm[even] = at_level(size[even], LARGEST_CALM_VOLTAGE_SHARE)
    # not of all: a fault may last longer than the calm
    alive &= load > LOADED * np.median(load[calm])
    if not (alive & calm).any():
        return None
    turns = any(windows.pure(i) for i in feeder.currents)
    return _LivePhasors(V[:, alive], I[:, alive], calm[alive], turns)


def _zero(x: np.ndarray) -> np.ndarray:
    """The size of the zero sequence of three channels (3, N)."""
    return np.abs(x.mean(axis=0))


def _names_ground(recording: Recording, numbers: Sequence[int]) -> bool:
    """Whether the name of a voltage says that it is to ground."""
    return any(is_to_ground(recording.channels[i]) for i in numbers)


def _lines_by_shape(recording: Recording, feeder: Feeder, live: _LivePhasors) -> str:
    """Why three voltages must be line to line though no label says so; "" where
    nothing shows it.
    """
    used = f"they are line to line, and data.connection={_between(feeder)} is used"
    V1, V2 = (np.abs(x) for x in sequences(live.V))
    I0, I1 = _zero(live.I), np.median(np.abs(sequences(live.I)[0])[live.calm])
    fault = (
        (V2 > LEAST_FAULT_UNBALANCE * V1) & (I0 > EARTH * I1) & (5 * np.median(I0[live.calm]) < I0)
    )
    if np.count_nonzero(fault) >= 2 and (_zero(live.V)[fault] < ZERO * V2[fault]).all():
        return (
            "the voltages add up to zero even in a fault to earth, where the currents do not:"
            f" {used}"
        )
    size = _level(recording, feeder.voltages)
    for numbers, other in _levels(recording):
        alike = abs(size / max(other, 1e-12) / np.sqrt(3) - 1) < 5 * ROOT3
        alike &= {*numbers}.isdisjoint(feeder.voltages)
        if alike and _root3(recording, feeder.voltages, numbers):
            others = ", ".join(_name_channel(recording, i) for i in numbers)
            return (
                f"the voltages are sqrt 3 times, and 30 degrees ahead of, those of {others}: {used}"
            )
    level = float(np.median(V1[live.calm]))
    if is_between_phases(level) and not _names_ground(recording, feeder.voltages):
        return f"{level:.4g} kV is near a nominal voltage, and times sqrt 3 near none: {used}"
    return ""


def _levels(recording: Recording) -> list[tuple[tuple[int, ...], float]]:
    """The voltages to ground of a recording, three by three, with their median
    positive sequence.
    """
    if recording not in _known_levels:
        volts = {i: c for i, c in enumerate(recording.channels) if kind(c) == "voltage"}
        three = [
            group.numbers for group in groups(volts) if len(group.numbers) == 3 and not group.pairs
        ]
        _known_levels[recording] = [(numbers, _level(recording, numbers)) for numbers in three]
    return _known_levels[recording]


def _level(recording: Recording, numbers: Sequence[int]) -> float:
    """Median positive sequence of three voltages while they are alive; 0 where they have no
    waveform.
    """
    windows = snapshots(recording, numbers, network_frequency(recording))
    if windows is None:
        return 0.0
    size = np.nan_to_num(np.abs(sequences(windows.select_channels(numbers))[0]))
    return float(np.median(size[size >= LEAST_LIVE_SEQUENCE * size.max()]))


def _root3(recording: Recording, ours: Sequence[int], theirs: Sequence[int]) -> bool:
    """Whether three voltages are the differences of three others."""
    windows = snapshots(recording, [*ours, *theirs])
    if windows is None:
        return False
    x, y = (sequences(windows.select_channels(numbers))[0] for numbers in (ours, theirs))
    large = np.nan_to_num(np.abs(y)) > LEAST_LIVE_SEQUENCE * np.nanmax(np.abs(y), initial=0)
    if not large.any():
        return False
    ratio = np.median(np.abs(x[large] / y[large])) * np.exp(
        1j * np.median(np.angle(x[large] / y[large]))
    )
    return abs(np.abs(ratio) / np.sqrt(3) - 1) < ROOT3 and abs(np.degrees(np.angle(ratio)) - 30) < 3


def _voltages(recording: Recording, feeder: Feeder, live: _LivePhasors) -> None:
    """Refuse voltages whose negative sequence exceeds the positive one while they are alive."""
    V1, V2 = (float(np.median(np.abs(x)[live.calm])) for x in sequences(live.V))
    if UNEVEN * V1 < V2 <= V1:
        names = ", ".join(_name_channel(recording, i) for i in feeder.voltages)
        raise UserError(
            f"{DATA.voltages}={[*feeder.voltages]}: in the calm, the negative sequence is"
            f" {100 * V2 / V1:.0f} % of the positive one: {names} are not the voltages of one bus;"
            " 'tractexp look' shows what the file holds"
        )
    if V2 <= V1:
        return
    if _to_ground(feeder) and (k := _find_reversed_phase(live.V[:, live.calm])) is not None:
        raise UserError(
            f"{DATA.voltages}={[*feeder.voltages]}: {_name_channel(recording, feeder.voltages[k])}"
            f" {TURNED}"
        )
    voltages, currents = _propose_other_order(feeder)
    raise _OtherOrder(
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
        first, second = (float(np.median(np.abs(x))) for x in sequences(tried))
        if max(second, float(np.median(_zero(tried)))) < 0.3 * first:
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


def _name_channel(recording: Recording, number: int) -> str:
    """ "channel 4 'Ia'"."""
    return f"channel {number} '{recording.channels[number].name}'"


def _labels(recording: Recording, feeder: Feeder, live: _LivePhasors | None) -> str:
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
        f"{DATA.currents} are the phases {_letters(c)} where {DATA.voltages} are {_letters(v)},"
        " says "
    )
    both = ""
    if live is not None:
        present, other = (0, 1, 2), tuple(feeder.currents.index(i) for i in labelled)
        if _is_balanced(live, present) and not _is_balanced(live, other):
            return f"{said}the file; the waves say that they are in the same order, which is taken"
        both = (
            f", which gives {_mw(_power(live, other))} where the present order has"
            f" {_mw(_power(live, present))}"
        )
    raise _OtherOrder(
        f"{said}{recording.source}",
        f"; give both in the same order: {_describe_arrangement(None, labelled)}{both}",
        feeder.voltages,
        labelled,
    )


def _is_balanced(live: _LivePhasors, permutation: tuple[int, ...]) -> bool:
    """Whether currents in an order have a positive sequence, and an angle that a load has or power
    fed back.
    """
    first, second = (np.median(np.abs(x)[live.calm]) for x in sequences(live.I[[*permutation]]))
    angle = abs(_angle(_power(live, permutation)))
    return bool(second < LARGEST_SENSIBLE_UNBALANCE * first) and not SENSIBLE < angle < BACKWARD


def _letters(places: Sequence[int]) -> str:
    """ "A, C" of the places 0 and 2."""
    return ", ".join("ABC"[k] for k in places)


def _power(live: _LivePhasors, permutation: tuple[int, ...]) -> complex:
    """P + jQ [MVA] in the calm state with the currents in another order."""
    S = 3 * sequences(live.V)[0] * sequences(live.I[[*permutation]])[0].conj()
    S = S[live.calm]
    return complex(np.median(S.real), np.median(S.imag))


def _angle(S: complex | np.complexfloating) -> float:
    """The angle of a power [degrees]."""
    return float(np.degrees(np.angle(S)))


def _mw(S: complex) -> str:
    """ "P = 12 MW, Q = 3 Mvar"."""
    P, Q = (0.0 if abs(x) < 1e-6 * abs(S) else x for x in (S.real, S.imag))
    return f"P = {P:.3g} MW, Q = {Q:.3g} Mvar"


def _currents(recording: Recording, feeder: Feeder, live: _LivePhasors) -> None:
    """Refuse an order of the currents that is impossible, or that makes no sense where another
    does.
    """
    I1, I2 = (float(np.median(np.abs(x)[live.calm])) for x in sequences(live.I))
    S = _power(live, (0, 1, 2))
    if I2 > I1:
        _negative(recording, feeder, live, S, I2 / max(I1, 1e-12))
        return
    labelled = [
        order([recording.channels[i] for i in each]) for each in (feeder.voltages, feeder.currents)
    ]
    confirmed = None not in labelled
    middle = (
        SENSIBLE < abs(_angle(S)) < BACKWARD and abs(abs(_angle(S)) - 90) > LARGEST_REACTIVE_ANGLE
    )
    if confirmed or not middle or I2 > LARGEST_SENSIBLE_UNBALANCE * I1:
        return
    better = [
        p
        for p in ((1, 2, 0), (2, 0, 1))
        if abs(_angle(_power(live, p))) <= SENSIBLE and _answers(live, p) >= 0
    ]
    if len(better) == 1:
        _refuse(
            feeder,
            live,
            better[0],
            f"P and Q make no sense ({_mw(S)}): the currents are rotated against the voltages",
        )


def _negative(
    recording: Recording, feeder: Feeder, live: _LivePhasors, S: complex, ratio: float
) -> None:
    """Refuse currents of the opposite sequence where another order, or one turned round, is
    balanced.
    """
    if (k := _find_reversed_phase(live.I[:, live.calm])) is not None:
        raise UserError(
            f"{DATA.currents}={[*feeder.currents]}: {_name_channel(recording, feeder.currents[k])}"
            f" {TURNED}"
        )
    tried = []
    for p in permutations(range(3)):
        first, second = (float(np.median(np.abs(x)[live.calm])) for x in sequences(live.I[[*p]]))
        if second < LARGEST_SENSIBLE_UNBALANCE * first:
            tried.append(p)
    if tried:
        best = min(tried, key=lambda p: abs(_angle(_power(live, p))))
        why = (
            f"the currents' negative sequence is {ratio:.3g} times the positive one ({_mw(S)}): two"
            " are swapped"
        )
        _refuse(feeder, live, best, why)


def _refuse(feeder: Feeder, live: _LivePhasors, permutation: tuple[int, ...], why: str) -> None:
    """Raise the error that proposes currents in another order."""
    proposal = tuple(feeder.currents[k] for k in permutation)
    raise _OtherOrder(
        f"{DATA.currents}={[*feeder.currents]}: {why}",
        f"; {_describe_arrangement(None, proposal)} gives {_mw(_power(live, permutation))}",
        feeder.voltages,
        proposal,
    )


def _answers(live: _LivePhasors, permutation: tuple[int, ...] = (0, 1, 2)) -> int:
    """1 where the added I2 is what a passive load draws from the added V2, -1 where it is turned
    round, else 0.
    """
    V2, I2 = sequences(live.V)[1], sequences(live.I[[*permutation]])[1]
    V1 = np.abs(sequences(live.V)[0])
    V2, I2 = V2 * _still(live), I2 * _still(live)
    dV, dI = V2 - np.median(V2[live.calm]), I2 - np.median(I2[live.calm])
    changed = np.abs(dV) > ADDED * np.median(V1)
    most = np.abs(live.I).max(axis=0)
    if np.count_nonzero(changed) < 2 or most[changed].max() > FAULT * np.median(most[live.calm]):
        return 0
    Y = np.vdot(dV[changed], dI[changed])
    low, high = ANSWERS
    if low <= _angle(Y) <= high:
        return 1
    return -1 if low <= _angle(-Y) <= high else 0


def _still(live: _LivePhasors) -> np.ndarray:
    """What turns phasors so that V1 has angle zero: windows far apart can then be compared."""
    V1 = sequences(live.V)[0]
    return V1.conj() / np.maximum(np.abs(V1), 1e-12)


def _note_direction(feeder: Feeder, live: _LivePhasors) -> Feeder:
    """The feeder with a sentence on negative power, where it is."""
    if len(live.V) == 3:
        V1, I1 = sequences(live.V)[0], sequences(live.I)[0]
        polarity = _answers(live)
    else:
        V1, I1, polarity = live.V[0], live.I[0], 0
    S = len(live.V) * V1 * I1.conj()
    reason = direction(np.abs(V1), S.real, S.imag, polarity, live.calm)
    if not reason:
        return feeder
    middle = complex(np.median(S[live.calm].real), np.median(S[live.calm].imag))
    return replace(feeder, why=(*feeder.why, f"{_mw(middle)}: {reason}"))
