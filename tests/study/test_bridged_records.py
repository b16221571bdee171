"""Parameters of records that lack single samples are those of the whole record."""

import dataclasses

import made_recordings
import numpy as np
import pytest

import tractexp
from tractexp.filetypes import comtrade

LOAD = made_recordings.LOAD
FREE = ("T_prime", "M", "T_m")
QUICK = {
    "optimizer": {"name": "multistart_least_squares", "starts": 2},
    "check_intervals": False,
    "progress": False,
}


def estimate(event, **settings):
    """The free parameters that an identification finds."""
    load = tractexp.compose(**settings)
    fixed = {p.name: LOAD.get(p.name, p.default) for p in load.model.parameters}
    fixed = {name: value for name, value in fixed.items() if name not in FREE}
    return tractexp.identify(event, load, fixed=fixed, **QUICK).result.parameters


def test_a_table_that_lacks_a_row_before_the_dip_and_one_in_it_gives_the_true_parameters():
    made = tractexp.simulate(
        tractexp.compose(), LOAD, depth=0.3, duration=0.2, rate=200.0, length=2.0
    )
    r = made.responses[0]
    inside = int(np.argmax(r.U < 0.9)) + 12
    table = {"t": r.t, "U": r.U, "P": r.P, "Q": r.Q}
    [event] = tractexp.read({name: np.delete(x, [20, inside]) for name, x in table.items()})
    assert np.isnan(event.record.P).sum() == 2
    found = estimate(event)
    assert [found[name] for name in FREE] == pytest.approx([LOAD[n] for n in FREE], rel=1e-6)


@pytest.mark.parametrize("domain", ["phasors", "waves"])
def test_waveforms_that_lack_samples_give_the_parameters_of_the_whole(tmp_path, domain):
    whole = made_recordings.recording(made_recordings.motor_dip(0.3, noise=2e-4, length=1.2))
    lacking = [dataclasses.replace(c, raw=c.raw.copy(), missing=-32768) for c in whole.channels]
    for channel, sample in ((0, 500), (3, 1850), (4, 1850)):
        lacking[channel].raw[sample] = -32768
    found = []
    for name, channels in (("a.cfg", whole.channels), ("b.cfg", lacking)):
        recording = dataclasses.replace(whole, channels=channels)
        comtrade.write(recording, tmp_path / name)
        [event] = tractexp.read(tmp_path / name)
        found.append(estimate(event, domain=domain))
    assert found[1] == pytest.approx(found[0], rel=0.01)
