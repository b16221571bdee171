"""What a model calculates of one event beside what was recorded: P and Q, and of waveforms the
currents.

The record's estimator measures calculated waveforms as it does recorded ones, so that they compare
in P and Q, too.
"""

from dataclasses import dataclass, replace

import numpy as np

from tractexp.record import Event, Record, WaveEvent
from tractexp.record.phasor import Phasors
from tractexp.record.phasor_measurement import measure
from tractexp.recording.estimator import estimator_of

# Times the recorded apparent power, and that before the dip, which a load draws at a record's end
# whose motor has stalled: at standstill a motor draws four to eight times its own (IEC 60034-12).
STALLED_POWER = 2.0
LAST_SHARE = 0.1  # of a record: its end
AFTER = 0.15  # s after a dip's start in which the currents' error counts


@dataclass(frozen=True, eq=False, kw_only=True)
class Playback:
    """The measured and the calculated power of one event.

    Attributes
    ----------
    event : Event
        In phasors.
    P, Q : (N,) [pu]
        As calculated. Of waveforms they are what the record's estimator sees in the calculated
        currents.
    epsilon_p, epsilon_q : float
        The relative errors of Eq. (20), as fractions.
    epsilon_i : float or None
        That of the currents.
    waves : WaveEvent or None
        The event in waveforms.
    currents : (3, N) [pu] or None
        As calculated: alpha, beta and zero, at the samples of `waves`.
    unsettled : float or None
        The share by which they still change from one cycle to the next before the record.
    """

    event: Event
    P: np.ndarray  # calculated, pu
    Q: np.ndarray
    epsilon_p: float
    epsilon_q: float
    epsilon_i: float | None = None
    waves: WaveEvent | None = None
    currents: np.ndarray | None = None
    unsettled: float | None = None

    @property
    def stalls(self) -> bool:
        """Whether the load that is calculated diverges, or does not run up again after the dip as
        the recorded one did.
        """
        record, before = self.event.record, np.hypot(self.event.P0, self.event.Q0)
        S, recorded = np.hypot(self.P, self.Q), np.hypot(record.P, record.Q)
        valid = np.isfinite(recorded)
        if not np.isfinite(S[valid]).all():
            return bool(np.isfinite(S[0]))  # else it has no steady state
        last = max(self.event.end, round((1 - LAST_SHARE) * record.samples))
        valid[:last] = False
        if not valid.any():
            return False
        usual = max(recorded[valid].mean(), before)
        return bool(S[valid].mean() > STALLED_POWER * usual)

    @classmethod
    def of_power(cls, event: Event, P: np.ndarray, Q: np.ndarray) -> "Playback":
        """Calculated P and Q (N,) [pu] beside the recorded ones."""
        record = event.record
        return cls(
            event=event,
            P=P,
            Q=Q,
            epsilon_p=compute_relative_error(record.P, P),
            epsilon_q=compute_relative_error(record.Q, Q),
        )

    @classmethod
    def of_currents(cls, event: WaveEvent, currents: np.ndarray) -> "Playback":
        """Calculated currents (3, N) [pu] beside the recorded ones, and the phasors of both by one
        estimator.
        """
        return replace(
            cls.of_power(*measure_as_phasors(event, currents)),
            epsilon_i=compute_current_error(event, currents),
            waves=event,
            currents=currents,
            unsettled=measure_unsteadiness(event, currents),
        )


def compute_relative_error(measured: np.ndarray, calculated: np.ndarray) -> float:
    """epsilon of Eq. (20): rms of the difference over rms of the measurement.

    Parameters
    ----------
    measured, calculated : (N,)
        In the same unit; gaps (nan) of the measurement do not count.

    Returns
    -------
    float
        A fraction; nan where nothing was measured but zero.

    Examples
    --------
    >>> compute_relative_error(np.array([1.0, np.nan, 1.0]), np.array([1.1, 5.0, 0.9])).__round__(6)
    0.1
    """
    valid = np.isfinite(measured)
    size = float(np.linalg.norm(measured[valid]))
    return (
        float(np.linalg.norm((calculated - measured)[valid])) / size if size > 0 else float("nan")
    )


def compute_current_error(event: WaveEvent, currents: np.ndarray) -> float:
    """epsilon_i: the error of calculated currents about a dip.

    Parameters
    ----------
    event : WaveEvent
        With the recorded currents.
    currents : (3, N) [pu]
        As calculated: alpha, beta and zero.

    Returns
    -------
    float
        rms of the difference in all phases, from the dip's start to 0.15 s after it, over the rms
        of the recorded currents before the dip.
    """
    window = slice(event.start, event.start + round(AFTER / event.record.step))
    before = slice(event.first, event.start)
    rms = lambda i, part: float(np.sqrt(np.mean(event.of_phases(i)[:, part] ** 2)))  # noqa: E731
    recorded = np.nan_to_num(event.currents)
    compared = np.array(event.compared_channels)[:, None]
    return rms((currents - recorded) * compared, window) / rms(recorded, before)


def measure_unsteadiness(event: WaveEvent, currents: np.ndarray) -> float:
    """The share by which calculated currents still change from cycle to cycle before the record.

    A cycle is no whole number of samples: the earlier one is read off a cubic spline.

    Parameters
    ----------
    event : WaveEvent
        With a lead before its record.
    currents : (3, N) [pu]
        As calculated.

    Returns
    -------
    float
        The rms of the last cycle of the lead less the one before it, over that of the last one; nan
        where the lead is shorter than two cycles, and where the load diverges in it.
    """
    from scipy.interpolate import CubicSpline

    cycle = event.rate / event.f0
    last = np.arange(event.lead - round(cycle), event.lead)
    if event.lead < 2 * cycle + 2:
        return float("nan")
    first = int(last[0] - cycle) - 2
    lead = currents[:, first : event.lead]
    if not np.isfinite(lead).all():
        return float("nan")
    before = CubicSpline(np.arange(first, event.lead), lead, axis=1)(last - cycle)
    late = event.of_phases(currents[:, last])
    return float(
        np.sqrt(np.mean((late - event.of_phases(before)) ** 2) / max(np.mean(late**2), 1e-30))
    )


def measure_as_phasors(
    event: WaveEvent, currents: np.ndarray
) -> tuple[Event, np.ndarray, np.ndarray]:
    """The event in phasors of its recorded waveforms, and the power of calculated currents.

    Both are measured by one estimator from the same samples, so that its window cancels when they
    are compared.

    Parameters
    ----------
    event : WaveEvent
        As recorded.
    currents : (3, N) [pu]
        As calculated.

    Returns
    -------
    Event
        With M phasors.
    (M,) array [pu]
        P of the calculated currents.
    (M,) array [pu]
        Q of them.
    """
    measured, calculated = (
        _measure_phasors(event, i) for i in (np.nan_to_num(event.currents), currents)
    )
    was, own = event.phasors, event.phasors.record
    record = Record(
        own.name,
        measured.t,
        measured.U,
        measured.S.real,
        measured.S.imag,
        base=own.base,
        source=own.source,
        notes=own.notes,
        original_base=own.original_base,
        identity=own.identity,
        digest=own.digest,
    )
    start, end = np.searchsorted(measured.t, [was.t_start, was.t_end]).tolist()
    last = len(measured.t) - 1
    phasors = replace(
        was,
        record=record,
        start=min(start, last),
        end=min(end, last),
        steady=slice(0, max(start, 1)),
    )
    return phasors, calculated.S.real, calculated.S.imag


def _measure_phasors(event: WaveEvent, currents: np.ndarray) -> Phasors:
    """Phasors of the recorded voltage and of currents (3, N) [pu], whose U and S are
    per unit, too.
    """
    part = slice(event.lead, None)
    v = event.v * event.turn
    voltage = event.of_phases(np.stack([v.real, v.imag, event.v_zero]))
    size = np.sqrt(2 / event.phases)  # so that K V I* of the peaks' phasors is v i*
    waves = np.concatenate([voltage, event.of_phases(currents)])[:, part] * size
    recorded, base = event.phasors.record.waves, event.phasors.record.base
    assert recorded is not None
    window = estimator_of(recorded.estimator).averager
    return measure(
        waves, event.rate, base.frequency, float(event.record.t[event.lead]), window=window
    )
