"""Our fifth-order motor in waveforms against motulator's induction machine, which nobody here wrote
(MIT). See --help.

motulator has the Gamma model of machines in SI units; ours is written with the voltage behind X',
per unit. Both see the same unbalanced dip with a jump of its angle. motulator is found in this
interpreter or in the one named by TRACTEXP_MOTULATOR_PYTHON.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tractexp.configuration.plugin import get
from tractexp.model.drive import Drive, WaveformDrive
from tractexp.model.model import compose

# 2.2 kW, 400 V, the machine of motulator's examples; torque [Nm] a little below its rated one.
MACHINE = {
    "n_p": 2,
    "R_s": 3.7,
    "R_r": 2.5,
    "L_ell": 0.023,
    "L_s": 0.245,
    "J": 0.015,
    "torque": 12.0,
}
PEAK, FREQUENCY, RATED = np.sqrt(2 / 3) * 400.0, 50.0, np.sqrt(2) * 5.0  # V, Hz, A


def interpreter() -> str | None:
    """A Python that has motulator, or None."""
    if importlib.util.find_spec("motulator"):
        return sys.executable
    return os.environ.get("TRACTEXP_MOTULATOR_PYTHON")


def theirs(rate: float) -> dict[str, np.ndarray]:
    """t, u and i of the machine in motulator [s, V, A], at `rate` samples per second."""
    python = interpreter()
    if python is None:
        raise SystemExit(
            "motulator is not installed here; name a Python that has it in"
            " TRACTEXP_MOTULATOR_PYTHON"
        )
    with tempfile.TemporaryDirectory() as folder:
        case, target = Path(folder) / "case.json", Path(folder) / "response.npz"
        case.write_text(json.dumps({**MACHINE, "peak": PEAK, "frequency": FREQUENCY, "rate": rate}))
        program = Path(__file__).with_name("motulator_run.py")
        done = subprocess.run([python, program, case, target], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"motulator: {done.stderr[-2000:]}{done.stdout[-2000:]}")
        with np.load(target) as content:
            return dict(content)


def parameters() -> dict[str, float]:
    """Ours of the same machine, per unit of the voltage's peak and the rated current's."""
    omega, power, c = 2 * np.pi * FREQUENCY, 1.5 * PEAK * RATED, MACHINE
    transient = c["L_s"] * c["L_ell"] / (c["L_s"] + c["L_ell"])
    return {
        "T_prime": c["L_ell"] / c["R_r"],
        "X_prime": omega * transient * RATED / PEAK,
        "C": 1 - transient / c["L_s"],
        "M": c["J"] * omega / (c["n_p"] ** 2 * power),
        "T_m": c["torque"] * omega / c["n_p"] / power,
        "R_s": c["R_s"] * RATED / PEAK,
    }


def check(rate: float = 10_000.0, substeps: int = 4) -> dict[str, float]:
    """Largest difference of the currents [pu of the rated peak], and how far they went."""
    found = theirs(rate)
    turn = np.exp(2j * np.pi * FREQUENCY * found["t"])
    v, i, n = found["u"] / PEAK / turn, found["i"] / RATED, len(turn)
    made = WaveformDrive(
        1 / rate,
        v,
        np.zeros(n),
        turn,
        np.zeros((3, n)),
        np.abs(v),
        np.zeros(n),
        1.0,
        1.0,
        0.5,
        omega_s0=0.0,
        omega_n=2 * np.pi * FREQUENCY,
    )
    of = compose(get("model/motor", "stator_flux")(), get("model/static", "none")(), domain="waves")
    known = parameters()
    response = of.simulate(
        Drive.from_events([made]), np.array([known[name] for name in of.names]), substeps
    )
    own = response.outputs[0, 0] + 1j * response.outputs[1, 0]
    return {"difference": float(np.abs(own - i).max()), "largest": float(np.abs(i).max())}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--rate", type=float, default=10_000.0, help="samples per second that ours is given"
    )
    chosen = parser.parse_args()
    print(json.dumps({"parameters": parameters(), **check(chosen.rate)}, indent=2))


if __name__ == "__main__":
    main()
