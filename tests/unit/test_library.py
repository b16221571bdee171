"""The library of terms, `list_terms`, and the effect that holds all of a kind, `Library`."""

from tractexp.configuration.plugin import get
from tractexp.discrepancy.proposal.effect import Library
from tractexp.discrepancy.proposal.library import ANSWER, list_terms, pick_of
from tractexp.model.model import compose


def test_the_library_has_a_name_for_each_term():
    names = [t.name for t in list_terms()]
    assert len(set(names)) == len(names) > 200
    assert sum(len(t.signal.settings) for t in list_terms()) > 5000


def test_the_library_adds_each_signal_that_is_picked():
    """Of the steady state only: what it adds to an equation is the picked signal times the size,
    with its sign.
    """
    motor, static = get("model/motor", "electromechanical")(), get("model/static", "exponential")()
    eq = compose(motor, static, [Library(ANSWER)]).equations
    (defined,) = [e for s, e in eq.definitions.items() if s.name == f"{ANSWER}_signal"]
    picked = {s: 1 for s in defined.free_symbols if s.name == pick_of(ANSWER, "constant")}
    others = {s: 0 for s in defined.free_symbols if "pick_" in s.name and s not in picked}
    assert picked
    assert others
    assert defined.subs(others | picked) == 1
