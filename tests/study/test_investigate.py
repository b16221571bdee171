"""Whether the held-out events are fitted, too, as `investigate` goes on where nothing is named."""

import dataclasses

import pytest
from made_dips import base, events
from made_sets import beside_base, held_out, row

from tractexp.discrepancy import investigate as investigating
from tractexp.discrepancy.evidence import Verdict
from tractexp.inference.kernels import Kernels


@pytest.mark.parametrize(
    ("word", "closes", "chosen"),
    [
        ("unexplained", True, "of all"),
        ("unexplained", False, "as asked"),
        ("named", True, "as asked"),
    ],
)
def test_all_events_are_fitted_where_nothing_is_named_and_their_name_closes_a_share(
    monkeypatch, word, closes, chosen
):
    """A name that predicts the held-out events is kept: that of all events predicts none."""
    # so that no term is sought
    held = beside_base(row(gap=held_out(1.0, 1.0)), p_of_all=0.0)
    empty = dict.fromkeys(item.name for item in dataclasses.fields(investigating.Findings))

    def findings_of(base, validate, seed, grader):
        found = {
            "evidence": held,
            "by_likelihood": held,
            "verdict": Verdict(word, (), complete=False),
        }
        return investigating.Findings(
            **empty | found | {"withheld": "as asked" if validate else "of all"}
        )

    monkeypatch.setattr(investigating.Findings, "closes_share", closes)
    monkeypatch.setattr(investigating.Findings, "base_values", None)
    monkeypatch.setattr(Kernels, "too_coarse", lambda *_: False)
    monkeypatch.setattr(investigating, "fit_base_model", lambda context: None)
    monkeypatch.setattr(investigating, "_take_steps", findings_of)
    made = events(count=2)
    told = investigating.investigate(base(), made[:1], made[1:], only=("undervoltage_trip",))
    assert told.withheld == chosen
    assert bool(told.all_fitted) == (chosen == "of all")
