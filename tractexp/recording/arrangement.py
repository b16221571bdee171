"""Checks of the chosen channels: phases or lines, their order, and the direction of the currents.

Each check uses times at which voltage and current are alive: a dead line after a trip has no order.
Labels and waveforms must agree. Where the order makes no sense and another one does, it is refused
and the other one proposed. It is never changed silently, because two orders can both look plausible
where the load is unusual.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tractexp.configuration.plugin import build_chosen
from tractexp.errors import UserError, name_setting
from tractexp.record.direction import explain_negative_power
from tractexp.record.phasor import compute_sequences
from tractexp.recording.channel_order import (
    OtherOrder,
    check_currents,
    check_labels,
    check_voltages,
)
from tractexp.recording.feeder import Feeder
from tractexp.recording.label import find_residuals, name_channel
from tractexp.recording.line_voltage import (
    check_lines,
    explain_lines_by_shape,
    is_taken_to_ground,
    name_line_connection,
    take_lines_by_label,
)
from tractexp.recording.live_phasors import (
    LivePhasors,
    find_answer,
    format_power,
    measure_live_phasors,
)
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import OTHER_FREQUENCY, find_nominal_frequency, measure_frequency


def tune_frequency(recording: Recording, numbers: Sequence[int]) -> Recording:
    """The recording with the nominal frequency that its voltages `numbers` really have, and a note
    where it differs.
    """
    f = measure_frequency(recording, numbers)
    if (
        f is None
        or (nominal := find_nominal_frequency(f)) is None
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
    except OtherOrder as other:
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
    """As `arrange_feeder`; raises `OtherOrder` with an order that nobody has tried yet."""
    _refuse_residuals(recording, feeder)
    feeder = take_lines_by_label(recording, feeder)
    connection = build_chosen("connection", feeder.connection)
    live = measure_live_phasors(recording, feeder)
    if live is None:
        check_labels(recording, feeder, None)
        return replace(
            feeder,
            why=(*feeder.why, "the order of the channels cannot be checked: nothing is alive"),
        )
    if len(live.V) < 3:
        return _note_direction(feeder, live)
    check_lines(recording, feeder)
    if is_taken_to_ground(feeder) and (reason := explain_lines_by_shape(recording, feeder, live)):
        feeder = replace(feeder, connection=name_line_connection(feeder), why=(*feeder.why, reason))
        live = measure_live_phasors(recording, feeder) or live
    check_voltages(recording, feeder, live)
    if connection.currents == 3 == len(live.V):
        if said := check_labels(recording, feeder, live):
            feeder = replace(feeder, why=(*feeder.why, said))
        if live.current_turns:
            check_currents(recording, feeder, live)
    return _note_direction(feeder, live)


def _refuse_residuals(recording: Recording, feeder: Feeder) -> None:
    """Refuse what is measured of all phases together, where a phase or a line is needed."""
    for key, numbers in (("voltages", feeder.voltages), ("currents", feeder.currents)):
        residuals = find_residuals([recording.channels[i] for i in numbers])
        if odd := [numbers[k] for k in residuals if len(numbers) > 1]:
            rest = [i for i in numbers if i not in odd]
            where = name_setting(f"data.{key}")
            raise UserError(
                f"{where}={[*numbers]}: {name_channel(recording, odd[0])} is the residual of all"
                " phases, and no phase; give the phases, or with two line voltages or two current"
                f" transformers those alone: {where}={rest}"
            )


def _note_direction(feeder: Feeder, live: LivePhasors) -> Feeder:
    """The feeder with a sentence on negative power, where it is."""
    if len(live.V) == 3:
        V1, I1 = compute_sequences(live.V)[0], compute_sequences(live.I)[0]
        polarity = find_answer(live)
    else:
        V1, I1, polarity = live.V[0], live.I[0], 0
    S = len(live.V) * V1 * I1.conj()
    reason = explain_negative_power(np.abs(V1), S.real, S.imag, polarity, live.calm)
    if not reason:
        return feeder
    middle = complex(np.median(S[live.calm].real), np.median(S[live.calm].imag))
    return replace(feeder, why=(*feeder.why, f"{format_power(middle)}: {reason}"))
