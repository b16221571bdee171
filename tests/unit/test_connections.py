"""Connections: what ideal transformers and theorems say of them, and the way from channels to a
record.
"""

import itertools

import numpy as np
import pytest

from tractexp.api.read import record_from_dict, record_to_dict
from tractexp.configuration.plugin import build_chosen
from tractexp.errors import UserError
from tractexp.record.phasor import TURN, compute_sequences
from tractexp.recording import Channel, Feeder, Recording, Segment
from tractexp.recording.measure import measure_phasors
from tractexp.recording.reader import WaveformReader

BALANCED = np.array([1.0, TURN**2, TURN])
TRANSFORMERS = ["v_v", "scott", "woodbridge", "le_blanc"]
PAIRS = ["ab", "bc", "ca", "ba", "cb", "ac"]


def arms(name, ratio=1.0, **settings):
    return [
        build_chosen("connection", {"name": name, "arm": arm, "ratio": ratio, **settings})
        for arm in ("alpha", "beta")
    ]


def every():
    """Each transformer in each order of phases, both its arms."""
    for name in TRANSFORMERS[1:]:
        yield from (pytest.param(arms(name, 4.0, pair=pair), id=f"{name}-{pair}") for pair in PAIRS)
    for pairs in itertools.permutations(PAIRS, 2):
        if set(pairs[0]) != set(pairs[1]):
            yield pytest.param(arms("v_v", 4.0, pairs=list(pairs)), id=f"v_v-{'-'.join(pairs)}")


EVERY = pytest.mark.parametrize("both", list(every()))


def no_zero_sequence(seed):
    """Three phasors of any kind but of sum zero."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=3) + 1j * rng.normal(size=3)
    return x - x.mean()


def primary(both, currents):
    """Primary phase currents (3,) when the arms draw these (2,): the dual of their voltages."""
    return np.concatenate([arm.voltage() for arm in both]).T @ currents


@EVERY
def test_the_arms_take_the_power_of_the_primary(both):
    """Whatever the voltages and currents, with a zero sequence of voltage as well."""
    V, I = no_zero_sequence(1) + 0.3, no_zero_sequence(2)
    taken = sum((arm.voltage() @ V)[0] * (arm.current() @ I)[0].conj() for arm in both)
    assert taken == pytest.approx(V @ I.conj())


@EVERY
def test_currents_there_and_back(both):
    drawn = np.array([0.7 - 0.2j, -0.1 + 1.3j])
    I = primary(both, drawn)
    assert I.sum() == pytest.approx(0)
    assert [(arm.current() @ I)[0] for arm in both] == pytest.approx(drawn)


@EVERY
def test_a_zero_sequence_of_the_primary_leaves_the_arms_alone(both):
    for arm in both:
        assert arm.voltage() @ np.ones(3) == pytest.approx(0)
        assert arm.current() @ np.ones(3) == pytest.approx(0)


@EVERY
def test_an_arm_has_the_line_voltage_over_the_ratio(both):
    for arm in both:
        assert abs((arm.voltage() @ BALANCED)[0]) == pytest.approx(np.sqrt(3) / 4.0)


@pytest.mark.parametrize("name", TRANSFORMERS)
def test_what_equal_arms_do_to_the_balance(name):
    """A quarter cycle apart they draw no negative sequence; on two pairs of phases half of the
    positive one.
    """
    both = arms(name, 4.0)
    U = np.array([(arm.voltage() @ BALANCED)[0] for arm in both])
    I = primary(both, U * (0.8 - 0.6j))
    positive, negative = np.abs(compute_sequences(I[:, None]))[:, 0]
    assert negative / positive == pytest.approx(0.5 if name == "v_v" else 0.0, abs=1e-12)
    apart = abs(np.angle(U[0] / U[1], deg=True))
    assert apart == pytest.approx(120 if name == "v_v" else 90)


@EVERY
def test_one_arm_alone_is_a_load_between_phases(both):
    """A single-phase load: its negative sequence is as great as the positive, whatever the
    transformer.
    """
    positive, negative = np.abs(compute_sequences(primary(both, np.array([1.0, 0.0]))[:, None]))[
        :, 0
    ]
    assert negative == pytest.approx(positive)


def test_the_v_v_arm_currents_are_those_of_the_outer_phases():
    """I_alpha = I_a, I_beta = -I_c of a V/v transformer between ab and bc."""
    I = no_zero_sequence(3)
    alpha, beta = arms("v_v")
    assert (alpha.current() @ I)[0] == pytest.approx(I[0])
    assert (beta.current() @ I)[0] == pytest.approx(-I[2])


def test_the_scott_teaser_has_the_third_phase():
    """U_T = (V_a - (V_b + V_c) / 2) / (sqrt(3)/2), and its current is sqrt(3)/2 of
    the primary's.
    """
    V, I = no_zero_sequence(4), no_zero_sequence(5)
    main, teaser = arms("scott")
    assert (main.voltage() @ V)[0] == pytest.approx(V[1] - V[2])
    assert (teaser.voltage() @ V)[0] == pytest.approx((V[0] - (V[1] + V[2]) / 2) / (np.sqrt(3) / 2))
    assert (teaser.current() @ I)[0] == pytest.approx(np.sqrt(3) / 2 * I[0])


def test_the_le_blanc_arms_are_those_of_its_five_windings():
    V = no_zero_sequence(6)
    U = np.array([V[0] - V[1], V[1] - V[2], V[2] - V[0]])
    alpha, beta = arms("le_blanc")
    assert (alpha.voltage() @ V)[0] == pytest.approx(2 / 3 * U[0] - (U[1] + U[2]) / 3)
    assert (beta.voltage() @ V)[0] == pytest.approx((U[1] - U[2]) / np.sqrt(3))


@pytest.mark.parametrize("zero", [0.0, 0.4])
def test_line_voltages_give_the_phase_voltages_but_for_a_zero_sequence(zero):
    V = no_zero_sequence(7)
    seen = V + zero
    lines = np.array([seen[0] - seen[1], seen[1] - seen[2], seen[2] - seen[0]])
    assert build_chosen("connection", "line_voltages").voltage() @ lines == pytest.approx(V)
    assert build_chosen("connection", "two_line_voltages").voltage() @ lines[:2] == pytest.approx(V)
    turned = {"name": "two_line_voltages", "pairs": ["cb", "ca"]}
    assert build_chosen("connection", turned).voltage() @ np.array(
        [-lines[1], lines[2]]
    ) == pytest.approx(V)


@pytest.mark.parametrize("phases", PAIRS)
@pytest.mark.parametrize("name", ["aron", "two_line_voltages"])
def test_two_current_transformers_give_all_currents_of_a_load_without_neutral(name, phases):
    I = no_zero_sequence(8)
    made = build_chosen("connection", {"name": name, "phases": phases})
    assert made.current() @ np.array([I["abc".index(p)] for p in phases]) == pytest.approx(I)
    assert made.currents == 2


def test_two_wattmeters_read_the_power():
    """Blondel: V_ab I_a* + V_cb I_c* is the power of a three-wire load, whatever its symmetry."""
    V, I = no_zero_sequence(9), no_zero_sequence(10)
    made = build_chosen(
        "connection", {"name": "two_line_voltages", "pairs": ["ab", "cb"], "phases": "ac"}
    )
    lines = np.array([V[0] - V[1], V[2] - V[1]])
    phases = made.voltage() @ lines, made.current() @ I[[0, 2]]
    assert phases[0] @ phases[1].conj() == pytest.approx(lines @ I[[0, 2]].conj())


@pytest.mark.parametrize(
    ("connection", "says"),
    [
        ({"name": "v_v", "arm": "left"}, r"data\.connection\.arm=left is not one of alpha, beta"),
        ({"name": "v_v", "ratio": 0.0}, r"data\.connection\.ratio=0.0 is out of range"),
        ({"name": "v_v", "pairs": ["ab", "ba"]}, "names a pair of phases twice"),
        ({"name": "v_v", "pairs": ["ab"]}, "must be two pairs of phases"),
        ({"name": "v_v", "pairs": ["ab", "ad"]}, "=ad is not one of ab, bc"),
        ({"name": "scott", "pair": "aa"}, r"data\.connection\.pair=aa is not one of"),
        ({"name": "scott", "pairs": ["ab"]}, "connection 'scott' has no setting 'pairs'"),
        ({"name": "aron", "phases": "abc"}, r"data\.connection\.phases=abc is not one of"),
        ({"name": "line_voltages", "pairs": ["ab", "bc"]}, "must be three pairs"),
        ({"name": "two_line_voltages", "pairs": ["ab"]}, "must be two pairs"),
        ({"arm": "alpha"}, "must be a name, or a mapping of 'name' and settings"),
        ("v-v", "there is no connection 'v-v'; did you mean 'v_v'"),
    ],
)
def test_wrong_settings_are_refused_in_a_sentence(connection, says):
    with pytest.raises(UserError, match=says):
        build_chosen("connection", connection)


RATE = 4000.0


class Reader(WaveformReader):
    """A reader of what is in memory."""

    name = "memory"
    endings = (".cfg",)
    made = None

    def recording(self):
        return self.made


def recording(channels, skew=()):
    """Waves {name: (N,)} in kV and kA, by the first letter of the name."""
    made = [
        Channel(
            name,
            wave,
            *(("kV", "voltage") if name[0] == "U" else ("kA", "current")),
            skew=dict(skew).get(name, 0),
        )
        for name, wave in channels.items()
    ]
    return Recording("memory", made, [Segment(0, len(made[0].raw), RATE, 0.0)])


def waves(phasors, t):
    """(K, N) of RMS phasors (K,) that fall to 60 % for a fifth of a second."""
    level = np.where(np.abs(t - 0.7) < 0.1, 0.6, 1.0)
    return np.sqrt(2) * level * np.real(np.asarray(phasors)[:, None] * np.exp(2j * np.pi * 50 * t))


def test_an_arm_behind_a_v_v_transformer_from_channels_to_a_record(monkeypatch):
    """110 kV, 27.5 kV arms of 12 + j5 and 3 + j1 MVA: the record of the first is
    that of its own.
    """
    t = np.arange(round(1.5 * RATE)) / RATE
    both = arms("v_v", 4.0)
    V = 110 / np.sqrt(3) * BALANCED
    U = np.array([(arm.voltage() @ V)[0] for arm in both])
    I = (np.array([12 + 5j, 3 + 1j]) / U).conj()
    seen = [*waves(V, t), *waves(primary(both, I), t)]
    monkeypatch.setattr(
        Reader,
        "made",
        recording(dict(zip(("Ua", "Ub", "Uc", "Ia", "Ib", "Ic"), seen, strict=True))),
    )
    arm = {"name": "v_v", "arm": "alpha", "ratio": 4.0}
    reader = Reader(
        path="x.cfg", voltages=["Ua", "Ub", "Uc"], currents=["Ia", "Ib", "Ic"], connection=arm
    )
    [record] = reader.read().train
    assert record.base.voltage == pytest.approx(27.5, rel=1e-4)
    assert record.base.power == pytest.approx(13.0, rel=1e-4)
    assert (record.P[0], record.Q[0]) == pytest.approx((12 / 13, 5 / 13), rel=1e-4)
    assert record.U2 is None
    assert any("arm alpha of an ideal v_v transformer" in note for note in record.notes)
    assert any(
        "equivalents, whose parameters are those of no machine" in note for note in record.notes
    )


def test_one_voltage_and_one_current_make_a_record(monkeypatch):
    t = np.arange(round(1.5 * RATE)) / RATE
    seen = {"U": waves([27.5], t)[0], "I": waves([0.4 * np.exp(-0.5j)], t)[0]}
    monkeypatch.setattr(Reader, "made", recording(seen))
    settings = {"estimator": "p_class", "harmonics": [3], "connection": "single_phase"}
    [record] = Reader(path="x.cfg", voltages=["U"], currents=["I"], **settings).read().train
    assert record.base.voltage == pytest.approx(27.5, rel=1e-4)
    assert (record.base.power, record.P[0]) == pytest.approx((11.0, np.cos(0.5)), rel=1e-4)
    assert record.window.name == "p_class"
    assert set(record.more) == {"P_3", "P_H", "THD_u", "THD_i"}
    assert any("p-class phasors every 1 ms" in note for note in record.notes)
    told = record_to_dict(record)
    back = record_from_dict(told)
    assert back.window.to_dict() == record.window.to_dict()
    assert back.more["THD_u"].tolist() == record.more["THD_u"].tolist()


def test_skew_is_corrected_by_channel_and_refused_where_a_phase_is_made_of_several():
    t = np.arange(4000) / RATE
    turned = np.exp(2j * np.pi * 50 * 3e-4)  # sampled 0.3 ms late
    names = dict(
        zip(
            ("Ua", "Ub", "Uc", "Ia", "Ib", "Ic"),
            waves([*BALANCED, *(BALANCED * turned)], t),
            strict=True,
        )
    )
    made = recording(names, skew={name: 3e-4 for name in ("Ia", "Ib", "Ic")})
    feeder = Feeder((0, 1, 2), (3, 4, 5), "three_phase")
    S = measure_phasors(made, feeder, made.segments[0], skew=True).S
    assert np.abs(S.imag).max() < 1e-6
    odd = recording(names, skew={"Ia": 3e-4})
    aron = Feeder((0, 1, 2), (3, 5), "aron")
    with pytest.raises(UserError, match="Ia, Ic are sampled at different times"):
        measure_phasors(odd, aron, odd.segments[0], skew=True)


@pytest.mark.parametrize("harmonics", [[1], [40]])
def test_harmonics_that_cannot_be_seen_are_refused(harmonics):
    made = recording({"U": np.ones(4000), "I": np.ones(4000)})
    with pytest.raises(UserError, match=r"data\.harmonics=.* at 4000 Hz they can be 2 to 36"):
        measure_phasors(
            made, Feeder((0,), (1,), "single_phase"), made.segments[0], harmonics=harmonics
        )
