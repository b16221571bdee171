"""What an investigation says while it works: each step, and that a long one goes on."""

import time

from tractexp.discrepancy import effort
from tractexp.discrepancy.effort import Effort


def test_a_long_step_is_not_silent(monkeypatch):
    monkeypatch.setattr(effort, "SILENCE", 0.04)
    lines = []
    with Effort(lines.append).audible() as spent:
        spent.say("fitting")
        part = spent.anew()
        part.spend(30)
        spent.spend(12)
        while len(lines) < 3:
            time.sleep(0.01)
    assert lines[0] == "fitting"
    assert lines[1].startswith("  still fitting: 42 simulations")
    assert (spent.simulations, part.simulations) == (12, 30)
    said = len(lines)
    time.sleep(0.1)
    assert len(lines) == said


def test_a_part_names_its_step_to_the_same_listener():
    lines = []
    with Effort(lines.append).audible() as spent:
        spent.anew().say("judging")
    assert lines == ["judging"]
