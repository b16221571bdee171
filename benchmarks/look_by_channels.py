"""CPU seconds of a look by the number of channels: `python benchmarks/look_by_channels.py
[samples]`.

Stations of feeders on one bus, three voltages and three currents each, sampled at 4 kHz, with one
dip. Reading the file is in it, starting Python and loading libraries are not. The slope is that of
the logarithms between neighbors.
"""

import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

import tractexp
from tractexp.filetypes.comtrade_writer import write
from tractexp.recording.recording import Channel, Recording, Segment

RATE, F = 4000.0, 50.0
CHANNELS = (100, 200, 400, 800)


def station(channels: int, samples: int) -> Recording:
    """So many channels: voltages and currents of feeders, in turn, with noise of their own."""
    t = np.arange(samples) / RATE
    middle = t[-1] / 2
    depth = np.where((t >= middle) & (t < middle + 0.2), 0.7, 1.0)
    generator = np.random.default_rng(7)
    made = []
    for k in range(channels):
        feeder, phase = k // 6, k % 3
        voltage = k % 6 < 3
        size = 63.5 if voltage else 0.1 + 0.01 * feeder
        angle = -2 * np.pi / 3 * phase - (0 if voltage else 0.4)
        wave = np.sqrt(2) * size * depth * np.cos(2 * np.pi * F * t + angle)
        wave += 1e-3 * size * generator.standard_normal(samples)
        gain = 2.5 * size / 30000
        letter, unit, quantity = ("U", "kV", "voltage") if voltage else ("I", "kA", "current")
        name = f"F{feeder} {letter}{'ABC'[phase]}"
        made.append(
            Channel(name, np.round(wave / gain).astype(np.int16), unit, quantity, gain=gain)
        )
    return Recording("station", made, [Segment(0, samples, RATE, 0.0)])


def measure(samples: int) -> list[tuple[int, float]]:
    """(channels, CPU seconds of a look) by the number of channels."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for channels in (6, *CHANNELS):  # the first loads what is loaded once
            path = Path(folder, f"station{channels}.cfg")
            write(station(channels, samples), path, "BINARY", 1999)
            begun = time.process_time()
            tractexp.look(str(path), progress=False)
            rows.append((channels, time.process_time() - begun))
    return rows[1:]


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 8000
    rows = measure(samples)
    slopes = [np.log(b[1] / a[1]) / np.log(b[0] / a[0]) for a, b in pairwise(rows)]
    print(f"{samples} samples at {RATE:g} Hz\nchannels  CPU [s]  slope")
    for (channels, seconds), slope in zip(rows, [None, *slopes], strict=True):
        print(f"{channels:8d}  {seconds:7.2f}  {'' if slope is None else f'{slope:5.2f}'}")


if __name__ == "__main__":
    main()
