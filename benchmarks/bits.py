"""Whether a result is the same to the last bit wherever it is made: python benchmarks/bits.py
[--json bits.json]

The same searches in fresh processes: again, from another folder, under other values of
PYTHONHASHSEED, with the kernel derived and compiled anew, on one and on two workers; and with
kernels compiled for the most general processor of this kind instead of the one that is here, which
has no fused multiply-add and narrower vectors. Told are the largest difference of a parameter, of
the width of its bounds, and of the objective, relative; and, of P and Q that 200 drawn candidates
draw in the dip, the largest difference [pu]. The file says on which processor the rows hold.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from processor import processor

from tractexp.storage import files

SEARCHES = {
    "issa": ["optimizer=issa", "budget=5000"],
    "least squares": [
        "optimizer=multistart_least_squares",
        "model.effects=[stator_resistance]",
        "data=tibet_30pct",
    ],
}
SIMULATED = """if True:
    import sys
    import numpy as np
    from tractexp.model.drive import Drive, Excitation
    from tractexp.model.model import compose
    from tractexp.configuration.plugin import get
    made = []
    for motor in ("electromechanical", "double_cage"):
        model = compose(get("model/motor", motor)(), get("model/static", "exponential")())
        rng = np.random.default_rng(1)
        values = np.array([p.default for p in model.parameters]) * \
rng.uniform(0.9, 1.1, (200, len(model.names)))
        U = 1 - 0.5 * (np.arange(500) // 100 == 1)
        drive = Drive.from_events([Excitation(1e-3, U, np.ones(500), np.ones(500), 1.0, 1.0, 0.6)])
        response = model.simulate(drive, values, 2)
        made.append(np.stack([response.P, response.Q])[:, response.miss[0] == 0])
    np.savez(sys.argv[1], *made)
"""
GENERIC = {"TRACTEXP_CPU": "generic"}


def identified(folder: Path, arguments: list[str], **environment: str) -> list[dict]:
    """What the searches of a command found, in order of their folders."""
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "tractexp", *arguments, "tracking.enabled=false"]
    subprocess.run(
        command, cwd=folder, env=os.environ | environment, check=True, capture_output=True
    )
    return [json.loads(path.read_text()) for path in sorted(folder.rglob("result.json"))]


def apart(one: dict, other: dict) -> dict[str, float]:
    """The largest difference of a parameter, of its bounds' width, and that of the objective,
    relative.
    """
    widths = {name: bounds[1] - bounds[0] for name, bounds in one["bounds"].items()}
    moved = max(
        abs(value - other["parameters"][name]) / widths.get(name, 1.0)
        for name, value in one["parameters"].items()
    )
    return {
        "parameters": moved,
        "objective": abs(one["objective"] - other["objective"]) / one["objective"],
    }


def drawn(folder: Path, **environment: str):
    """P and Q (2, n, N) of drawn candidates, of each model."""
    import numpy as np

    path = folder / f"simulated_{len(list(folder.iterdir()))}.npz"
    subprocess.run(
        [sys.executable, "-c", SIMULATED, str(path)], env=os.environ | environment, check=True
    )
    with np.load(path) as held:
        return [held[name] for name in held.files]


def measured() -> dict:
    import numpy as np

    rows: dict = {"processor": processor()}
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base)
        for name, arguments in SEARCHES.items():
            (first,) = identified(folder / name / "first", arguments)
            anew = {"TRACTEXP_CACHE_DIR": str(folder / "cache"), "PYTHONHASHSEED": "3"}
            others = {
                "again": {},
                "PYTHONHASHSEED=1": {"PYTHONHASHSEED": "1"},
                "PYTHONHASHSEED=2": {"PYTHONHASHSEED": "2"},
                "derived and compiled anew": anew,
                "generic processor": GENERIC,
            }
            rows[name] = {}
            for other, environment in others.items():
                (found,) = identified(
                    folder / name / "else where" / other, arguments, **environment
                )
                rows[name][other] = apart(first, found)
        swept = ["-m", "optimizer=pso,issa", "seed=0,1", "budget=1000", "hydra.sweep.dir=sweep"]
        one, two = (
            identified(folder / f"workers {n}", [*swept, f"hydra.launcher.n_jobs={n}"])
            for n in (1, 2)
        )
        rows["a sweep on one and two workers"] = [
            apart(a, b) for a, b in zip(one, two, strict=True)
        ]
        models = zip(drawn(folder), drawn(folder, **GENERIC), strict=True)
        rows["P and Q on a generic processor [pu]"] = [
            float(np.abs(a - b).max()) for a, b in models
        ]
    return rows


def main() -> None:
    asked = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    asked.add_argument("--json", type=Path, default=Path(__file__).with_suffix(".json"))
    found = measured()
    files.write_json(asked.parse_args().json, found)
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
