"""Why a recording shows no load by itself, and whether settings can help."""

from tractexp.errors import UserError
from tractexp.recording.channel_group import list_waves
from tractexp.recording.label import find_kind, is_other_quantity
from tractexp.recording.railway import describe_direct_voltage
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import find_nominal_frequency, measure_frequency, take_snapshots


def can_be_named(recording: Recording) -> bool:
    """Whether settings that name voltages and currents can help: there are waves that may be one
    and the other.
    """
    if describe_direct_voltage(recording):
        return False
    try:
        recording.waveforms()
    except UserError:
        return False
    numbers = [
        i
        for i, c in enumerate(recording.channels)
        if c.form == "waveform" and not is_other_quantity(c)
    ]
    f = measure_frequency(recording, numbers)
    phasors = take_snapshots(recording, numbers, f) if f and find_nominal_frequency(f) else None
    waves = [recording.channels[i] for i in numbers if phasors is not None and phasors.pure(i)]
    volts, amps = (
        sum(c.quantity in (quantity, "") for c in waves) for quantity in ("voltage", "current")
    )
    return volts > 0 and amps > 0 and len(waves) > 1


def explain_unrecognized(recording: Recording) -> str:
    """Why a recording shows no load by itself, one clause."""
    longest = max(recording.segments, key=lambda s: (s.stop - s.first) / s.rate)
    seconds = (longest.stop - longest.first) / longest.rate
    try:
        recording.waveforms()
    except UserError as error:
        return describe_direct_voltage(recording) or str(error).removeprefix(
            f"{recording.source}: "
        )
    if 2 / recording.frequency >= seconds:
        return (
            f"it lasts {seconds:.3g} s at {longest.rate:g} Hz, less than two cycles of"
            f" {recording.frequency:g} Hz"
        )
    if direct := describe_direct_voltage(recording):
        return direct
    quantities = ("voltage", "current")
    if lacking := next((each for each in quantities if not list_waves(recording, each)), ""):
        units = ", ".join(sorted({f"'{c.unit.strip()}'" for c in recording.channels}))
        return f"no channel is a {lacking} by its unit, of which there are {units}, or by its name"
    return _explain_voltages(recording)


def _explain_voltages(recording: Recording) -> str:
    """Why a recording with voltages and currents shows no load."""
    volts = [i for i, c in enumerate(recording.channels) if find_kind(c) == "voltage"]
    f = measure_frequency(recording, volts)
    if f is not None and find_nominal_frequency(f) is None:
        return f"the strongest line of its voltages is at {f:.3g} Hz, which is no network's"
    phasors = take_snapshots(recording, volts)
    if phasors is None or not any(phasors.size([i]) > 0 for i in volts):
        return "its voltages are zero"
    return "no three voltages and currents have names or angles of phases"
