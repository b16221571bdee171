"""Processor seconds of an investigation by how it ends: python benchmarks/investigation_ends.py
[--only KIND ...]

Three dips of 1,000 samples and a fourth held out, by the generator of `tests/oracle`: of a load
that hides nothing, of one with a stator resistance, and of one with a step of its power, which no
effect of the catalogue is. On one core; each kind is run with one seed first, which compiles, and
timed with the next; nothing is kept from one run to another.
"""

import argparse
import os
import tempfile
import time

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import oracle  # noqa: E402, F401

from hidden_effects.cases import Case  # noqa: E402
from hidden_effects.generator import make  # noqa: E402
from hidden_effects.noise import Noise  # noqa: E402

KINDS = {
    "none": Case(events=4, noise=Noise(0.005)),
    "named": Case("stator_resistance", events=4, noise=Noise(0.005)),
    "unexplained": Case("load_step", 2.0, events=4, noise=Noise(0.005)),
}
COMPILING, TIMED = 11, 12  # seeds


def investigate(kind: str, seed: int) -> str:
    """The processor seconds of one investigation, and what it comes to."""
    import tractexp

    records = make(KINDS[kind], seed)
    dips = [tractexp.read(**one, name=f"dip{k}")[0] for k, one in enumerate(records, start=1)]
    began = time.process_time()
    found = tractexp.investigate(dips[:3], validate=dips[3:], progress=False)
    spent = time.process_time() - began
    return f"{spent:.1f} s, {found.content['simulations']} simulations, {found.verdict}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="*", choices=KINDS, default=[*KINDS])
    chosen = parser.parse_args()
    os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])  # what is forked is not counted
    with tempfile.TemporaryDirectory() as cache:  # in which nothing is fitted yet
        os.environ["TRACTEXP_CACHE_DIR"] = cache
        for kind in chosen.only:
            investigate(kind, COMPILING)
            print(f"{kind}: {investigate(kind, TIMED)}", flush=True)


if __name__ == "__main__":
    main()
