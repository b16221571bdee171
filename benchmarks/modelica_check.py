"""Exported Modelica against a Modelica compiler that nobody here wrote: python
benchmarks/modelica_check.py [--python PATH]

Each file is flattened, made causal and integrated by `modelica` (MIT, `pip install
'modelica[sim]'`, Python 3.12 or later; `--python` names one that has it), along the dip that every
export is played along, and compared with our own simulation of the load.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import marked
import numpy as np
from andes_check import EXPORTS, FREQUENCY, STATICS, result

from tractexp.configuration.plugin import build
from tractexp.exchange.format import Identified, Simulated
from tractexp.exchange.playback import DEPTH, EDGE, FALL, LENGTH, RISE, STEP, dip, play_load

ROWS = Path(__file__).with_suffix(".json")
PAGE = Path(__file__).resolve().parents[1] / "docs" / "export.md"
LOADS = (
    ("electromechanical", "exponential"),
    ("electromechanical", "exponential", "stator_resistance"),
    ("electromechanical", "exponential", "speed_dependent_torque"),
    ("electromechanical", "zip"),
)
PLAYED = """model Played
  TractionLoad load;
  Real fallen, back;
equation
  fallen = if time < {fall} then 0.0
    else if time < {fallen} then 0.5 - 0.5*cos(3.141592653589793*(time - {fall})/{edge}) else 1.0;
  back = if time < {rise} then 0.0
    else if time < {risen} then 0.5 - 0.5*cos(3.141592653589793*(time - {rise})/{edge}) else 1.0;
  load.U = {U0}*(1.0 - {depth}*(fallen - back));
  load.omega_s = 0.0;
end Played;
"""


def compare(python: str, load: Identified) -> dict[str, float]:
    """Largest difference of P and Q [pu], and how far they move."""
    before, U = load.result.before, load.result.before["U0"] * dip()
    times = (np.arange(round(LENGTH / STEP) + 1) * STEP).tolist()
    edges = {"fall": FALL, "fallen": FALL + EDGE, "rise": RISE, "risen": RISE + EDGE, "edge": EDGE}
    played = PLAYED.format(**edges, depth=DEPTH, U0=before["U0"])
    texts = [build("format", {"name": "modelica"}).text(load), played]
    done = subprocess.run(
        [python, Path(__file__).with_name("modelica_run.py")],
        input=json.dumps({"texts": texts, "times": times}),
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise SystemExit(done.stderr.strip().splitlines()[-1])
    theirs = json.loads(done.stdout)
    along = Simulated("modelica", STEP, U, np.zeros_like(U), U, U)
    ours = play_load(load, along, before["P0"], before["Q0"])
    row = {}
    for power, own in zip("PQ", ours, strict=True):
        row |= {
            power: float(np.abs(own - theirs[power]).max()),
            f"moves_{power}": float(np.ptp(own)),
        }
    return row


def text() -> str:
    """The sentence of the page."""
    rows = json.loads(ROWS.read_text(encoding="utf-8"))
    P, Q = (max(row[power] for row in rows) for power in "PQ")
    return f"The worst of {len(rows)} loads differs by {P:.1e} pu in P and {Q:.1e} pu in Q."


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--python", default=sys.executable, help="one that has modelica[sim]")
    options = parser.parse_args()
    rows = []
    for motor, static, *effects in LOADS:
        sizes = [
            (p.name, p.default + effect.relevant.get(p.name, 0.0))
            for effect in (build("effect", {"name": name}) for name in effects)
            for p in effect.parameters
        ]
        parameters = EXPORTS[motor] | STATICS[static] | dict(sizes)
        parts = {"motor": {"name": motor}, "static": {"name": static}, "effects": effects}
        before = {"U0": 0.98, "P0": 1.0, "Q0": 0.6, "frequency": FREQUENCY}
        row = compare(options.python, Identified(result(parameters, parts, before)))
        rows.append({"load": " ".join([motor, static, *effects]), **row})
        print(json.dumps(rows[-1]), flush=True)
    ROWS.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(marked.replace(PAGE, "benchmarks/modelica_check.py", text()))


if __name__ == "__main__":
    main()
