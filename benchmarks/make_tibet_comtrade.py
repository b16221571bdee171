"""Make the shipped COMTRADE records of the `tibet_*` dips: python benchmarks/make_tibet_comtrade.py
[--out DIR]

The same load and dips as `make_tibet`, as a fault recorder of a traction substation would have
them. What is fed is the load of the other records, a three-phase machine and a static load, for
only its truth is known: the substation's three-phase auxiliary supply. It hangs on a V/v
transformer, two single-phase transformers between two pairs of phases of the grid, whose 27.5 kV
secondaries lie in open delta: their two voltages are the line voltages ab and bc of a three-wire
system, their two currents those of phases a and c, and the third line voltage and current follow
from them. The recorder sees these four channels and no others, so the way to U, P and Q is that of
two voltage transformers in V and two current transformers (Aron). The transformer is ideal and the
grid stiff, as for the other records: the dip is that of the two windings. A train would be a
single-phase load on one of them; it is no machine of known truth.
"""

from datetime import datetime
from pathlib import Path

import numpy as np
import oracle  # noqa: F401
from make_tibet import DIPS, LOAD, main

from independent import Waveforms, simulate
from independent.recorder import PHASES
from tractexp.filetypes.comtrade import write
from tractexp.recording import Channel, Recording, Segment, StatusChannel

RATE = 4000.0  # Hz
LENGTH = 2.04  # s, of the records 2 s and a window
VOLTAGE, POWER = 27.5, 10.0  # kV, line to line, and MVA: one per unit of the load
CURRENT = POWER / VOLTAGE / np.sqrt(3)  # kA
# pu of a phase, each sample: as much in a phasor as in the CSV records
VOLTAGE_NOISE, CURRENT_NOISE = 0.006, 0.012
STEPS = 2**13  # of a converter of 14 bits on either side of zero
RANGES = {"kV": 2 * np.sqrt(2) * VOLTAGE, "kA": 8 * np.sqrt(2) * CURRENT}  # its span
TRANSFORMERS = {"kV": 275.0, "kA": 200.0}  # primary over secondary


def channels(waves: Waveforms, rng: np.random.Generator) -> list[Channel]:
    """u_ab, u_bc, i_a, i_c as the recorder's converter has them: noisy and quantised, in secondary
    units.
    """
    voltage, current = (
        (vector * PHASES[:, None]).real for vector in (waves.voltage, waves.current)
    )
    voltage = voltage + VOLTAGE_NOISE * rng.standard_normal(voltage.shape)
    current = current + CURRENT_NOISE * rng.standard_normal(current.shape)
    u, i = np.sqrt(2 / 3) * VOLTAGE * voltage, np.sqrt(2) * CURRENT * current
    made = []
    for name, phase, unit, values in (
        ("UAB", "AB", "kV", u[0] - u[1]),
        ("UBC", "BC", "kV", u[1] - u[2]),
        ("IA", "A", "kA", i[0]),
        ("IC", "C", "kA", i[2]),
    ):
        least = RANGES[unit] / STEPS
        raw = np.clip(np.round(values / least), -STEPS, STEPS - 1).astype(np.int16)
        quantity, ratio = ("voltage" if unit == "kV" else "current"), TRANSFORMERS[unit]
        gain = float(f"{1000 * least / ratio:.9g}")  # V and A
        made.append(
            Channel(
                name,
                raw,
                unit[1:],
                quantity,
                phase,
                "V/v 27.5 kV",
                gain,
                ratio=ratio,
                limits=(-STEPS, STEPS - 1),
            )
        )
    return made


def recording(seed: int, name: str) -> Recording:
    """One dip as the recorder has it."""
    dip = DIPS[name][1]
    t = np.arange(round(LENGTH * RATE)) / RATE - 0.02
    made = channels(simulate(LOAD, dip, t), np.random.default_rng(seed))
    trip = StatusChannel("dip", (dip.shape(t) > 0.1).astype(np.int8))
    return Recording(
        name,
        made,
        [Segment(0, len(t), RATE, 0.0)],
        50.0,
        "synthetic stand-in; not measured",
        "benchmarks/make_tibet_comtrade.py",
        datetime(2024, 1, 1),
        dip.start + 0.02,
        [trip],
    )


def make(folder: Path) -> list[Path]:
    """Write the .cfg and .dat of each dip into `folder`, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, (seed, _) in DIPS.items():
        written += write(recording(seed, name), folder / f"{name}.cfg", "BINARY", 1999)
    return written


if __name__ == "__main__":
    main(make, __doc__)
