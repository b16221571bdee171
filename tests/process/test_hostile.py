"""Inputs that nobody should give, over every command that takes a file or a folder: it works, or
one sentence says why.

`hostile.INPUTS` is the list. Nothing raises, warns, hangs, prints an escape of others, or leaves
half a file.
"""

import contextlib
import os
import re
import shutil
import signal
import warnings

import hostile
import pytest
from command_line import run_command

if os.name == "nt":
    pytest.skip("named pipes, sockets and names that are no text are made", allow_module_level=True)

SECONDS = 20  # of one command, at most
PLAIN = ("tracking.enabled=false", "hydra.run.dir=run")
QUICK = ("optimizer=random_search", "budget=10", *PLAIN)
# cells far away, which take gigabytes, are looked at in unit/test_reading_process.py
BOOKS = ("zip.xlsx", "book.xlsx", "escapes.xlsx", "pipe.xlsx", ".xls", ".ods", ".parquet")
# of the texts that `look` is given all: what a fit meets, a page draws, or a console prints
FITTED = (
    *("pipe.csv", "nowhere.csv", "[red]markup[@click=].csv", "line\nbreak.csv"),
    *("escaped_names.csv", "escaped_cell.csv", "beside_infinite.csv", "zeros.csv", "one_row.csv"),
    *(
        "power.csv",
        "voltage.csv",
        "number.csv",
        "seconds.csv",
        "time.csv",
        "times.csv",
        "years.csv",
    ),
)
FEW_BOOKS = ("cut.parquet", "empty_zip.xlsx")  # of those that `look` is given all
# of those that `simulate` is given all: not to be read, incomplete, not to be simulated
RESULTS = ("deep.json", "missing.json", "outside.json", "list_model.json", "no_before.json")
# {name: how the names of the files begin or end that it is for, the arguments for one}
COMMANDS = {
    "look": (
        (*BOOKS, ".csv", ".cfg", ".cff", ".dat", ".cev", ".json"),
        lambda name: ("look", f"./{name}"),
    ),
    "identify": (
        FITTED,
        lambda name: ("data=csv", f"data.train=[{name}]", *QUICK),
    ),
    "path": (FEW_BOOKS, lambda name: ("data=csv", f"data.path={name}", *QUICK)),
    "waveforms": (
        ("waves_", *FEW_BOOKS),
        lambda name: ("data=waveforms", f"data.path={name}", *QUICK),
    ),
    "comtrade": (
        (".cfg", ".cff", ".dat"),
        lambda name: ("data=comtrade", f"data.path={name}", *QUICK),
    ),
    "sel": ((".cev", "r.cfg"), lambda name: ("data=sel", f"data.path={name}", *QUICK)),
    "archive": (
        ("r.csv", *FEW_BOOKS),
        lambda name: ("data=archive", "data.path=.", f"data.train=[{name}]", *QUICK),
    ),
    "convert": (
        ("waves_", ".cfg", *FEW_BOOKS),
        lambda name: ("task=convert", f"data.path={name}", *PLAIN),
    ),
    "simulate": ((".json",), lambda name: ("task=simulate", f"task.parameters={name}", *PLAIN)),
    "export": (RESULTS, lambda name: ("task=export", f"task.parameters={name}", *PLAIN)),
    "rivals": (RESULTS, lambda name: ("task=plan", f"task.rivals={name}", *PLAIN)),
    "values": (RESULTS, lambda name: ("task=plan", f"task.values={name}", *PLAIN)),
}
FOLDERS = {
    "survey": (
        "task=survey",
        "data.path=.",
        "task.cores=1",
        "tracking.enabled=false",
        "hydra.run.dir=../run",
    ),
    "sync": ("sync", "."),
    "doctor": ("doctor", "."),
}
ESCAPES = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]")
NUMBERS = re.compile(r"(?<![\w.])-?(inf|nan) ?(%|pu)", re.IGNORECASE)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("hostile")


@pytest.fixture(scope="module")
def inputs(place):
    return hostile.made(place)


@contextlib.contextmanager
def limited():
    """Raise `TimeoutError` for what takes too long, and every warning."""

    def late(*_):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # which is what is to be said
            warnings.filterwarnings("ignore", ".* is outside its bounds", UserWarning)
            yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def wrong(done) -> str:
    """What is wrong with how a command ended; "" for nothing."""
    said = done.stdout + done.stderr
    if ESCAPES.search(said) or NUMBERS.search(said):
        return f"it printed {said!r}"
    if done.returncode == 0:
        return "" if "Traceback" not in said else said
    one = re.fullmatch(r"tractexp: [^\n]+\n", done.stderr)
    return (
        ""
        if done.returncode == 2 and one and "its own mistake" not in said
        else said or str(done.returncode)
    )


def outcome(*arguments, cwd) -> str:
    """What is wrong with a command, in words; "" for nothing."""
    try:
        with limited():
            return wrong(run_command(*arguments, cwd=cwd))
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        for made in ("run", "outputs"):
            shutil.rmtree(cwd / made, ignore_errors=True)


@pytest.mark.parametrize("command", COMMANDS)
def test_it_works_or_one_sentence_says_why(command, inputs):
    endings, arguments = COMMANDS[command]
    chosen = {
        name: path
        for name, path in inputs.items()
        if name.endswith(endings) or name.startswith(endings)
    }
    assert chosen
    found = {name: outcome(*arguments(name), cwd=path.parent) for name, path in chosen.items()}
    assert {name: why for name, why in found.items() if why} == {}


@pytest.mark.parametrize("command", FOLDERS)
def test_a_folder_of_them_is_gone_through(command, inputs, place):
    assert outcome(*FOLDERS[command], cwd=place) == ""
