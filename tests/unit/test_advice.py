"""What a refusal advises helps, or is a final no: every advice is followed until the file is read
or none is left.

Settings of a sentence ("data.currents=[3, 5, 4]", "data.columns={P: 'F1 P', Q: 'F1 Q'}") are taken
as they stand.
"""

import re

import numpy as np
import pytest
import yaml

import tractexp
from tractexp.errors import UserError
from tractexp.filetypes.comtrade_writer import write
from tractexp.recording.recording import Channel, Recording, Segment

KEYS = "voltages|currents|columns|units|connection|reverse_current"
SETTING = re.compile(rf"\b({KEYS})=(\[[^\]]*\]|\{{[^}}]*\}}|[^\s;,)]+)")
MOST = 8  # advices that may follow one another
RATE = 1600.0


def waves(seconds=2.0, depth=0.3, P=20.0, Q=8.0, U=110.0, noise=1e-3):
    """(6, N) voltages to ground [kV] and currents [kA] with a dip at 1 s."""
    t = np.arange(0, seconds, 1 / RATE)
    u = np.where((t >= 1) & (t < 1.25), 1 - depth, 1.0)
    V = U / np.sqrt(3) * u
    I = np.conj((P * u**1.5 + 1j * Q * u**2) / (3 * V))
    turn = np.exp(1j * (2 * np.pi * 50 * t - 2 * np.pi / 3 * np.arange(3)[:, None]))
    made = np.concatenate([np.sqrt(2) * np.real(V * turn), np.sqrt(2) * np.real(I * turn)])
    size = np.abs(made).max(axis=1, keepdims=True)
    return made + noise * size * np.random.default_rng(1).standard_normal(made.shape)


def recorded(tmp_path, rows, names, units, rate=RATE):
    quantities = {"kV": "voltage", "kA": "current"}
    channels = []
    for row, name, unit in zip(rows, names, units, strict=True):
        gain = (np.abs(row).max() or 1.0) / 30000
        channels.append(
            Channel(
                name,
                np.round(row / gain).astype(np.int16),
                unit,
                quantities.get(unit, ""),
                gain=gain,
            )
        )
    segments = [Segment(0, len(rows[0]), rate, 0.0)]
    write(
        Recording(str(tmp_path / "r.cfg"), channels, segments), tmp_path / "r.cfg", "BINARY", 1999
    )
    return str(tmp_path / "r.cfg")


def walk(path, settings):
    """("read" or "no", settings that were tried, the last sentence)."""
    seen, sentence = [], ""
    for _ in range(MOST):
        assert settings not in seen, f"a circle of refusals: {[*seen, settings]}: {sentence}"
        seen.append(settings)
        try:
            return "read", seen, str(tractexp.read(path, **settings))
        except UserError as error:
            sentence = str(error)
        advice = {
            key: yaml.safe_load(value)
            for key, value in SETTING.findall(sentence.rpartition(";")[2])
        }
        advice = {key: value for key, value in advice.items() if "..." not in str(value)}
        if not advice:
            return "no", seen, sentence
        settings = {**settings, **advice}
    raise AssertionError(f"{MOST} advices without an end: {seen}")


KV, KA = ["kV"] * 3, ["kA"] * 3
NAMES = ["UA", "UB", "UC", "IA", "IB", "IC"]
PLAIN = ["C1", "C2", "C3", "C4", "C5", "C6"]
ORDERS = [[0, 1, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1]]


@pytest.mark.parametrize(
    "names", [NAMES, PLAIN, [*NAMES[:3], "IC", "IB", "IA"], [*NAMES[:3], "IB", "IC", "IA"]]
)
@pytest.mark.parametrize("volts", ORDERS)
@pytest.mark.parametrize("amps", ORDERS)
def test_every_order_that_is_advised_is_accepted(tmp_path, names, volts, amps):
    path = recorded(tmp_path, waves(), names, [*KV, *KA])
    end, seen, said = walk(path, {"voltages": volts, "currents": [3 + k for k in amps]})
    assert end == "read" or "no other order" in said, said
    assert len(seen) <= 3


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("names", [NAMES, PLAIN])
def test_noise_gets_no_advice(tmp_path, names, seed):
    noise = np.random.default_rng(seed).standard_normal((6, 3200))
    path = recorded(tmp_path, noise, names, [*KV, *KA])
    for settings in ({}, {"voltages": [0, 1, 2], "currents": [3, 4, 5]}):
        end, _, said = walk(path, settings)
        assert end == "no"
        assert "give " not in said, said
        assert "name one" not in said


@pytest.mark.parametrize(
    ("rows", "names", "units", "every", "says"),
    [
        (slice(0, 3), NAMES[:3], KV, 1, "no channel is a current"),
        (slice(3, 6), NAMES[3:], KA, 1, "no channel is a voltage"),
        (slice(0, 6), NAMES, [*KV, *KA], 4, "no waveform, for which 10 samples per cycle"),
    ],
)
def test_nobody_is_told_to_name_what_is_not_there(tmp_path, rows, names, units, every, says):
    path = recorded(tmp_path, waves()[rows, ::every], names, units, RATE / every)
    end, _, said = walk(path, {})
    assert (end, says in said) == ("no", True), said
    assert "name one" not in said
    first = str(tractexp.look(path, progress=False).summary()).strip().splitlines()[0]
    assert "name them" not in first
    assert says in first or "no current is recorded" in first


def test_of_voltages_alone_the_dip_is_told_in_a_csv_as_well(tmp_path):
    v = waves()[:3]
    t = np.arange(v.shape[1]) / RATE
    for order in ([0, 1, 2], [0, 2, 1]):
        np.savetxt(
            tmp_path / "v.csv", np.c_[t, v[order].T], "%.6f", ",", header="t,va,vb,vc", comments=""
        )
        (event,) = tractexp.look(str(tmp_path / "v.csv"), progress=False).events
        assert (event["kind"], event["worth"]) == ("dip", False)
        assert event["depth"] == pytest.approx(0.3, abs=0.01)
        assert event["start"] == pytest.approx(1.0, abs=0.02)


def table(tmp_path, above, header, columns):
    t = np.arange(0, 10, 0.02)
    u = np.where((t >= 4) & (t < 4.3), 0.7, 1.0)
    values = {"U": 110 * u, "P": 20 * u**1.5, "Q": 8 * u**2, "P2": 5 * u**1.5, "Q2": 2 * u**2}
    lines = [
        *above,
        header,
        *(
            ",".join(f"{x:.4f}" for x in row)
            for row in zip(t, *(values[c] for c in columns), strict=True)
        ),
    ]
    (tmp_path / "t.csv").write_text("\n".join(lines) + "\n")
    return str(tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("above", "header"),
    [
        ([], "t,U (kV),P1 (MW),Q1 (Mvar),P2 (MW),Q2 (Mvar)"),
        ([], "t,U (kV),P (MW),Q (Mvar),P (MW),Q (Mvar)"),
        ([",,Feeder 1,,Feeder 2,"], "t,U (kV),P (MW),Q (Mvar),P (MW),Q (Mvar)"),
        ([",,Line North,,Line South"], "t,U (kV),P (MW),Q (Mvar),P (MW),Q (Mvar)"),
    ],
)
def test_two_feeders_in_a_table_are_told_apart_by_one_answer(tmp_path, above, header):
    path = table(tmp_path, above, header, ["U", "P", "Q", "P2", "Q2"])
    end, seen, said = walk(path, {})
    assert end == "read", said
    assert len(seen) <= 2
    (event,) = tractexp.read(path, **seen[-1])
    assert event.record.base.power == pytest.approx(np.hypot(20, 8), rel=1e-3)


def test_merged_headings_name_the_feeder_in_the_question(tmp_path):
    path = table(
        tmp_path,
        [",,Line North,,Line South"],
        "t,U (kV),P (MW),Q (Mvar),P (MW),Q (Mvar)",
        ["U", "P", "Q", "P2", "Q2"],
    )
    with pytest.raises(
        UserError,
        match=r"'Line North P' \[MW\], 'Line South P'.*P: 'Line North P', Q: 'Line North Q'",
    ):
        tractexp.read(path)


def test_a_choice_that_is_given_stands_in_the_next_answer(tmp_path):
    path = table(
        tmp_path, [], "t,U (kV),P (MW),Q (Mvar),P (MW),Q (Mvar)", ["U", "P", "Q", "P2", "Q2"]
    )
    with pytest.raises(UserError, match=r"columns=\{Q: 3, P: 4\}"):
        tractexp.read(path, columns={"P": 4})
