"""What is said of a channel's quality, against what was put into it."""

import numpy as np
import pytest
from field_waves import KV, noise, phases, recording, wave

from tractexp.filetypes import comtrade
from tractexp.recording import Channel, Recording, Segment
from tractexp.recording.quality import assess_quality

RATE = 3200.0
T = np.arange(6400) / RATE
CLEAN = wave(T, phases(np.full(len(T), KV)))[0]


def of(x, rate=RATE, **changed):
    channel = Channel("Ua", x, "kV", "voltage", **changed)
    segment = Segment(0, len(x), rate, 0.0)
    return assess_quality(Recording("made.cfg", [channel], [segment]), 0, segment)


@pytest.mark.parametrize("share", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("seed", range(3))
def test_white_noise_is_measured_and_called_white(share, seed):
    made = of(CLEAN + KV * noise(len(T), share, seed))
    assert made.noise == pytest.approx(share * KV, rel=0.1)
    assert made.colour == "white"
    assert abs(made.lag) < 0.12
    assert made.level == pytest.approx(KV, rel=1e-3)
    assert made.fit == "fit for phasors and for waves"


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_lowpass_is_coloured_and_a_differenced_one_blue(seed):
    white = noise(len(T) + 8, 1e-3, seed) * KV
    low = np.convolve(white, np.full(5, 0.2), "same")[: len(T)]
    assert of(CLEAN + low).colour == "coloured"
    assert of(CLEAN + np.diff(white)[: len(T)]).colour == "blue"


@pytest.mark.parametrize("f", [48.7, 50.0, 51.3])
def test_neither_frequency_nor_drift_nor_harmonics_pass_for_noise(f):
    x = wave(T, KV * np.linspace(1, 1.002, len(T))[None], f)[0]
    x += 0.03 * KV * np.sqrt(2) * np.cos(2 * np.pi * 5 * f * T) + 0.04 * KV * np.sqrt(2) * np.cos(
        2 * np.pi * 7 * f * T
    )
    made = of(x + KV * noise(len(T), 1e-4))
    assert made.thd == pytest.approx(0.05, rel=0.02)
    assert made.noise == pytest.approx(1e-4 * KV, rel=0.2)


def test_noise_is_that_of_the_quiet_part():
    fault = (T > 0.5) & (T < 0.9)
    x = CLEAN * np.where(fault, 0.3, 1.0) + KV * noise(len(T), 5e-4)
    x[fault] += 5 * noise(np.count_nonzero(fault), KV, 1)
    assert of(x).noise == pytest.approx(5e-4 * KV, rel=0.15)


def test_a_dead_stretch_is_not_the_quiet_part():
    x = CLEAN * np.where((T > 0.3) & (T < 1.5), 0.0, 1.0) + KV * noise(len(T), 1e-4)
    assert of(x).level == pytest.approx(KV, rel=1e-2)


def test_offset():
    assert of(CLEAN + 1.7 + KV * noise(len(T), 1e-3)).offset == pytest.approx(1.7, abs=0.02)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_quantisation_and_effective_bits(bits):
    gain = 2.2 * np.sqrt(2) * KV / 2**bits
    x = wave(T, phases(np.full(len(T), KV)), 49.7)[0]
    raw = np.round(x / gain).astype(np.int16 if bits < 16 else np.int32)
    made = of(raw, gain=gain)
    assert made.step == pytest.approx(gain)
    assert made.bits == pytest.approx(bits, abs=0.3)
    if bits < 16:  # a file of floats shows its step where enough of its values occur
        assert of(raw * gain).step == pytest.approx(gain, rel=1e-6)


@pytest.mark.parametrize("share", [0.5, 0.7, 0.95])
def test_clipping_is_the_share_of_samples_that_are_stuck(share):
    limit = share * np.abs(CLEAN).max()
    made = of(np.clip(CLEAN, -limit, limit))
    assert made.clipped == pytest.approx(np.mean(np.abs(CLEAN) >= limit), abs=0.02)
    assert "clipped" in made.fit


@pytest.mark.parametrize("rate", [600.0, 3200.0, 51200.0])
def test_an_unclipped_wave_is_not_clipped(rate):
    t = np.arange(round(2 * rate)) / rate
    for f in (16.7, 50.0, 60.0):
        assert of(np.sqrt(2) * KV * np.cos(2 * np.pi * f * t), rate).clipped == 0
        assert (
            of(
                np.round(30000 * np.cos(2 * np.pi * f * t)).astype(np.int16), rate, gain=0.01
            ).clipped
            < 1e-3
        )


def test_clipping_at_the_limits_of_the_converter():
    raw = np.clip(np.round(40000 * np.cos(2 * np.pi * 50 * T)), -32767, 32767).astype(np.int16)
    assert of(raw, limits=(-32767, 32767)).clipped > 0.3


def test_limits_beyond_the_samples_own_type_bound_nothing():
    raw = (40 * np.cos(2 * np.pi * 50 * T)).astype(np.float32)
    assert of(raw, limits=(-1e99, 1e99)).clipped == 0


def test_gaps():
    x = CLEAN.copy()
    x[100:103] = np.nan
    made = of(x)
    assert made.gaps == 3
    assert "3 gaps" in made.fit
    raw = np.round(CLEAN * 100).astype(np.int16)
    raw[7] = -32768
    assert of(raw, gain=0.01, missing=-32768).gaps == 1


def test_jitter_and_holes_of_the_time_stamps():
    stamps = T + np.random.default_rng(0).uniform(-0.05, 0.05, len(T)) / RATE
    made = recording(CLEAN[None], names=["Ua"], extra={"stamps": stamps})
    found = assess_quality(made, 0, made.segments[0])
    assert found.jitter == pytest.approx(0.05, rel=0.1)
    assert found.gaps == 0
    stamps[3000:] += 0.01
    assert assess_quality(made, 0, made.segments[0]).gaps == 1
    assert np.isnan(of(CLEAN).jitter)


@pytest.mark.parametrize(
    ("rate", "says"),
    [
        (100.0, "no waveform"),
        (600.0, "too slow for waves"),
        (4000.0, "fit for phasors and for waves"),
    ],
)
def test_what_a_rate_is_fit_for(rate, says):
    t = np.arange(round(2 * rate)) / rate
    assert says in of(wave(t, np.full((1, len(t)), KV))[0] + noise(len(t), 0.01), rate).fit


def test_an_empty_channel_is_fit_for_nothing():
    assert "no signal" in of(noise(len(T), 1e-3)).fit
    assert "no signal" in of(np.zeros(len(T))).fit
    assert "nothing" not in of(CLEAN).fit
    assert "too short" in of(CLEAN[:5]).fit
    assert "magnitude" in of(np.full(len(T), KV), form="magnitude").fit


def test_channels_of_the_220_kv_station(shared_data):
    made = comtrade.load(shared_data / "dfr220kv-shandong" / "xtz.cfg")
    voltage, current = (assess_quality(made, k, made.segments[0]) for k in (4, 8))
    assert voltage.thd < 0.005
    assert current.bits < 9  # a current transformer of 800 A that carries 75 A
    assert "no waveform" in assess_quality(made, 4, made.segments[1]).fit


class TestCalm:
    """Quality is that of the state before anything happens, however short it is and whatever comes
    after it.
    """

    def faulted(self, start, factor, decay, seed=0):
        after = start <= T
        fault = np.where(after, factor * (1 + 0.5 * np.exp(-(T - start) / decay)), 1.0)
        offset = np.where(after, factor / 2 * np.exp(-(T - start) / decay), 0.0) * np.sqrt(2) * KV
        return of(CLEAN * fault + offset + KV * noise(len(T), 1e-3, seed))

    @pytest.mark.parametrize("start", [0.045, 0.07, 0.1, 0.5])
    @pytest.mark.parametrize(("factor", "decay"), [(0.1, 0.05), (0.4, 1e3)])
    def test_a_voltage_before_a_fault(self, start, factor, decay):
        made = self.faulted(start, factor, decay)
        assert made.level == pytest.approx(KV, rel=2e-3)
        assert made.noise == pytest.approx(1e-3 * KV, rel=0.5)
        assert made.fit == "fit for phasors and for waves"

    @pytest.mark.parametrize("start", [0.045, 0.07, 0.1, 0.5])
    @pytest.mark.parametrize("factor", [5.0, 28.0, 60.0])
    def test_a_load_current_before_a_fault_current(self, start, factor):
        after = start <= T
        fault = np.where(after, factor * (1 + 0.5 * np.exp(-(T - start) / 0.08)), 1.0)
        values = 0.35 / KV * CLEAN * fault + np.where(after, 10 * np.exp(-(T - start) / 0.06), 0.0)
        channel = Channel("Ia", values + 3e-4 * noise(len(T), 1.0, 1), "kA", "current")
        made = assess_quality(
            Recording("made.cfg", [channel], [Segment(0, len(T), RATE, 0.0)]),
            0,
            Segment(0, len(T), RATE, 0),
        )
        assert made.level == pytest.approx(0.35, rel=5e-3)
        assert made.noise == pytest.approx(3e-4, rel=0.5)
        assert made.fit == "fit for phasors and for waves"

    def test_a_load_before_it_is_switched_off(self):
        made = of(np.where(T < 0.2, CLEAN, 0.0) + KV * noise(len(T), 1e-4, 0))
        assert made.level == pytest.approx(KV, rel=1e-3)

    def test_a_line_that_is_dead_at_first_is_judged_where_it_is_alive(self):
        made = of(np.where(T < 0.5, 0.02 * CLEAN, CLEAN) + KV * noise(len(T), 1e-4, 0))
        assert made.level == pytest.approx(KV, rel=1e-3)
