"""What `look` prints is followed, on made records of each kind, until a command reads a dip to fit
or a final no advises nothing: no advice comes twice.

The commands are taken as they are printed and read in this process; no model is fitted.
"""

import re
import shlex

import numpy as np
import pytest
import yaml
from test_field_neighbors import DIP, single, slow, station, three, write, write_table

import tractexp
from tractexp.errors import UserError

KEYS = "voltages|currents|columns|units|connection|reverse_current|base_voltage|base_power|join"
ADVICE = re.compile(rf"\b({KEYS})=(\[[^\]]*\]|\{{[^}}]*\}}|[^\s;,)]+)")
COMMAND = re.compile(r"to fit it: (tractexp .*)")
MOST = 6  # advices that may follow one another


def read_settings(words):
    """{key: value} of `data.KEY=VALUE` as a command has them; of others their names are enough."""
    pairs = (word.partition("=") for word in words if word.startswith("data."))
    spaced = {key.removeprefix("data."): re.sub(r":(?=\S)", ": ", value) for key, _, value in pairs}
    return {key: yaml.safe_load(value) for key, value in spaced.items()}


def read_printed(command):
    """The dips that a printed command fits and validates."""
    settings = read_settings(shlex.split(command)[1:])
    return tractexp.read(settings.pop("path"), **settings)


def walk(path):
    """("fit" or "no", settings that were tried, the last words)."""
    settings, tried = {}, []
    for _ in range(MOST):
        assert settings not in tried, f"a circle of advices: {[*tried, settings]}"
        tried.append(settings)
        try:
            seen = tractexp.look(path, progress=False, **settings)
            text = " ".join([*str(seen.summary()).split("\n"), *seen.files.rows[0]["notes"]])
            first = str(seen.summary()).splitlines()[0]
            if command := COMMAND.search(first):
                assert read_printed(command[1])
                return "fit", tried, first
        except UserError as error:
            text = str(error)
        advice = {}
        for key, value in ADVICE.findall(" ".join(text.split())):
            if "..." not in value:
                advice.setdefault(key, yaml.safe_load(value.rstrip(".")))
        advice = {
            key: {**settings.get(key, {}), **value} if isinstance(value, dict) else value
            for key, value in advice.items()
        }
        if not advice or {**settings, **advice} == settings:
            return "no", tried, text
        settings = {**settings, **advice}
    raise AssertionError(f"{MOST} advices without an end: {tried}")


def rename(rows, units):
    return [(name, units["kV" if unit == "kV" else "kA"], z) for name, unit, z in rows]


V, I = three()
ONE, OWN = single()
PLAIN = station(V, I)
SECONDARY = [
    *(("U" + p, "V", 1e-3 * x / 1.1e-3) for p, x in zip("ABC", V, strict=True)),
    *(("I" + p, "A", x / 0.12) for p, x in zip("ABC", I, strict=True)),
]
CHANNELS = {
    "plain": (PLAIN, "fit"),
    "no unit": (rename(PLAIN, {"kV": "", "kA": ""}), "fit"),
    "two units in one": (rename(PLAIN, {"kV": "V/kV", "kA": "A/kA"}), "fit"),
    "per unit": (rename(PLAIN, {"kV": "pu", "kA": "pu"}), "fit"),
    "secondary by size": (SECONDARY, "fit"),
    "backward currents": (station(V, -I), "fit"),
    "other order": ([PLAIN[k] for k in (0, 2, 1, 3, 4, 5)], "fit"),
    "voltages alone": (PLAIN[:3], "no"),
    "currents alone": (PLAIN[3:], "no"),
    "one voltage, three currents": ([PLAIN[0], *PLAIN[3:]], "no"),
    "three voltages, one current": (PLAIN[:4], "no"),
    "quiet": (station(V / DIP, I / DIP), "no"),
    "a swell": (station(V / DIP**2, I / DIP**2), "no"),
    "half of a 2x25 kV feeder": (
        [("U_C", "kV", ONE), ("U_F", "kV", -ONE), ("I_C", "kA", OWN)],
        "fit",
    ),
    "neutral": ([("U", "kV", ONE), ("I", "kA", OWN), ("In", "kA", 0.1 * OWN)], "fit"),
    "dead": (station(1e-6 * V, 1e-6 * I), "no"),
    "in doubt between two buses": (
        [
            *((f"U1{p}", "kV", x) for p, x in zip("ABC", V, strict=True)),
            *((f"U2{p}", "kV", x) for p, x in zip("ABC", V * DIP**0.4, strict=True)),
            *((f"I{p}", "kA", x) for p, x in zip("ABC", I, strict=True)),
        ],
        "fit",
    ),
}


@pytest.mark.parametrize("kind", CHANNELS)
def test_each_advice_on_channels_leads_to_a_fit_or_a_final_no(tmp_path, kind):
    rows, ends = CHANNELS[kind]
    end, tried, last = walk(str(write(tmp_path, *rows)))
    assert end == ends, (tried, last)


t, U, P, Q = slow()
E = (1 / np.sqrt(3)) * U
COLUMNS = {
    "plain": ("t,U (kV),P (MW),Q (Mvar)", [t, U, P, Q], "fit"),
    "per unit": ("t,U,P,Q", [t, U / 110, P / 20, Q / 20], "fit"),
    "no units": ("t,U,P,Q", [t, U, P, Q], "fit"),
    "two feeders": (
        "t,U (kV),P1 (MW),Q1 (Mvar),P2 (MW),Q2 (Mvar)",
        [t, U, P, Q, P / 2, Q / 3],
        "fit",
    ),
    "a unit is missing": ("t,U (kV),P (MW),Q", [t, U, P, Q], "fit"),
    "backward": ("t,U (kV),P (MW),Q (Mvar)", [t, U, -P, -Q], "fit"),
    "voltage alone": ("t,U (kV)", [t, U], "no"),
    "without Q": ("t,U (kV),P (MW)", [t, U, P], "no"),
    "without U": ("t,P (MW),Q (Mvar)", [t, P, Q], "no"),
    "magnitudes": ("t,Ua (kV),Ub (kV),Uc (kV),Ia (A),Ib (A),Ic (A)", [t, E, E, E, P, P, P], "no"),
    "direct": ("t,U [V]", [t, 1500 * U / 110], "no"),
    "direct with powers": ("t,U [V],P [kW],Q [kvar]", [t, 1500 * U / 110, P, 0 * Q], "fit"),
    "ten a second": ("t,U (kV),P (MW),Q (Mvar)", [x[::5] for x in (t, U, P, Q)], "no"),
    "milliseconds": ("t,U (kV),P (MW),Q (Mvar)", [1000 * t, U, P, Q], "fit"),
    "days of a year": ("t,U (kV),P (MW),Q (Mvar)", [60 + t / 86400, U, P, Q], "no"),
    "no voltage": ("t,U (kV),P (MW),Q (Mvar)", [t, 0 * U, 0 * P, 0 * Q], "no"),
    "a word": ("time of day,A,B,C", [t, U, P, Q], "no"),
}


@pytest.mark.parametrize("kind", COLUMNS)
def test_each_advice_on_a_table_leads_to_a_fit_or_a_final_no(tmp_path, kind):
    header, columns, ends = COLUMNS[kind]
    rows = [[f"{x:.10g}" for x in row] for row in zip(*columns, strict=True)]
    end, tried, last = walk(write_table(tmp_path / "t.csv", header, rows))
    assert end == ends, (tried, last)


def test_files_of_one_event_are_joined_as_is_advised(tmp_path):
    for folder, rows in (("u", PLAIN[:3]), ("i", PLAIN[3:])):
        (tmp_path / folder).mkdir()
        path = write(tmp_path / folder, *rows)
        for part in (path, path.with_suffix(".dat")):
            part.rename(tmp_path / f"event_{folder.upper()}{part.suffix}")
    end, tried, last = walk(str(tmp_path / "event_U.cfg"))
    assert (end, len(tried)) == ("fit", 2), last


def test_of_one_phase_the_first_line_names_the_files_of_the_others(tmp_path):
    for k, name in enumerate(("ev_L1", "ev_L2", "ev_L3")):
        (tmp_path / name).mkdir()
        path = write(tmp_path / name, ("U", "kV", V[k]), ("I", "kA", I[k]))
        for part in (path, path.with_suffix(".dat")):
            part.rename(tmp_path / f"{name}{part.suffix}")
    first = str(tractexp.look(str(tmp_path / "ev_L1.cfg"), progress=False).summary()).splitlines()[
        0
    ]
    joined = "with ev_L2.cfg and ev_L3.cfg beside it, of the same event, more of the event is shown"
    assert joined in first
    assert read_printed(COMMAND.search(first)[1])
