"""What a column costs that a test asks for, by a kernel with everything and by those in use: python
columns.py

A column is what one effect, or one push, changes beside a fit. Printed are microseconds of each
simulation of three dips of 1,000 samples, the best of three runs, and instructions of each kernel's
text.
"""

import os
import time

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from tractexp.configuration.plugin import get  # noqa: E402
from tractexp.inference.catalogue import Catalogue, build_catalogue  # noqa: E402
from tractexp.inference.injection import PUSHES  # noqa: E402
from tractexp.inference.kernels import Family  # noqa: E402
from tractexp.model.drive import Drive, Excitation  # noqa: E402
from tractexp.model.model import Model, compose  # noqa: E402
from tractexp.record import Record, detect  # noqa: E402

SAMPLES, STEP, SUBSTEPS, LANES, RUNS = 1000, 2e-3, 2, 224, 3
DEPTHS = (0.3, 0.5, 0.6)


def base() -> Model:
    """The model that effects are tested beside."""
    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


def drive_of(depths: tuple[float, ...]) -> Drive:
    """Dips of a quarter of a second."""
    t, flat = np.arange(SAMPLES) * STEP, np.ones(SAMPLES)
    shape = np.clip((t - 0.4) / 0.02, 0, 1) - np.clip((t - 0.65) / 0.02, 0, 1)
    return Drive.from_events(
        [Excitation(STEP, 1 - d * shape, flat, 0.6 * flat, 1.0, 1.0, 0.6) for d in depths]
    )


def tested() -> Catalogue:
    """What an investigation of such dips tests."""
    load, drive = base(), drive_of((0.5,))
    P, Q = load.simulate(drive, np.array([p.default for p in load.parameters]), 8).outputs[:, 0]
    record = Record(
        "dip", t=np.arange(SAMPLES) * STEP, U=drive.inputs[0], P=P, Q=Q, source="made"
    ).check()
    return build_catalogue(load, [detect(record)])


def cost(model: Model, drive: Drive) -> float:
    """Seconds of one simulation of many side by side, every effect at its null."""
    null = np.array([p.default if p.null is None else p.null for p in model.parameters])
    seconds = []
    for _ in range(1 + RUNS):  # the first compiles
        started = time.perf_counter()
        model.simulate(drive, np.tile(null, (LANES, 1)), SUBSTEPS)
        seconds.append(time.perf_counter() - started)
    return min(seconds[1:]) / LANES


def main() -> None:
    family, drive = Family(base(), tested()), drive_of(DEPTHS)
    kernels = {"the base model": family.model, "everything": family.whole}
    for name in (*family.catalogue.of_load, PUSHES):
        _, beside = family.key((), name)
        kernels.setdefault(
            "effects that are cheap" if len(beside) > 1 else name,
            family.build_model(family.key((), name)),
        )
    whole = cost(family.whole, drive)
    for name, model in kernels.items():
        each = cost(model, drive)
        print(
            f"{name:24s} {1e6 * each:7.0f} us  {whole / each:5.1f} times less "
            f" {model.source.count(chr(10)):6d} lines"
        )


if __name__ == "__main__":
    main()
