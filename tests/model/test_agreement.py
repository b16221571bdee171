"""What each event tells and which does not belong, `agreement`: planted faults, and what they
cost.
"""

from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from printed_events import records
from written_out import dense

from tractexp.identification import agreement
from tractexp.inference.information import Information
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem


def judged(events):
    return study.judged(Problem(study.model(), events), study.TYPICAL).uncertainty


@pytest.fixture(scope="module")
def alike():
    """Four dips of one load."""
    return judged(records((0.3, 0.4, 0.5, 0.6), 0.003))


@pytest.fixture(scope="module")
def mixed():
    """Three dips of one load, and one of another inertia."""
    changed = study.TYPICAL.copy()
    changed[3] *= 1.15
    (odd,) = records((0.4,), 0.003, seed=9, truth=changed)
    odd = replace(odd, record=replace(odd.record, name="changed"))
    return judged([*records((0.3, 0.5, 0.6), 0.003), odd])


def test_each_event_is_credited_with_what_it_tells(alike):
    told = agreement.compare_events(alike)
    assert told["odd_events"] == []
    assert all(ratio >= 1 for gain in told["gains"].values() for ratio in gain.values())
    assert told["gains"]["dip 4"]["M"] > told["gains"]["dip 1"]["M"]


def test_the_event_that_does_not_belong_is_named(mixed):
    told = agreement.compare_events(mixed)
    assert told["odd_events"] == ["changed"]
    assert "changed does not fit with the rest: deviance higher by" in told["notes"][0]


def test_only_the_events_that_disagree_most_are_fitted_by_themselves(mixed, monkeypatch):
    """What is linear finds them: the same as a fit without and of each."""
    monkeypatch.setattr(agreement, "SUSPECTS", 2)
    few = agreement.find_disagreeing_events(mixed)
    monkeypatch.setattr(agreement, "SUSPECTS", 4)
    assert few == agreement.find_disagreeing_events(mixed)
    assert few[0] == ["changed"]


def test_the_powers_of_all_events_take_one_simulation_of_differences(alike, monkeypatch):
    """Of P before the dips and of Q, however many events there are."""
    assert alike.exact
    only, sizes = agreement.select_group_rows, []

    def counted(likelihood, groups):
        rows = only(likelihood, groups)
        return lambda unit, lanes: (sizes.append(len(unit) / len(groups)), rows(unit, lanes))[1]

    monkeypatch.setattr(agreement, "select_group_rows", counted)
    assert agreement.find_disagreeing_events(alike) == ([], [])
    assert max(sizes) == alike.likelihood.free + 2


def test_no_more_fits_are_made_for_many_events(alike, monkeypatch):
    only, fits = agreement.select_group_rows, []
    monkeypatch.setattr(agreement, "SUSPECTS", 2)
    monkeypatch.setattr(
        agreement,
        "select_group_rows",
        lambda likelihood, groups: (fits.append(groups), only(likelihood, groups))[1],
    )
    assert agreement.find_disagreeing_events(alike) == ([], [])
    assert [len(groups) for groups in fits] == [1 + 2 * 2]


def test_a_jacobian_takes_as_many_simulations_for_many_events(alike, monkeypatch):
    """Time and memory grow with the records, not with their number of events, too."""
    likelihood, rows, taken = alike.likelihood, Likelihood.rows, []
    monkeypatch.setattr(
        Likelihood,
        "rows",
        lambda self, unit, *lanes: (taken.append(len(unit)), rows(self, unit))[1],
    )
    _, J = likelihood.jacobian(alike.unit)
    assert taken == [2 * (likelihood.free + 2) + 1]
    assert J.columns.shape == (likelihood.free + 2, likelihood.problem.drive.measurements.size)


def test_the_gain_of_an_event_is_that_of_all_rows_against_those_without_its_own(alike):
    """Over every row and every P0 and Q0 at once, as the least squares of the whole have them."""
    known, likelihood, gains = alike, alike.likelihood, agreement.compare_events(alike)["gains"]
    J = dense(likelihood.jacobian(known.unit)[1])

    def errors(rows):
        own, nuisances = J[rows][:, : likelihood.free], J[rows][:, likelihood.free :]
        information = Information.from_jacobian(
            known.names, known.values, known.upper - known.lower, own, nuisances
        )
        return information.standard_errors

    whole = errors(np.arange(len(J)))
    for e, gain in enumerate(gains.values()):
        assert list(gain.values()) == pytest.approx(
            errors(np.setdiff1d(np.arange(len(J)), likelihood.separable_columns.rows[e])) / whole,
            rel=1e-9,
        )
