"""The first screen of a command: 25 lines of 80 characters, the answer first; all else by --all."""

import dataclasses
import io
from contextlib import nullcontext

import pytest
from command_line import run_command
from rich.cells import cell_len
from rich.console import Console
from screens import LINES, WIDTH, count_rows
from test_export import identified

import tractexp
from tractexp.api.identification import Identification
from tractexp.blocks import Table
from tractexp.blocks.block import Report
from tractexp.blocks.terminal import fold, show
from tractexp.report.screen import tabulate_parameters
from tractexp.text.wording import shorten

EXACT = ("optimizer=multistart_least_squares", "optimizer.starts=2", "tracking.enabled=false")


def print_at(report, width):
    """The lines of a report on a console of so many characters, broken where the console breaks
    them.
    """
    out = io.StringIO()
    console = Console(file=out, width=width, highlight=False, soft_wrap=True, color_system=None)
    show(report, console, width)
    return count_rows(out.getvalue(), width)


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """The command of the README on a terminal of 80 columns, as it is and with --all."""
    folder = tmp_path_factory.mktemp("screen")
    command = ("data=tibet_50pct", *EXACT)
    short = run_command(*command, cwd=folder, COLUMNS=str(WIDTH))
    every = run_command(*command, "--all", cwd=folder)
    return short, every


def test_the_answer_of_an_identification_is_one_screen(printed):
    short, every = printed
    assert (short.returncode, every.returncode) == (0, 0)
    rows = count_rows(short.stdout, WIDTH)
    assert len(rows) <= LINES - 1, "\n".join(rows)  # one more is the line of the log
    assert rows[0].startswith("load: U 0.9998 pu, P 0.9995 pu, Q 0.7005 pu, S 1.221 pu, ")
    assert "tibet_50pct" in rows[0]
    assert any(row.startswith("doubtful: the model describes this load within") for row in rows)
    assert next(row.split()[0] for row in rows if row.split()[-1:] == ["yes"]) == "T_prime"
    assert short.stdout.count("next: ") == 1
    assert "report.html" in short.stdout
    for part in (
        "fit: tibet_50pct",
        "Runge-Kutta",
        "acceptance of Eq. (20)",
        "epsilon_p",
        "correlations",
    ):
        assert (part in short.stdout, part in every.stdout) == (False, True), part
    assert "synthetic stand-in" in every.stdout


def test_a_log_file_has_the_answer_and_no_line_that_something_still_goes_on(printed):
    short, every = printed
    for done in (short, every):
        assert "still" not in done.stdout + done.stderr
        # a slow machine tells how far it is
        assert all(line.startswith("  ") for line in done.stderr.splitlines()), done.stderr


def fitted(**changes):
    """A load from the field: named by its file, in MW, of many parameters with wide intervals."""
    result = identified().result
    names = [*result.parameters]
    source = {"station": "牵引变电所 Nord-West", "load": "Feeder 12 / T1 catenary side"}
    own = {
        "own_base": {"power": 29.7, "file_power": 100.0, "in_mva": True, "origin": "file"},
        "records": [{"source": source, "base": {"voltage_kV": 27.5, "power_MVA": 100.0}}],
        "verdicts": dict.fromkeys(names, "not identifiable from this record: it moves with T_m"),
        "intervals": {name: [0.0012345, 0.0098765] for name in names},
        "standard_errors": dict.fromkeys(names, 0.00123),
        "adequacy": {"grade": "wrong_model", "sentence": "the model leaves much, " * 20, "p": 0.0},
        "advice": ["find what is missing: tractexp task=discrepancy data.path='a file.cfg'"],
        "model_error": {
            "value": 0.35,
            "interval": [0.3, 0.4],
            "of_S": 0.1,
            "held_out": {"value": 0.4, "interval": [0.3, 0.5], "of_S": 0.1},
        },
    }
    return Identification(dataclasses.replace(result, **own | changes))


def test_a_load_of_the_field_is_named_with_its_size_and_why_it_is_unusable():
    rows = print_at(fitted().screen(), WIDTH)
    assert len(rows) <= LINES - 3, "\n".join(rows)
    assert "Nord-West, Feeder 12 / T1 catenary side" in rows[0]
    told = " ".join(rows)
    assert "kV" in told
    assert "MW" in told
    assert "Mvar" in told
    assert "unusable: the model leaves much" in told
    assert "fitted 35 % (30 % to 40 %), held out 40 % (30 % to 50 %)" in " ".join(told.split())


@pytest.mark.parametrize(
    ("grade", "word"),
    [("adequate", "usable"), ("effect_missing", "doubtful"), ("wrong_model", "unusable")],
)
def test_the_grade_says_whether_the_model_may_be_used(grade, word):
    adequacy = {"grade": grade, "sentence": "so", "p": 0.5}
    sound = fitted(adequacy=adequacy, verdicts={})
    assert sound.usability == word
    with pytest.raises(tractexp.errors.UserError) if word == "unusable" else nullcontext():
        tractexp.export(sound, "andes", playback=False)


def test_a_value_that_a_bound_holds_is_why_a_model_that_fits_is_unusable():
    adequacy = {"grade": "adequate", "sentence": "noise alone leaves as much", "p": 0.5}
    fit = fitted(adequacy=adequacy, verdicts={"T_m": "at its bound: 1"})
    told = " ".join(" ".join(print_at(fit.screen(), WIDTH)).split())
    assert "unusable: T_m is held by a bound alone; noise alone leaves as much." in told


def test_names_that_are_long_leave_each_parameter_a_line():
    names = ["branch_resistance", "T_prime_second", "M", "C", "X_prime"]
    verdicts = [
        "weakly identified: it trades",
        "not identifiable from this record",
        "identified",
        "at its bound: 0.85",
        "at the end of what machines have: 0.08",
    ]
    fit = fitted(
        parameters=dict.fromkeys(names, 0.0123456),
        standard_errors=dict.fromkeys(names, 0.000123),
        intervals={name: [0.0012345, 0.0098765] for name in names},
        verdicts=dict(zip(names, verdicts, strict=True)),
        units=dict.fromkeys(names, "pu s²/rad"),
    )
    fit.__dict__["operating_point"] = None
    rows = print_at(Report().add(tabulate_parameters(fit)), WIDTH)
    assert [row.split()[-1] for row in rows[2:]] == ["weakly", "no", "yes", "bound", "end"]
    assert len(rows) == 2 + len(names)


def test_at_sixty_columns_each_parameter_is_a_line():
    narrow, out = 60, io.StringIO()
    console = Console(file=out, width=narrow, highlight=False, soft_wrap=True, color_system=None)
    show(fitted().screen(), console, narrow)
    lines = out.getvalue().splitlines()
    assert max(map(cell_len, lines)) <= narrow
    names = [*fitted().result.parameters]
    head = lines.index("parameter: value ± std. error, unit, 95 % interval, known")
    assert [line.partition(":")[0] for line in lines[head + 1 :][: len(names)]] == names
    assert len(lines) <= LINES - 1
    assert not any(len(line.split()) == 1 and len(line.strip()) < 2 for line in lines if line)


def test_a_narrow_console_gets_a_sentence_for_each_row():
    table = Table(["parameter", "value", "verdict"], [["T_prime", 0.12345, "identified"]])
    wide, narrow = print_at(Report().add(table), 60), print_at(Report().add(table), 24)
    assert len(wide) == 3
    assert narrow == ["parameter: value,", "  verdict", "T_prime: 0.12345,", "  identified"]


def test_a_sentence_is_folded_at_words_and_its_command_stays_whole():
    command = "tractexp task=discrepancy data.path='a b.cfg' data.train=[1]"
    assert fold(f"next: find it: {command}", 30) == ["next: find it:", f"  {command}"]
    two = f"next: find it: {command}; or look: tractexp list model; or wait"
    assert fold(two, 30) == [
        "next: find it:",
        f"  {command}",
        "  or look:",
        "  tractexp list model",
        "  or wait",
    ]
    assert fold("one two three", 7) == ["one two", "  three"]
    assert fold("one two three", None) == ["one two three"]
    # a character that takes the place of two
    assert fold("站站站 站站", 8) == ["站站站", "  站站"]


def test_a_sentence_is_cut_at_a_clause():
    assert shorten("one, two, three, four", 20) == "one, two, three ..."
    assert shorten("short", 20) == "short"
