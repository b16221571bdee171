"""What opening a long record costs: `python benchmarks/reading.py [--minutes 10]`.

Three voltages and three currents at 4 kHz are written as COMTRADE in every type of data, and opened in a process of
their own each: CPU seconds and the greatest memory that opening adds, then those of U, P and Q by one-cycle phasors on
top. Opening leaves the samples where they are; what is used of them is converted when it is used.
"""

import argparse
import json
import multiprocessing
import tempfile
import time
from pathlib import Path

import tractexp  # before NumPy: it keeps BLAS to one thread

tractexp.__version__  # noqa: B018

import numpy as np  # noqa: E402
from memory import peak, reset  # noqa: E402

from tractexp import files  # noqa: E402
from tractexp.recording import Channel, Feeder, Recording, Segment, StatusChannel, comtrade  # noqa: E402
from tractexp.recording.measure import phasors_of  # noqa: E402

RATE = 4000


def record(minutes):
    """Six channels of 16-bit samples, two of status."""
    t = np.arange(int(60 * minutes * RATE)) / RATE
    channels = []
    for k in range(6):
        wave = 20000 * np.cos(2 * np.pi * 50 * t - 2 * np.pi / 3 * (k % 3) - 0.4 * (k > 2))
        name, unit, quantity = ("U", "kV", "voltage") if k < 3 else ("I", "A", "current")
        phase = "abc"[k % 3]
        channels.append(Channel(name + phase, np.round(wave).astype(np.int16), unit, quantity, phase, "Bus", 0.01))
    states = [StatusChannel(name, np.zeros(len(t), np.uint8)) for name in ("trip", "close")]
    return Recording("made", channels, [Segment(0, len(t), float(RATE), 0.0)], 50.0, status=states)


def _spent(work):
    """CPU seconds and added peak memory [MB] of a call."""
    before, start = reset(), time.process_time()
    made = work()
    return made, time.process_time() - start, peak() - before


def opened(path, short, pipe):
    """Open a record and measure its phasors, after a second of one has been, so that compilation is not counted."""
    feeder = Feeder((0, 1, 2), (3, 4, 5), "three_phase")
    warm = comtrade.load(short)
    phasors_of(warm, feeder, warm.segments[0])
    recording, seconds, megabytes = _spent(lambda: comtrade.load(path))
    _, more, larger = _spent(lambda: phasors_of(recording, feeder, recording.segments[0]))
    pipe.send({"open_s": seconds, "open_MB": megabytes, "phasors_s": more, "phasors_MB": larger})


def main():
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--minutes", type=float, default=10)
    asked.add_argument("--json", type=Path, default=Path(__file__).with_suffix(".json"))
    told = asked.parse_args()
    context = multiprocessing.get_context("spawn")
    found = {"minutes": told.minutes, "channels": 6, "rate": RATE}
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("BINARY", "FLOAT32", "ASCII"):
            short = comtrade.write(record(1 / 60), Path(folder) / "short.cfg", kind)[0]
            paths = comtrade.write(record(told.minutes), Path(folder) / f"{kind.lower()}.cfg", kind)
            mine, other = context.Pipe()
            process = context.Process(target=opened, args=(paths[0], short, other))
            process.start()
            found[kind] = mine.recv() | {"file_MB": sum(path.stat().st_size for path in paths) / 2**20}
            process.join()
            print(kind, {key: round(value, 3) for key, value in found[kind].items()}, flush=True)
            for path in paths:
                path.unlink()
    files.write_json(told.json, found)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
