"""A term as the text of a plugin, `generate`: a model takes that of each balance and signal."""

import itertools

import pytest
from nasty import NASTY
from proposed_file import load_proposed_effect

import tractexp
from tractexp.discrepancy.proposal import generate
from tractexp.discrepancy.proposal.library import ANSWER, BALANCES, CLOCKS, SIGNALS, Term

pytestmark = pytest.mark.usefixtures("registry_as_it_was")


def _every_balance_and_signal():
    answers = [s for s in SIGNALS if s.kind == ANSWER]
    here = list(BALANCES)
    pairs = [
        (b, s)
        for b, s in zip(here, itertools.cycle(answers), strict=False)
        if s.name not in b.without
    ]
    pairs += [(here[7], s) for s in answers if s.name != "constant"]
    made = [Term(b, s) for b, s in dict.fromkeys(pairs)]
    return [
        *made,
        *(
            Term(here[2], s, c)
            for s, c in zip((s for s in SIGNALS if s.kind != ANSWER), itertools.cycle(CLOCKS))
        ),
    ]


@pytest.mark.parametrize("chosen", _every_balance_and_signal(), ids=lambda t: t.name)
def test_every_balance_and_signal_makes_a_plugin_that_the_model_takes(
    chosen, tmp_path, monkeypatch
):
    values = {s.name: 0.1 for s in chosen.balance.sizes}
    values |= {s.name: s.grid[0] for s in chosen.signal.shapes}
    path = tmp_path / "proposed_effect.py"
    path.write_text(generate.write_source(chosen, values, "event1"), encoding="utf-8")
    effect = load_proposed_effect(path, monkeypatch).ProposedEffect()
    assert tractexp.compose().model.acceptance(effect).refusal is None
    assert [p.name for p in effect.parameters] == list(generate.list_term_parameters(chosen))


def test_a_name_of_a_record_is_text_in_the_plugin_that_is_to_be_installed(tmp_path, monkeypatch):
    chosen = _every_balance_and_signal()[0]
    values = {s.name: 0.1 for s in chosen.balance.sizes} | {
        s.name: s.grid[0] for s in chosen.signal.shapes
    }
    monkeypatch.chdir(tmp_path)
    for k, name in enumerate(NASTY):
        path = tmp_path / f"{k}.py"
        path.write_text(generate.write_source(chosen, values, name), encoding="utf-8")
        name = name.encode(errors="backslashreplace").decode()
        assert (
            f"workflow from {name}; no textbook"
            in load_proposed_effect(path, monkeypatch).ProposedEffect.__doc__
        )
    assert not (tmp_path / "owned").exists()
