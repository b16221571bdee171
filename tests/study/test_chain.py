"""Each command that is printed leads on: what a task hands on is whole, and the chain of commands
ends.

The commands are read from the console as a person reads them there, and run. Where the next task
fits the model that the last one ended with, it gives the same grade.
"""

import json
import re
import shlex
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from command_line import run_command

LONGEST = 5  # steps, the first command counted
ADVICE = re.compile(r"(next|(use|see|investigate) [^:]*): ")
# fitted anew, it has the grade that the investigation told
EXTENDED = ("use the extended model", "see the extended model")
AS_BASE = "investigate it as the base model"


@dataclass
class Step:
    """A command that was run: what printed it, its grade and verdict ("" for none), and what it
    prints to go on.

    An investigation grades its base model, too.
    """

    command: tuple[str, ...]
    said: str
    above: "Step | None" = None
    grade: str = ""
    base_grade: str = ""
    verdict: str = ""
    next: list[tuple[str, tuple[str, ...]]] = field(default_factory=list)

    @property
    def depth(self) -> int:
        return 1 + (self.above.depth if self.above else 0)

    @property
    def line(self) -> "list[Step]":
        """From the first command to this one."""
        return [*(self.above.line if self.above else []), self]


def printed_commands(output: str) -> list[tuple[str, tuple[str, ...]]]:
    """What the console advises: (what the command does, its words), split as a shell
    splits them.
    """
    commands = []
    for line in output.splitlines():
        if ADVICE.match(line):
            said, *parts = line.split("tractexp ")
            for part in parts:
                lexer = shlex.shlex(part, posix=True, punctuation_chars=";")
                lexer.whitespace_split, words = True, []
                for word in lexer:
                    if word == ";":
                        break
                    words.append(word)
                commands.append((said, tuple(words)))
    return commands


def run_step(step: Step, folder: Path) -> None:
    """Run the command of a step, and read what it found and prints."""
    before = {*folder.glob("outputs/runs/*")}
    quiet = ["tracking.enabled=false"] if any("=" in word for word in step.command) else []
    # the screen has the first one only
    every = ["--all"] if any("=" in word for word in step.command) else []
    # a package is not overwritten: each is made in a folder of its own, as the refusal says
    here = Path(tempfile.mkdtemp(dir=folder)) if step.command[0] == "new" else folder
    done = run_command(*step.command, *quiet, *every, cwd=here)
    assert done.returncode == 0, f"{step.command}: {done.stderr}"
    step.next = printed_commands(done.stdout)
    # no wheel has it
    assert not [line for line in done.stdout.splitlines() if ADVICE.match(line) and "docs/" in line]
    for run in {*folder.glob("outputs/runs/*")} - before:
        if (run / "result.json").is_file():
            step.grade = json.loads((run / "result.json").read_text(encoding="utf-8"))["adequacy"][
                "grade"
            ]
        if (run / "discrepancy.json").is_file():
            content = json.loads((run / "discrepancy.json").read_text(encoding="utf-8"))
            step.verdict, step.base_grade = content["verdict"], content["base_adequacy"]["grade"]


def follow(command: str, folder: Path) -> list[Step]:
    """Run a command and all that it leads to, until nothing new is printed."""
    waiting, steps = [Step(tuple(shlex.split(command)[1:]), "")], []
    while waiting:
        step = waiting.pop(0)
        assert step.depth <= LONGEST, " -> ".join(shlex.join(one.command) for one in step.line)
        run_step(step, folder)
        steps.append(step)
        print(
            f"{'  ' * step.depth}{step.said}tractexp {shlex.join(step.command)}: {step.verdict}"
            f" {step.grade}"
        )
        known = {one.command for one in (*steps, *waiting)}
        for said, words in step.next:
            assert words not in {one.command for one in step.line}, f"a circle: {shlex.join(words)}"
            if words not in known:
                waiting.append(Step(words, said, step))
                known.add(words)
    return steps


def check_grades(steps: list[Step]) -> None:
    """The same model on the same records has the same grade, whichever task tells it."""
    for step in (one for one in steps if one.above):
        if step.said.startswith(EXTENDED):
            assert step.grade == step.above.grade, step
        of_a_fit = step.verdict and not step.above.verdict
        if step.said.startswith(AS_BASE) or (of_a_fit and not leads_elsewhere(step.command)):
            assert step.base_grade == step.above.grade, step


def leads_elsewhere(words: tuple[str, ...]) -> bool:
    """Whether a command changes the records, the domain or what is known of the parameters."""
    return any(word.startswith(("data=", "data.", "domain=", "model.physical=")) for word in words)


def test_commands_are_read_as_a_shell_reads_them():
    told = (
        "next: find what is missing: tractexp a 'b=c; d'; or choose another model: tractexp list"
        " model\nsays tractexp"
    )
    assert printed_commands(told) == [
        ("next: find what is missing: ", ("a", "b=c; d")),
        ("next: find what is missing: ", ("list", "model")),
    ]


@pytest.mark.parametrize(
    "command",
    [
        "tractexp task=discrepancy data=contactors"
        " 'task.effects=[undervoltage_trip,stator_resistance]'",
        pytest.param(
            "tractexp task=discrepancy data=tibet 'task.effects=[stator_transients]'",
            marks=pytest.mark.long,
        ),
    ],
    ids=["contactors", "tibet"],
)
def test_the_chain_of_a_shipped_record_ends(command, tmp_path):
    steps = follow(command, tmp_path)
    check_grades(steps)
    assert steps[0].verdict == "named"
    assert any(step.said.startswith(EXTENDED) for step in steps)


@pytest.mark.long  # ten minutes and more each: whoever changes what a task hands on runs them
@pytest.mark.parametrize("load", [1, 2])
def test_the_chain_of_a_station_ends(load, shared_data, tmp_path):
    record = shared_data / "dfr220kv-shandong" / "xtz.cfg"
    channels = {1: ("[0,1,2]", "[16,17,18]"), 2: ("[4,5,6]", "[8,9,10]")}[load]
    command = (
        f"tractexp task=discrepancy data=comtrade data.path={record} 'data.voltages={channels[0]}'"
        f" 'data.currents={channels[1]}' 'data.train=[1]' 'data.validate=[2]'"
    )
    check_grades(follow(command, tmp_path))


@pytest.mark.long
def test_the_chain_of_another_simulator_ends(shared_data, tmp_path):
    cases = shared_data.parent / "cases" / "andes"
    if not (cases / "dip_a.csv").is_file():
        pytest.skip("needs ../shared/cases/andes")
    files = {name: cases / f"dip_{name}.csv" for name in "abc"}
    command = (
        f"tractexp task=discrepancy data=csv 'data.train=[{files['a']},{files['b']}]'"
        f" 'data.validate=[{files['c']}]'"
        " data.frequency=60"
    )
    check_grades(follow(command, tmp_path))
