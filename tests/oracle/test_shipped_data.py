"""The shipped stand-ins: what the script makes, honest about what they are, and usable."""

import json
from pathlib import Path

import make_tibet
import numpy as np
import pytest

from independent.source import OMEGA

DATA = Path(__file__).parents[2] / "tractexp" / "data"
NAMES = ("tibet_50pct", "tibet_30pct", "tibet_65pct")
# Bounds the motor and static plugins search in: a truth near one of them would be a bad example.
BOUNDS = {
    "T_prime": (0.005, 0.5),
    "X_prime": (0.05, 1.5),
    "C": (0.3, 0.99),
    "M": (0.0005, 0.03),
    "T_m": (0.05, 1.0),
    "p_v": (0.0, 4.0),
    "q_v": (0.0, 8.0),
}


def read(name: str) -> dict[str, np.ndarray]:
    lines = (DATA / f"{name}.csv").read_text(encoding="ascii").splitlines()
    values = np.array([line.split(",") for line in lines[1:]], dtype=float)
    return dict(zip(lines[0].split(","), values.T, strict=True))


def sidecar(name: str) -> dict:
    return json.loads((DATA / f"{name}.json").read_text(encoding="ascii"))


def test_the_script_makes_the_shipped_files_bit_for_bit(tmp_path):
    made = make_tibet.make(tmp_path)
    assert sorted(path.name for path in made) == sorted(
        f"{name}{end}" for name in NAMES for end in (".csv", ".json")
    )
    for path in made:
        assert path.read_bytes() == (DATA / path.name).read_bytes(), path.name


@pytest.mark.parametrize("name", NAMES)
def test_a_record_is_complete_uniform_and_small(name):
    columns = read(name)
    assert list(columns) == ["t", "U", "P", "Q"]
    assert all(len(values) == 1000 and np.isfinite(values).all() for values in columns.values())
    np.testing.assert_allclose(np.diff(columns["t"]), 0.002, atol=1e-9)
    assert (DATA / f"{name}.csv").stat().st_size < 100_000


@pytest.mark.parametrize(
    ("name", "depth"), [("tibet_50pct", 0.50), ("tibet_30pct", 0.30), ("tibet_65pct", 0.65)]
)
def test_a_record_dips_as_its_name_says_and_the_motor_comes_back(name, depth):
    columns = read(name)
    before, bottom, end = columns["t"] < 0.28, columns["U"].argmin(), columns["t"] > 1.9
    assert columns["U"][before].mean() - columns["U"][bottom] == pytest.approx(depth, abs=0.01)
    for channel in ("U", "P", "Q"):
        noise = columns[channel][before].std()
        assert 1e-4 < noise < 5e-3
        assert columns[channel][end].mean() == pytest.approx(
            columns[channel][before].mean(), abs=3 * noise
        )


@pytest.mark.parametrize("name", NAMES)
def test_a_sidecar_says_what_the_record_is_and_who_made_it(name):
    about = sidecar(name)
    assert about["name"] == name
    assert about["note"].startswith("synthetic stand-in for an unpublished record")
    assert (Path(__file__).parents[2] / about["made_by"]).is_file()


@pytest.mark.parametrize("name", NAMES)
def test_the_truth_follows_from_the_machine_by_the_paper_s_definitions(name):
    about = sidecar(name)
    m, truth = about["machine"], about["truth"]
    X, X_r = m["Xm"] + m["Xs"], m["Xm"] + m["Xr"]
    X_prime = m["Xs"] + m["Xm"] * m["Xr"] / X_r
    expected = {
        "T_prime": X_prime / X * X_r / (OMEGA * m["Rr"]),
        "X_prime": X_prime / m["rating"],
        "C": (X - X_prime) / X,
        "M": 2 * m["H"] * m["rating"] / OMEGA,
        "T_m": m["torque"] * m["rating"],
        "H": truth["M"] * OMEGA / 2,
    }
    for key, value in expected.items():
        assert truth[key] == pytest.approx(value, rel=1e-8), key
    for key, (low, high) in BOUNDS.items():
        assert low + 0.05 * (high - low) < truth[key] < high - 0.05 * (high - low), key


@pytest.mark.parametrize("name", NAMES)
def test_the_record_starts_from_the_steady_state_of_the_truth(name):
    """Eqs. (2) and (3) with the truth, and the static rest, against the mean of the samples before
    the dip.
    """
    truth, start, columns = sidecar(name)["truth"], sidecar(name)["steady_state"], read(name)
    delta = 0.5 * np.arcsin(-2 * truth["T_m"] * truth["X_prime"] / truth["C"])
    E = truth["C"] * np.cos(delta)
    assert start["P_d0"] == pytest.approx(-E * np.sin(delta) / truth["X_prime"], rel=1e-7)
    assert start["Q_d0"] == pytest.approx((1 - E * np.cos(delta)) / truth["X_prime"], rel=1e-7)
    before = columns["t"] < 0.28
    # 140 samples, ten to a window: some 14 independent ones, so the mean wanders by a quarter of
    # the noise.
    for channel, value in {
        "P": start["P_d0"] + start["P_s0"],
        "Q": start["Q_d0"] + start["Q_s0"],
        "U": 1.0,
    }.items():
        wander = columns[channel][before].std() / np.sqrt(14)
        assert columns[channel][before].mean() == pytest.approx(value, abs=4 * wander), channel
