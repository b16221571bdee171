"""What becomes of real recordings: `python benchmarks/field_records.py FOLDER`.

Fetches nothing. Every file of the folder that a reader takes is opened; the loads that are proposed are measured, and
their U, P and Q in the steadiest stretch compared with a least-squares fit of frequency, fundamental, offset and
harmonics to samples that another reader took from the file (the package `comtrade`, where it can). What is refused is
listed with its sentence; a traceback is a failure. Prints a table; `--json FILE` stores it.
"""

import argparse
import json
import time
import traceback
from pathlib import Path

import tractexp  # before NumPy: it keeps BLAS to one thread

tractexp.__version__  # noqa: B018

import numpy as np  # noqa: E402
from scipy.optimize import minimize_scalar  # noqa: E402

from tractexp.api.read import reader_of  # noqa: E402
from tractexp.errors import UserError  # noqa: E402
from tractexp.plugin import build  # noqa: E402
from tractexp.recording.arrangement import arranged  # noqa: E402
from tractexp.recording.feeder import propose  # noqa: E402
from tractexp.recording.measure import phasors_of  # noqa: E402

CYCLES = 6  # of the steady stretch that is compared
STEADY = 1e-3  # of U: what changes more within it is not compared
TURN = np.exp(2j * np.pi / 3)


def columns(f, t, harmonics):
    """Offset, cosines and sines of a fundamental and its harmonics, (N, 2 H + 1)."""
    made = [np.ones_like(t)]
    for h in range(1, harmonics + 1):
        made += [np.cos(2 * np.pi * h * f * t), np.sin(2 * np.pi * h * f * t)]
    return np.stack(made, axis=1)


def fitted(waves, rate, nominal):
    """Frequency [Hz] and RMS phasors (K,) of waveforms (K, N) by least squares over frequency and harmonics."""
    t = (np.arange(waves.shape[-1]) - waves.shape[-1] / 2) / rate
    harmonics = max(1, min(9, int(0.4 * rate / nominal)))

    def rest(f):
        A = columns(f, t, harmonics)
        return float(np.sum((waves[:3].T - A @ np.linalg.lstsq(A, waves[:3].T, rcond=None)[0]) ** 2))

    f = minimize_scalar(rest, bounds=(0.95 * nominal, 1.05 * nominal), method="bounded", options={"xatol": 1e-7}).x
    x = np.linalg.lstsq(columns(f, t, harmonics), waves.T, rcond=None)[0]
    return f, (x[1] - 1j * x[2]) / np.sqrt(2)


def elsewhere(path, recording):
    """The analog samples (K, N) in the file's own units times our ratio, as the package `comtrade` reads them."""
    import comtrade

    file = comtrade.Comtrade(ignore_warnings=True, use_numpy_arrays=True, use_double_precision=True)
    if path.suffix.lower() == ".cff":
        file.load(str(path))
    else:
        dat = next(p for p in path.parent.iterdir() if p.stem == path.stem and p.suffix.lower() == ".dat")
        file.load(str(path), str(dat), encoding="latin-1")
    return [np.asarray(v) * c.ratio * c.factor for v, c in zip(file.analog, recording.channels, strict=True)]


def steady(phasors, nominal):
    """The middle [s] of the steadiest stretch of some cycles while alive; None where U or S changes within it."""
    span = max(3, round(CYCLES / nominal / (phasors.t[1] - phasors.t[0])))
    if span >= len(phasors.t) or phasors.U.max() == 0:
        return None
    look = np.lib.stride_tricks.sliding_window_view
    U, S = look(phasors.U, span), look(np.abs(phasors.S), span)
    spread = np.ptp(U, axis=1) / U.mean(axis=1) + 1e9 * (U.min(axis=1) < 0.5 * phasors.U.max())
    k = int(np.argmin(spread))
    if spread[k] > STEADY or np.ptp(S[k]) > 10 * STEADY * S[k].mean():
        return None
    return float(phasors.t[k : k + span].mean())


def compared(path, recording, feeder):
    """Differences of U (over U) and S (over |S|) from the independent fit, and U, P, Q."""
    segment = max(recording.waveforms(), key=lambda s: s.stop - s.first)
    phasors = phasors_of(recording, feeder, segment)
    middle = steady(phasors, recording.frequency)
    if middle is None:
        k = int(np.argmax(phasors.U))
        made = {"U": float(phasors.U[k]), "P": float(phasors.S[k].real), "Q": float(phasors.S[k].imag)}
        return {"feeder": feeder.name, **made, "independent": "never steady: not compared"}
    half = CYCLES / recording.frequency / 2
    k = int(np.argmin(np.abs(phasors.t - middle)))
    here = np.abs(phasors.t - middle) <= 1 / recording.frequency / 2
    made = {"feeder": feeder.name, "connection": feeder.connection, "U": float(phasors.U[k]),
            "P": float(phasors.S[k].real), "Q": float(phasors.S[k].imag)}  # fmt: skip
    try:
        other = elsewhere(path, recording)
    except Exception as error:
        return made | {"independent": f"not read by the package comtrade: {type(error).__name__}"}
    window = slice(
        *(round((at - segment.start) * segment.rate) + segment.first for at in (middle - half, middle + half))
    )
    V = build("connection", {"name": feeder.connection}).voltage() @ np.array(
        [other[i][window] for i in feeder.voltages]
    )
    C = build("connection", {"name": feeder.connection}).current() @ np.array(
        [other[i][window] for i in feeder.currents]
    )
    f, X = fitted(np.concatenate([V, -C if feeder.reverse_current else C]), segment.rate, recording.frequency)
    K = len(X) // 2
    turns = TURN ** np.arange(K)
    V1, I1 = (X[:K] * turns).mean(), (X[K:] * turns).mean()
    S = K * V1 * I1.conj()
    U = float(phasors.U[here].mean())
    return made | {
        "f": float(f),
        "error_U": abs(U / (np.sqrt(K) * abs(V1)) - 1),
        "error_S": float(abs(phasors.S[here].mean() - S) / abs(S)),
    }


def tried(path):
    """What becomes of one file."""
    start = time.perf_counter()
    row = {"file": path.name, "told": "", "feeders": []}
    try:
        cls = reader_of(str(path))
        reader = build("data", {"name": cls.name, **cls.of(str(path))})
        recording = reader.opened()
        row |= {"channels": len(recording.channels), "samples": recording.samples, "notes": list(recording.notes)}
        for feeder in (each for each in propose(recording) if each.loaded):
            try:
                row["feeders"].append(compared(path, recording, arranged(recording, feeder)))
            except UserError as error:
                row["feeders"].append({"feeder": feeder.name, "told": str(error)})
    except UserError as error:
        row["told"] = str(error)
    except Exception:
        row["failed"] = traceback.format_exc()
    return row | {"seconds": time.perf_counter() - start}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    endings = {".cfg", ".cff", ".cev"}
    rows = [tried(path) for path in sorted(given.folder.rglob("*")) if path.suffix.lower() in endings]
    for row in rows:
        print(f"{row['file']}: {row.get('failed') or row['told'] or str(len(row['feeders'])) + ' feeders'}")
        for one in row["feeders"]:
            numbers = ", ".join(f"{k} {v:.5g}" for k, v in one.items() if isinstance(v, float))
            print(f"    {one['feeder']}: {one.get('told') or numbers} {one.get('independent', '')}")
    errors = [one for row in rows for one in row["feeders"] if "error_U" in one]
    failed = sum("failed" in row for row in rows)
    refused = sum(bool(row["told"]) for row in rows)
    print(f"{len(rows)} files, {refused} refused, {failed} failed; {len(errors)} loads compared")
    if errors:
        worst = {key: max(one[key] for one in errors) for key in ("error_U", "error_S")}
        print(f"largest difference: U {worst['error_U']:.3%}, P + jQ {worst['error_S']:.3%} of |S|")
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1, default=float) + "\n")


if __name__ == "__main__":
    main()
