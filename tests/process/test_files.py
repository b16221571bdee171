"""The one door through which files are written: whole or not at all, results before what is drawn
from them.
"""

import ast
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import tractexp
from tractexp.errors import UserError
from tractexp.storage import files, locks

ROOT = Path(__file__).parents[2]
DOOR = {ROOT / "tractexp" / "storage" / f"{name}.py" for name in ("files", "locks", "yaml_files")}
WRITERS = {  # calls that make or change a file, whatever they are called on
    "write_text",
    "write_bytes",
    "mkstemp",
    "NamedTemporaryFile",
    "fdopen",
    "copyfile",
    "copy2",
    "savez",
    "savez_compressed",
    "tofile",
    "symlink_to",
    "hardlink_to",
    "touch",
    "copytree",
}
WRITING = {"replace", "rename", "link", "symlink", "truncate"}  # of `os`
IN_MEMORY = {"savez_compressed"}  # into a buffer, which is then written
MODES = set("wax+")


def calls(path: Path) -> Iterator[tuple[ast.Call, str, str]]:
    """The calls of a module: each, the name that is called, and what it is called on ("" for
    nothing).
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            yield node, node.func.attr, ast.unparse(node.func.value)
        elif isinstance(node, ast.Call):
            yield node, getattr(node.func, "id", ""), ""


def find_writing_calls(path: Path) -> set[str]:
    """The calls of a module that write a file."""
    found = set()
    for node, name, owner in calls(path):
        given = [
            a.value
            for a in (*node.args, *(k.value for k in node.keywords if k.arg == "mode"))
            if isinstance(a, ast.Constant) and isinstance(a.value, str)
        ]
        opens = name == "open" and any(
            set(mode) <= set("rwaxbt+") and set(mode) & MODES for mode in given
        )
        into = ast.unparse(node.args[0]) if node.args else ""
        buffer = name in IN_MEMORY and into in ("packed", "made", "written", "drawn", "text")
        if opens or (name in WRITERS and not buffer) or (owner == "os" and name in WRITING):
            found.add(f"{path.relative_to(ROOT)}:{node.lineno} {ast.unparse(node)[:80]}")
    return found


def test_nothing_but_the_one_door_opens_a_file_to_write():
    """But the program that ANDES's own process runs, in a folder that goes with it."""
    others = {*DOOR, ROOT / "plugins" / "formats" / "_andes_run.py"}
    sources = [
        p
        for folder in ("tractexp", "plugins")
        for p in sorted((ROOT / folder).rglob("*.py"))
        if p not in others
    ]
    assert len(sources) > 200
    assert set().union(*map(find_writing_calls, sources)) == set()
    assert (
        len(set().union(*map(find_writing_calls, DOOR))) >= 6
    )  # what is looked for is found where it is


@pytest.mark.parametrize(
    "line",
    [
        "open(p, 'w')",
        "p.open('ab+')",
        "p.write_text(t)",
        "os.replace(a, b)",
        "np.savez(p, a)",
        "shutil.copy2(a, b)",
    ],
)
def test_the_door_is_missed_by_none_of_these(line, tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    (tmp_path / "a.py").write_text(line)
    assert len(find_writing_calls(tmp_path / "a.py")) == 1


def test_a_run_opens_files_to_write_by_the_door_only(tmp_path):
    """Seen by the interpreter itself, whatever a library does on our behalf."""
    script = """
import os, sys, traceback
opened = set()
def heard(event, told):
    writes = event == "open" and isinstance(told[2], int) and told[2] & (os.O_WRONLY | os.O_RDWR)
    if writes and sys.argv[1] in str(told[0]):
        frames = [f.filename for f in traceback.extract_stack()]
        ours = any(name.endswith("tractexp/storage/files.py") for name in frames)
        opened.add((os.path.basename(str(told[0])), ours))
import tractexp
motor = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55}
motor |= {"p_v": 1.4, "q_v": 3.0}
made = tractexp.simulate(values=motor, depth=0.3, rate=100, length=1)
sys.addaudithook(heard)
made.write(sys.argv[1])
print(sorted(told for told in opened if not told[1]), len(opened))
"""
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    others, count = done.stdout.rsplit(maxsplit=1)
    assert others == "[]"
    assert int(count) >= 2


def test_a_write_that_fails_leaves_the_old_file_and_no_half(tmp_path, monkeypatch):
    path = files.write(tmp_path / "a.txt", "old")

    def full(*_):
        raise OSError(28, "No space left on device")

    for call in ("fsync", "replace"):
        monkeypatch.setattr(files.os, call, full)
        with pytest.raises(UserError, match=r"a\.txt cannot be written: No space left on device"):
            files.write(path, "new")
        monkeypatch.undo()
        assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
        assert path.read_text() == "old"


def test_a_process_killed_while_it_writes_leaves_the_old_file(tmp_path):
    path = files.write(tmp_path / "a.txt", "old")
    script = """
import os, sys; from tractexp.storage import files, locks
os.replace = lambda *_: os._exit(9)
files.write(sys.argv[1], 'new')"""
    assert subprocess.run([sys.executable, "-c", script, str(path)]).returncode == 9
    assert path.read_text() == "old"
    (half,) = [p for p in tmp_path.iterdir() if p != path]
    assert files.find_leftovers(tmp_path) == []  # it may be one that is being written
    os.utime(half, (0, 0))
    for name in (
        "movie.mkv.part",
        ".part",
        ".a.txt.part",
        "a.tractexp.part",
        ".a.txt.12345678.part",
    ):
        os.utime(files.write(tmp_path / name, "somebody's"), (0, 0))
    (tmp_path / ".a.txt.12345678.tractexp.part").symlink_to(path)
    assert files.find_leftovers(tmp_path) == [half]


def test_what_must_last_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(files.os, "fsync", lambda handle: told.append(os.fstat(handle).st_mode))
    replace = os.replace
    monkeypatch.setattr(files.os, "replace", lambda *paths: (told.append("named"), replace(*paths)))
    files.write(tmp_path / "a.txt", "x")
    assert [told.index("named"), len(told)] == [1, 3]  # the file, its name, the folder
    told.clear()
    files.write(tmp_path / "b.txt", "x", lasting=False)
    assert told == ["named"]


def test_a_full_disk_is_nothing_for_what_is_printed(tmp_path):
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("there is no /dev/full here")
    (tmp_path / "said").symlink_to(full)
    with files.Transcript(tmp_path / "said") as said:
        assert said.write("words\n") == 6
        said.flush()


def test_a_lock_is_waited_for_no_longer_than_told(tmp_path):
    script = """
import sys, time; from pathlib import Path; from tractexp.storage import files, locks
with locks.lock_file(Path(sys.argv[1]), 1):
    print("held", flush=True); time.sleep(60)"""
    holder = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "lock")], stdout=-1, text=True
    )
    try:
        assert holder.stdout.readline() == "held\n"
        with (
            pytest.raises(TimeoutError, match=r"another process has held .*lock"),
            locks.lock_file(tmp_path / "lock", 0.2),
        ):
            pass
    finally:
        holder.kill()
        holder.communicate()
    started = time.monotonic()
    with locks.lock_file(tmp_path / "lock", 5):
        assert time.monotonic() - started < 1  # one that dies lets go of it


@pytest.fixture(scope="module")
def simulated():
    motor = {
        "T_prime": 0.12,
        "X_prime": 0.25,
        "C": 0.9,
        "M": 0.006,
        "T_m": 0.55,
        "p_v": 1.4,
        "q_v": 3.0,
    }
    return tractexp.simulate(values=motor, depth=0.3, rate=100, length=1)


def test_a_figure_that_fails_is_a_sentence_and_the_results_stand(
    simulated, tmp_path, monkeypatch, capsys
):
    from tractexp.report import figures

    def fails(*_, **__):
        raise RuntimeError("the third pen is dry")

    monkeypatch.setattr(figures, "draw_response", fails)
    assert [path.name for path in simulated.write(tmp_path)] == ["response.csv"]
    assert (
        "response.svg could not be made, while the results are whole (RuntimeError: the third pen"
        " is dry)" in (" ".join(capsys.readouterr().out.split()))
    )


def test_a_name_that_would_be_a_formula_is_written_as_it_is(simulated, tmp_path):
    from dataclasses import replace

    (one,) = simulated.responses
    drawn = (
        replace(one, title=r"$\frac{$", notes=(r"$\sqrt{$",)).draw(tmp_path / "a.svg").read_text()
    )
    assert r"$\frac{$" in drawn
    assert r"$\sqrt{$" in drawn


def test_a_disk_that_is_full_for_pages_keeps_the_finished_search(tmp_path):
    """A page is larger than a result: files may have 300 kB here, as where so much is left."""
    (tmp_path / "dip.csv").write_text(dip())
    command = [sys.executable, "-m", "tractexp", "data=csv", "data.train=[dip.csv]"]
    command += [
        "optimizer=multistart_least_squares",
        "budget=300",
        "hydra.run.dir=run",
        "tracking.enabled=false",
    ]

    def narrow():
        import signal

        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))

    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, preexec_fn=narrow)
    assert done.returncode == 0, done.stderr
    assert "note: report.html could not be made, while the results are whole" in done.stdout
    assert "File too large" in done.stdout
    assert json.loads((tmp_path / "run" / "result.json").read_text())["simulations"] >= 300
    assert {p.name for p in (tmp_path / "run").iterdir()} == {
        ".hydra",
        "result.json",
        "history.csv",
    }


def dip() -> str:
    motor = {
        "T_prime": 0.12,
        "X_prime": 0.25,
        "C": 0.9,
        "M": 0.006,
        "T_m": 0.55,
        "p_v": 1.4,
        "q_v": 3.0,
    }
    made = tractexp.simulate(values=motor, depth=0.4, rate=200, length=2).responses[0]
    return made.to_frame().to_csv(index=False)


# What is read


READERS = {  # calls that read a file, or make something of a text that a file held
    "read_text",
    "read_bytes",
    "open",
    "loadtxt",
    "genfromtxt",
    "fromfile",
    "memmap",
    "fdopen",
}
PARSERS = {
    "yaml": {"load", "safe_load", "load_all", "full_load", "unsafe_load"},
    "json": {"load", "loads"},
    "np": {"load"},
    "pickle": {"load", "loads"},
    "OmegaConf": {"load"},
}
# {module: {call: why it may}}; all else that is read goes through the door
READ = {
    "tractexp/configuration/choices.py": {
        "read_text": "installed files",
        "yaml.safe_load": "installed files",
        "read_bytes": "code",
    },
    "tractexp/cli/look.py": {"yaml.safe_load": "a setting as it was typed"},
    "tractexp/cli/new/__init__.py": {"read_text": "an installed file"},
    "tractexp/configuration/composition.py": {
        "read_text": "installed files",
        "yaml.safe_load": "installed files",
    },
    "tractexp/blocks/plotly.py": {
        "read_text": "an installed file",
        "read_bytes": "installed files",
    },
    "tractexp/cache/texts.py": {"read_bytes": "code"},
    "tractexp/cache/provenance.py": {"read_bytes": "code"},
    "tractexp/model/model.py": {"json.loads": "the store, whose entries are its own"},
    "tractexp/kernel/kernel.py": {"json.loads": "the store"},
    "tractexp/cache/store.py": {
        "np.load": "the store; nothing is unpickled",
        "json.loads": "entries with their sums",
    },
    "tractexp/sweep/hydra_groups.py": {"json.loads": "the store"},
    "tractexp/studies/search_store.py": {"json.loads": "the store"},
    "tractexp/sweep/job.py": {"json.loads": "its own text"},
    "tractexp/sweep/elsewhere.py": {"read_bytes": "a folder that it made for its own job"},
    "tractexp/tracking/store.py": {"read_bytes": "a database that it made"},
    "tractexp/identification/result.py": {"loadtxt": "a text that `files` has read"},
    "tractexp/studies/comparison/load.py": {"json.loads": "a parameter"},
    "tractexp/filetypes/comtrade_samples.py": {
        "memmap": "numbers of a file that `files` has found to be ordinary"
    },
    "tractexp/storage/zip_archive.py": {"open": "files within an archive, for `files` alone"},
    "tractexp/filetypes/table_text.py": {"loadtxt": "a text that `files` has read"},
    "tractexp/filetypes/reading_process.py": {"pickle.load": "the process that it started"},
    "tractexp/tracking/owner.py": {"read_text": "the system's own files"},
    "tractexp/tracking/process.py": {
        "pickle.load": "the process that started it",
        "pickle.loads": "that it started",
    },
    "plugins/formats/_andes_run.py": {"json.load": "the process that started it"},
    "plugins/formats/load_json.py": {"json.loads": "its own text"},
    "plugins/formats/andes.py": {
        "json.loads": "its own text",
        "read_text": "its own code",
        "np.load": "its own file",
    },
}


def find_reading_calls(path: Path) -> set[str]:
    """The calls of a module that read."""
    found = set()
    for _, name, owner in calls(path):
        if name in PARSERS.get(owner, ()):
            found.add(f"{owner}.{name}")
        elif (
            name in READERS
            and owner not in ("files", "webbrowser", "process", "self")
            and not owner.startswith("self")
        ):
            found.add(name)
    return found


def test_one_door_reads_what_others_may_have_written():
    """`files.py`, `locks.py` and `yaml_files.py` of `tractexp/storage`: they wait for no pipe, end
    at a size, and count what aliases come to.
    """
    sources = {p for place in ("tractexp", "plugins") for p in (ROOT / place).rglob("*.py")} - DOOR
    found = {
        str(path.relative_to(ROOT)): names
        for path in sources
        if (names := find_reading_calls(path))
    }
    assert found == {name: set(calls) for name, calls in READ.items()}
