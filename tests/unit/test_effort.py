"""What an investigation says while it works, `Effort`: each step, and that a long one goes on."""

import re
import time

from tractexp.inference import effort
from tractexp.inference.effort import Effort


def test_a_long_step_is_not_silent(monkeypatch):
    monkeypatch.setattr(effort, "SILENCE", 0.04)
    lines = []
    with Effort(lines.append).tell_when_silent() as spent:
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
    with Effort(lines.append).tell_when_silent() as spent:
        spent.anew().say("judging")
    assert lines == ["judging"]


def test_a_long_step_says_how_many_parts_and_how_long_they_take_but_no_time_spent(monkeypatch):
    monkeypatch.setattr(effort, "SILENCE", 0.04)
    lines = []
    with Effort(lines.append).tell_when_silent() as spent:
        spent.say("fitting")
        with spent.anew().parts(4) as ended, spent.parts(9):  # a part of a part
            ended()
            while len(lines) < 3:
                time.sleep(0.01)
        said = len(lines)
        while len(lines) <= said:
            time.sleep(0.01)
    assert re.fullmatch(r"  still fitting: 1 of 4, about \d+ s left", lines[2])
    assert lines[-1] == "  still fitting"


def test_one_part_alone_says_nothing(monkeypatch):
    monkeypatch.setattr(effort, "SILENCE", 0.04)
    lines = []
    with Effort(lines.append).tell_when_silent() as spent:
        spent.say("fitting")
        with spent.parts(1), spent.parts(5) as ended:
            ended()
            while len(lines) < 2:
                time.sleep(0.01)
    assert re.fullmatch(r"  still fitting: 1 of 5, about \d+ s left", lines[1])
