"""What is kept on disk and executed later: only what was written there whole, in a folder of the user's own."""

import os
import pickle
import stat
import subprocess
import sys
import types
from pathlib import Path

import pytest

from tractexp.errors import UserError
from tractexp.model import cache, kernel

WITHOUT_OWNERS = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="folders have no owner in this system")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder chosen for the cache."""
    monkeypatch.setenv(cache.CHOICE, str(tmp_path / "cache"))
    return cache.cache_folder()


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home whose cache folder is the usual one; what is set while a test runs is taken back."""
    monkeypatch.setenv(cache.CHOICE, "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return tmp_path / "home" / "tractexp"


class Part:
    """A part of a model, whose code stands in a file."""

    def __repr__(self):
        return "Part()"


class Nameless:
    """A part whose `repr` is Python's own: it tells where it lies, not what it is set to."""


class Planted:
    """A pickle that leaves a mark where it is loaded."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


# what is read


def test_a_kept_file_is_read_as_it_was_written(folder):
    cache.write(folder / "one.kept", b"content")
    assert cache.read(folder / "one.kept") == b"content"
    assert [p.name for p in folder.iterdir()] == ["one.kept"]


@pytest.mark.parametrize(
    "damage",
    [
        *(lambda b, k=k: b[:k] + bytes([b[k] ^ 1]) + b[k + 1 :] for k in (0, cache.SUM - 1, cache.SUM, -2)),
        lambda b: b[:-1],
        lambda b: b + b"\0",
        lambda b: b[: cache.SUM],
        lambda b: b[cache.SUM :],
        lambda b: b"",
    ],
)
def test_a_damaged_file_is_none(folder, damage):
    cache.write(path := folder / "one.kept", b"content of a file")
    path.write_bytes(damage(path.read_bytes()))
    assert cache.read(path) is None


def test_a_sound_file_in_the_place_of_another_is_none(folder):
    cache.write(folder / "one.kept", b"content")
    os.replace(folder / "one.kept", folder / "two.kept")
    assert cache.read(folder / "two.kept") is None
    (folder / "three.kept").mkdir()
    assert cache.read(folder / "three.kept") is None
    cache.write(folder / "three.kept", b"content")  # cannot, and says nothing: it is made again next time
    assert not list(folder.glob("*.part"))


def test_a_planted_pickle_is_not_run_and_the_file_heals(folder, tmp_path):
    """Numba's own cache unpickles whatever lies there; so did ours."""
    from numba import njit

    def twice(x):
        return 2 * x

    def called(x):
        function = kernel._keep(njit(twice), "made")
        return function(x), sum(function.stats.cache_hits.values())

    assert called(3.0) == (6.0, 0)
    assert called(3.0) == (6.0, 1)
    (file,) = folder.iterdir()
    sound = file.read_bytes()
    for planted in (pickle.dumps(Planted(tmp_path / "mark")), sound[: cache.SUM] + pickle.dumps(Planted(tmp_path))):
        file.write_bytes(planted)
        assert called(3.0) == (6.0, 0)
        assert called(3.0) == (6.0, 1)
    file.write_bytes(sound.replace(sound[-40:-38], b"\xff\xff"))
    assert called(3.0) == (6.0, 0)
    assert not (tmp_path / "mark").exists()
    pickle.loads(pickle.dumps(Planted(tmp_path / "mark")))
    assert (tmp_path / "mark").exists()  # it does run where nobody looks


def test_code_for_another_machine_or_of_another_source_is_another_file(folder, monkeypatch):
    from numba import njit

    from tractexp.doors import numba_cache

    def made(name, text):
        module = types.ModuleType(f"made_{name}")
        monkeypatch.setitem(sys.modules, module.__name__, module)
        exec(text, vars(module))
        kernel._keep(njit(module.f), name)(1.0)
        return len(list(folder.iterdir()))

    assert made("a", "def f(x):\n    return x") == 1
    assert made("a", "def f(x):\n    return x") == 1
    assert made("b", "def f(x):\n    return x") == 2
    assert made("a", "def f(x):\n    return -x") == 3
    monkeypatch.setattr(numba_cache, "machine", lambda: "another")
    assert made("a", "def f(x):\n    return x") == 4


def test_a_file_of_a_package_that_has_another_name_now_is_compiled_anew(folder, tmp_path):
    """What is kept looks its names up in the module that it was compiled in."""
    text = "from numba import njit\nfrom tractexp.extend import kept\n\n@kept\n@njit\ndef f(x):\n    return 2 * x\n"
    for name in ("of_old", "renamed"):
        package = tmp_path / name
        package.mkdir()
        (package / "__init__.py").touch()
        (package / "loops.py").write_text(text)
        ask = [sys.executable, "-c", f"from {name}.loops import f; print(f(1.5))"]
        ran = subprocess.run(ask, cwd=tmp_path, capture_output=True, text=True)
        assert ran.stdout.strip() == "3.0", ran.stderr
        (package / "loops.py").unlink()


def test_a_changed_digit_in_a_source_is_not_executed(folder):
    """The text that people may read is never what runs; the text that is remembered is looked at."""
    source = "TORQUE = 0.55\n"
    for _ in range(2):
        loaded = kernel.load.__wrapped__(source)
        assert loaded.TORQUE == 0.55
        file = Path(loaded.__file__)
        assert file.read_text() == source
        assert file.parent == folder
        file.write_text(source.replace("5", "6"))
    made = []
    for _ in range(2):
        assert kernel.remembered((Part(),), lambda: made.append(1) or source) == source
        (text,) = folder.glob("source_*.kept")
        text.write_bytes(text.read_bytes().replace(b"0.55", b"0.66"))
    assert len(made) == 2


@pytest.mark.parametrize("parts", [(Nameless(),), (Part(), Nameless())])
def test_nothing_is_remembered_of_a_part_known_by_its_address(folder, parts):
    """Another part at the same address once got the equations of the first."""
    made = []
    for _ in range(2):
        kernel.remembered(parts, lambda: made.append(1) or "text")
    assert len(made) == 2
    assert not list(folder.glob("source_*"))


def test_a_kernel_whose_file_is_damaged_is_compiled_with_the_others(folder, monkeypatch):
    compiled = []
    monkeypatch.setattr(kernel, "_for_this_machine", lambda source: source)
    monkeypatch.setattr("joblib.Parallel", lambda n_jobs: lambda tasks: compiled.extend(t[1][0] for t in tasks))
    from tractexp.doors.numba_cache import machine

    for source in ("one", "two"):
        cache.write(folder / f"{kernel._name(source)}.run.{machine()}.x.kept", b"code")
    kernel.compile_missing(["one", "two", "three"])
    (damaged,) = folder.glob(f"{kernel._name('two')}*")
    damaged.write_bytes(b"code")
    kernel.compile_missing(["one", "two", "three"])
    assert compiled == ["three", "two", "three"]


# where it is kept


@WITHOUT_OWNERS
def test_a_new_folder_is_closed_to_others_whatever_the_umask(home):
    before = os.umask(0)
    try:
        assert cache.cache_folder() == home
    finally:
        os.umask(before)
    assert stat.S_IMODE(home.stat().st_mode) == 0o700


@WITHOUT_OWNERS
def test_a_folder_of_an_older_version_is_closed_to_others(home):
    home.mkdir(parents=True)
    home.chmod(0o755)
    assert cache.cache_folder() == home
    assert stat.S_IMODE(home.stat().st_mode) == 0o700


def foreign(folder, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)
    return "it belongs to another user"


def open_to_all(folder, monkeypatch):
    folder.chmod(0o777)
    return "other users can write to it"


def open_to_a_group(folder, monkeypatch):
    folder.chmod(0o770)
    return "other users can write to it"


def within_reach(folder, monkeypatch):
    folder.parent.chmod(0o777)
    return "every user can put another in its place"


def no_folder(folder, monkeypatch):
    folder.rmdir()
    folder.write_text("a file")
    return "it cannot be made or looked at (File exists)"


def read_only(folder, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.W_OK)  # root may write anywhere
    return "it cannot be written to"


FAULTS = [foreign, open_to_all, open_to_a_group, within_reach, no_folder, read_only]


@WITHOUT_OWNERS
@pytest.mark.parametrize("fault", FAULTS)
def test_a_chosen_folder_that_is_not_the_users_own_is_refused(folder, monkeypatch, fault):
    folder.parent.chmod(0o700)
    reason = fault(folder, monkeypatch)
    with pytest.raises(UserError) as refused:
        cache.cache_folder()
    assert f"TRACTEXP_CACHE_DIR={folder} cannot keep kernels: {reason}" in str(refused.value)
    assert "choose a folder of your own" in str(refused.value)


@WITHOUT_OWNERS
@pytest.mark.parametrize("fault", [open_to_all, open_to_a_group, within_reach, no_folder])
def test_in_the_place_of_a_usual_folder_that_is_not_the_users_own_comes_a_new_one(home, monkeypatch, capsys, fault):
    reason = fault(cache.cache_folder(), monkeypatch)
    undone: list = []
    monkeypatch.setattr(cache.atexit, "register", undone.append)
    made = cache.cache_folder()
    assert f"({home}: {reason}" in capsys.readouterr().err
    assert stat.S_IMODE(made.stat().st_mode) == 0o700
    assert cache.cache_folder() == made  # the same one next time, and in the processes that this one starts
    assert not capsys.readouterr().err
    undone[0]()
    assert not made.exists()


@pytest.mark.parametrize("home", ["/dev/null/nobody", ""])
def test_without_a_home_a_command_keeps_kernels_until_it_ends(home):
    program = (
        "import os, sys; from pathlib import Path; from tractexp.model.cache import cache_folder, read, write\n"
        "if not sys.argv[1]:\n"
        "    def unknown(*_): raise RuntimeError\n"
        "    Path.home = unknown\n"  # as for a user that the system does not know
        "write(cache_folder() / 'x', b'1'); assert read(cache_folder() / 'x') == b'1'; print(cache_folder())"
    )
    there = {k: v for k, v in os.environ.items() if k not in (cache.CHOICE, "XDG_CACHE_HOME", "LOCALAPPDATA")}
    ran = subprocess.run(
        [sys.executable, "-c", program, home], env=there | {"HOME": home}, capture_output=True, text=True, check=True
    )
    assert "kernels are compiled anew for every command" in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
    assert not Path(ran.stdout.strip()).exists()


def test_a_full_disk_costs_time_and_nothing_else(folder, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache.tempfile, "mkstemp", full)
    cache.write(folder / "one.kept", b"content")
    assert kernel.load.__wrapped__("FULL = 1\n").FULL == 1
