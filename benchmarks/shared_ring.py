"""What two transformers of a 220 kV station leave alike, near 150 Hz: `python
benchmarks/shared_ring.py` writes benchmarks/shared_ring.json.

Each is fitted in waveforms to one of two dips, held out the other. From 2 to 42 ms of each fault,
of two and a half cycles, lines at multiples of 50 Hz are fitted to the space vectors of the
voltage, of the current as recorded and as calculated, and of what is left; `growth` is that of the
one damped line from 100 to 200 Hz that both transformers' remainders share best. `station` are the
currents [A] of all feeders at 150 Hz and that of their sum, which is the recorder's error.
"""

import json
import os
from pathlib import Path
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
from model_error import SHARED  # noqa: E402

import tractexp  # noqa: E402
from tractexp.filetypes import comtrade  # noqa: E402

RECORD = SHARED / "data" / "dfr220kv-shandong" / "xtz.cfg"
LOADS = {"T1": ([0, 1, 2], [16, 17, 18]), "T2": ([4, 5, 6], [8, 9, 10])}
FEEDERS = {"T1": 16, "T2": 8, "xyx": 12, "fx1x": 28, "fx2x": 20, "xgx": 32}
FIRST, LAST = 0.002, 0.042  # s of a fault
LINES = np.arange(-3, 6) * 50.0  # Hz
FREQUENCIES, DECAYS = np.arange(100.0, 201.0), np.arange(-60.0, 61.0, 4.0)
STORED = Path(__file__).with_suffix(".json")


def find_line(signal: np.ndarray, t: np.ndarray, frequency: float) -> complex:
    """The line of a signal (N,) at a frequency [Hz], beside all lines."""
    basis = np.exp(2j * np.pi * np.outer(t, LINES))
    lines = np.linalg.lstsq(basis, signal, rcond=None)[0]
    return complex(lines[np.flatnonzero(frequency == LINES)[0]])


def find_growth(signals: list[np.ndarray], t: np.ndarray) -> tuple[float, float]:
    """The frequency [Hz] and the growth [1/s] of the line that explains most of all signals."""
    best = (-1.0, 0.0, 0.0)
    for frequency in FREQUENCIES:
        for decay in DECAYS:
            line = np.exp((2j * np.pi * frequency - decay) * t)
            line /= np.linalg.norm(line)
            shares = [abs(np.vdot(line, x)) ** 2 / np.vdot(x, x).real for x in signals]
            best = max(best, (float(np.mean(shares)), float(frequency), float(-decay)))
    return best[1:]


def fit(name: str, order: tuple[int, int]) -> list[tuple[int, str, Any]]:
    """(dip, its role, what is calculated of it) of a transformer."""
    voltages, currents = LOADS[name]
    dips = tractexp.read(RECORD, voltages=voltages, currents=currents)
    found = tractexp.identify(
        [dips[order[0]]],
        validate=[dips[order[1]]],
        domain="waves",
        check_intervals=False,
        progress=False,
    )
    return [(order[k] + 1, one.role, one) for k, one in enumerate(found.details.fits)]


def describe_fault(played: Any) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """Lines at 150 Hz [pu] of one fault, what is left of it, and its times."""
    event = played.waves
    since = event.record.t - event.t_start
    seen = (since >= FIRST) & (since < LAST)
    t = since[seen] - FIRST
    recorded, calculated = (x[0][seen] + 1j * x[1][seen] for x in (event.currents, played.currents))
    voltage = (event.v * event.turn)[seen]
    left = recorded - calculated
    signals = {"voltage": voltage, "recorded": recorded, "calculated": calculated, "left": left}
    lines = {key: round(abs(find_line(x, t, 150.0)), 4) for key, x in signals.items()}
    return lines, left, t


def describe_station(starts: dict[int, float]) -> list[dict[str, Any]]:
    """The line at 150 Hz of each feeder's current in each fault, and of their sum [A]."""
    recording = comtrade.load(RECORD)
    turn = 2 / 3 * np.exp(2j * np.pi / 3 * np.arange(3))
    rows = []
    for dip, start in sorted(starts.items()):
        segment = next(s for s in recording.segments if s.start <= start <= s.t[-1])
        since = segment.t - start
        seen = np.flatnonzero((since >= FIRST) & (since < LAST)) + segment.first
        part, t = slice(seen[0], seen[-1] + 1), since[seen - segment.first] - FIRST
        currents = {
            name: turn
            @ np.array([recording.channels[at + k].values(part.start, part.stop) for k in range(3)])
            for name, at in FEEDERS.items()
        }
        currents["sum"] = np.sum([*currents.values()], axis=0)
        lines = {key: round(1000 * abs(find_line(x, t, 150.0)), 1) for key, x in currents.items()}
        rows.append({"dip": dip, **lines})
    return rows


def main() -> None:
    faults: list[dict[str, Any]] = []
    left: dict[tuple[int, str], list[np.ndarray]] = {}
    starts: dict[int, float] = {}
    t = np.array([])
    for order in ((0, 1), (1, 0)):
        for name in LOADS:
            for dip, role, played in fit(name, order):
                lines, rest, t = describe_fault(played)
                faults.append({"load": name, "dip": dip, "role": role, **lines})
                left.setdefault((dip, role), []).append(rest)
                starts[dip] = played.waves.t_start
    rings = []
    for (dip, role), rest in sorted(left.items()):
        frequency, growth = find_growth(rest, t)
        rings.append({"dip": dip, "role": role, "frequency": frequency, "growth": growth})
    content = {"faults": faults, "rings": rings, "station": describe_station(starts)}
    STORED.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(content, indent=1))


if __name__ == "__main__":
    main()
