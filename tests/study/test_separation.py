"""How surely one more event tells rivals apart, `Separation`: linearized sides against refits, and
the events that are imagined.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_alike import fitted_alike

from tractexp.discrepancy.next_event.choose import DECIDED, LEAST_CHANCE, EventTrial, _fit_sides
from tractexp.discrepancy.next_event.imagined import ImaginedDip, imagine_dips, record_imagined
from tractexp.discrepancy.next_event.separation import (
    Separation,
    _reduce_blocks,
    linearize_side,
    view_events,
)
from tractexp.record import detect


def test_a_rival_is_linearised_as_its_refit_moves():
    """What a rival gains and loses by one mild event more is, linearised, what a refit of all
    parameters finds.
    """
    bench, noise, bare, fits = fitted_alike()
    truth, rival, event = (
        fits["stator_resistance"],
        fits["speed_dependent_torque"],
        ImaginedDip(0.1, 0.2),
    )
    sides = [linearize_side(bench, noise, fit) for fit in (bare, truth, rival)]
    views = [view_events(bench, noise, side, [event])[0] for side in sides]
    separation = Separation(sides, bench.criteria)
    rows = _reduce_blocks([np.vstack([v[0] - views[0][0][0], v[1:]]) for v, _ in views])
    linear = separation._deviance(2, (rows[2][0] - rows[1][0])[None], rows[2][1:])
    exact = separation._deviance(1, np.zeros((1, len(rows[1][0]))), rows[1][1:])
    moved = _fit_sides(bench, noise, sides, sides[1], event)[2]
    refitted = moved.deviance - truth.deviance
    assert float(exact[0]) == pytest.approx(truth.deviance, rel=1e-3)
    assert float(linear[0]) - truth.deviance == pytest.approx(refitted, rel=0.15, abs=1.0)


def test_rivals_that_no_event_tells_apart_do_not_spoil_the_chance_of_the_others():
    """Of three rivals, each event denies the third and nothing else."""
    denied = np.zeros((3, 3, 10), bool)
    denied[np.arange(3), np.arange(3)] = True  # the truth itself, for want of a rival
    denied[:2, 2] = denied[2, :2] = True
    ignored = np.zeros((3, 3), bool)
    event = ImaginedDip(0.4, 0.2)
    assert EventTrial.from_draws(event, denied, ignored).least == 0.0
    ignored[0, 1] = ignored[1, 0] = True
    assert EventTrial.from_draws(event, denied, ignored).least == 1.0


def test_rows_are_reduced_without_loss():
    rng = np.random.default_rng(1)
    blocks = [rng.normal(size=(3, 40)), rng.normal(size=(5, 40))]
    made = _reduce_blocks(blocks)
    assert [b.shape for b in made] == [(3, 8), (5, 8)]
    assert np.concatenate(made) @ np.concatenate(made).T == pytest.approx(
        np.concatenate(blocks) @ np.concatenate(blocks).T
    )


def test_a_set_is_not_told_from_itself_whatever_the_recorder_did():
    """Skew and drift of two fits say nothing of the load."""
    bench, noise, bare, fits = fitted_alike()
    fit, at = fits["stator_resistance"], bench.coordinates
    unit = fit.unit.copy()
    unit[at.parameters(["time_skew", "load_change"])] += 0.1
    sides = [linearize_side(bench, noise, f) for f in (bare, fit, replace(fit, unit=unit))]
    event = ImaginedDip(0.5, 0.4)
    own, other = (view_events(bench, noise, side, [event])[0][0][0] for side in sides[1:])
    assert other == pytest.approx(own, abs=1e-9)


def test_what_a_model_does_not_survive_tells_nothing():
    bench, noise, bare, fits = fitted_alike()
    sides = [
        linearize_side(bench, noise, f)
        for f in (bare, fits["stator_resistance"], fits["leakage_loss"])
    ]
    lost = np.full((4, 10), np.nan), 0.0
    assert not Separation(sides, bench.criteria).find_denied_rivals([lost] * 3, 1).any()


def test_what_rivals_miss_is_missed_in_each_of_its_like():
    """Twenty events of one kind leave one rival of noise alone; of a model's error they do not."""
    bench, noise, bare, fits = fitted_alike()
    rivals = fits["stator_resistance"], fits["speed_dependent_torque"]
    sides = [linearize_side(bench, noise, fit) for fit in (bare, *rivals)]
    separation, event = Separation(sides, bench.criteria, 200), ImaginedDip(0.4, 0.2)

    def chance(error, times):
        views = [view_events(bench, noise, side, [event], error)[0] for side in sides]
        denied = np.stack([separation.find_denied_rivals(views, truth, times) for truth in (1, 2)])
        return EventTrial.from_draws(event, denied, np.zeros((2, 2), bool)).least

    assert chance(0.0, 20) > DECIDED
    assert chance(1.0, 20) < LEAST_CHANCE
    assert chance(1.0, 2000) == chance(1.0, 20)


def test_dips_switching_phase_jumps_and_rates_are_tried():
    bench = fitted_alike()[0]
    events = imagine_dips(bench)
    assert {e.switched for e in events} == {True, False}
    assert {np.sign(e.jump) for e in events} == {-1.0, 0.0, 1.0}
    assert {e.rate for e in events} == {1, 4}
    assert not any(e.unbalance for e in events)
    assert any(e.unbalance for e in imagine_dips(bench, ["U2"]))
    assert "with the frequency f" in ImaginedDip(0.3, 0.1, jump=20.0).words
    assert "tap or a capacitor bank" in ImaginedDip(0.04, 1.0, switched=True).words


def test_the_smallest_switching_is_an_event_that_can_be_read():
    bench = fitted_alike()[0]
    made = record_imagined(bench, ImaginedDip(0.04, 1.0, switched=True), np.ones((2, 700)))
    again = detect(replace(made.record, name="switched").check())
    assert again.depth == pytest.approx(0.04, abs=0.005)
    assert again.duration == pytest.approx(1.0, abs=0.1)
