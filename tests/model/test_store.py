"""What is stored on disk and may be executed: only what was written there whole, in a folder of the
user's own.
"""

import ctypes
import io
import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tractexp.cache import store, texts
from tractexp.errors import UserError
from tractexp.kernel import objects, target

ONES = store.Store("ones")
WITHOUT_OWNERS = pytest.mark.skipif(
    not hasattr(os, "geteuid"), reason="folders have no owner in this system"
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder chosen for the store."""
    monkeypatch.setenv(store.CHOICE, str(tmp_path / "cache"))
    return store.find_cache_folder()


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home whose cache folder is the usual one; what is set while a test runs is taken back."""
    monkeypatch.setenv(store.CHOICE, "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return tmp_path / "home" / "tractexp"


class Part:
    """A part of a model, whose code stands in a file."""

    def __repr__(self):
        return "Part()"


class Nameless:
    """A part whose `repr` is Python's own: it tells where it lies, not what it is set to."""


# what is read


def test_an_entry_is_read_as_it_was_written_and_computed_once(folder):
    ONES.write("one", b"content")
    assert ONES.read("one") == b"content"
    assert [str(p.relative_to(folder)) for p in folder.rglob("*.*")] == [
        os.path.join("ones", "one.entry")
    ]
    assert ONES.get("one", lambda: b"other") == b"content"
    assert ONES.get("two", lambda: b"other") == ONES.read("two") == b"other"


def test_what_has_no_key_is_computed_each_time_and_not_stored(folder):
    assert [ONES.get("", lambda k=k: bytes([k])) for k in range(2)] == [b"\0", b"\1"]
    assert [ONES.arrays("", lambda k=k: (np.array(k),))[0] for k in range(2)] == [0, 1]
    assert not list(folder.rglob("*.*"))


def test_the_oldest_entries_are_forgotten(folder):
    few = store.Store("few", limit=2)
    for k, name in enumerate("abc"):
        few.write(name, b"content")
        os.utime(few.path(name), (k, k))
    few.write("d", b"content")
    assert sorted(path.stem for path in (folder / "few").iterdir()) == ["c", "d"]


def test_a_large_store_stays_near_its_limit_and_is_seldom_listed(folder, monkeypatch):
    many, listed, forget = store.Store("many", limit=640), [], store.Store._forget
    monkeypatch.setattr(
        store.Store, "_forget", lambda self, *given: (listed.append(1), forget(self, *given))
    )
    (folder / "many").mkdir()
    for k in range(640):  # of an earlier process
        many.path(f"{k:04}").touch()
        os.utime(many.path(f"{k:04}"), (k, k))
    for k in range(640, 840):
        many.write(f"{k:04}", b"content")
        os.utime(many.path(f"{k:04}"), (k, k))
        kept = sorted(path.stem for path in (folder / "many").iterdir())
        assert 560 <= len(kept) <= 650
        # the newest, without a gap
        assert kept == [f"{n:04}" for n in range(k + 1 - len(kept), k + 1)]
    assert len(listed) == 19


def test_arrays_are_read_back_to_the_bit_and_never_for_another_key(folder):
    computed = []

    def compute():
        computed.append(1)
        return np.array([1 / 3]), np.array(["a"])

    key = store.compute_key(np.arange(3.0), [("a", 1)], {"b": None})
    for _ in range(2):
        number, text = store.DESCENTS.arrays(key, compute)
        assert (number[0], text.tolist(), len(computed)) == (1 / 3, ["a"], 1)
    others = [
        (np.arange(3.0), [("a", 2)], {"b": None}),
        (np.arange(3), [("a", 1)], {"b": None}),
        (np.arange(3.0).reshape(3, 1), [("a", 1)], {"b": None}),
        (np.arange(3.0), [("a", 1)], {"b": 0}),
    ]
    assert len({key, *(store.compute_key(*other) for other in others)}) == 5
    (file,) = (folder / "descents").iterdir()
    file.write_bytes(file.read_bytes()[:50])
    assert store.find_damaged_files(folder) == [file]
    store.DESCENTS.arrays(key, compute)
    assert len(computed) == 2
    assert store.find_damaged_files(folder) == []
    earlier = folder / "code_0.kept"  # of a version before 0.2
    earlier.write_bytes(b"")
    # of the user, whose folder it may be
    for name in ("best.kept", "mine.entry", "descents/mine.entry"):
        (folder / name).write_bytes(b"mine")
    assert store.find_damaged_files(folder) == [earlier]


def test_no_entry_is_unpickled(folder):
    written = io.BytesIO()
    np.savez(written, planted=np.array([{"an": "object"}], dtype=object))
    store.DESCENTS.write("planted", written.getvalue())
    assert store.DESCENTS.read("planted") == written.getvalue()
    assert store.DESCENTS.read_arrays("planted") is None


@pytest.mark.parametrize(
    "damage",
    [
        *(
            lambda b, k=k: b[:k] + bytes([b[k] ^ 1]) + b[k + 1 :]
            for k in (0, store.SUM - 1, store.SUM, -2)
        ),
        lambda b: b[:-1],
        lambda b: b + b"\0",
        lambda b: b[: store.SUM],
        lambda b: b[store.SUM :],
        lambda b: b"",
    ],
)
def test_a_damaged_file_is_none(folder, damage):
    ONES.write("one", b"content of a file")
    path = ONES.path("one")
    path.write_bytes(damage(path.read_bytes()))
    assert ONES.read("one") is None


def test_a_sound_file_in_the_place_of_another_is_none(folder):
    ONES.write("one", b"content")
    os.replace(ONES.path("one"), ONES.path("two"))
    assert ONES.read("two") is None
    ONES.path("three").mkdir()
    assert ONES.read("three") is None
    ONES.write("three", b"content")  # cannot, and says nothing: it is computed again next time
    assert not list(folder.rglob("*.part"))


def test_beside_a_run_only_what_this_user_has_written_is_an_entry(tmp_path, monkeypatch):
    beside = store.Store("ones", folder=tmp_path / "run")
    monkeypatch.setenv("TRACTEXP_CACHE_DIR", str(tmp_path / "theirs"))
    beside.write_json("one", {"made": "by others"})
    assert beside.read_json("one") == {"made": "by others"}
    monkeypatch.setenv("TRACTEXP_CACHE_DIR", str(tmp_path / "mine"))
    assert beside.read_json("one") is None
    ONES.write("one", b'"with a sum that anybody can make"')
    os.replace(ONES.path("one"), beside.path("one"))
    assert beside.read_json("one") is None
    beside.write_json("one", "mine")
    assert beside.read_json("one") == "mine"
    secret = tmp_path / "mine" / "secret.key"
    assert secret.stat().st_mode & 0o77 == 0
    secret.write_bytes(b"")  # damaged: nothing is an entry, and nothing is written
    assert beside.read_json("one") is None
    beside.write_json("two", "mine")
    assert not beside.path("two").exists()


def test_planted_code_is_not_run_and_the_file_heals(folder):
    """A file whose sum is not its own is none, and is compiled anew; one of another kernel in its
    place, too.
    """
    answer, other = (objects.load_object_code(stored(number)) for number in (42.0, 7.0))
    assert called(42.0) == 42.0
    path, theirs = (code_path(stored(number)) for number in (42.0, 7.0))
    sound = path.read_bytes()
    for planted in (theirs.read_bytes(), other, sound[: store.SUM] + other, sound[:-9], b""):
        path.write_bytes(planted)
        assert store.CODE.read(path.stem) is None
        assert called(42.0) == 42.0
        assert path.read_bytes() == sound
    assert store.CODE.read(path.stem) == answer


def code_path(text):
    return store.CODE.path(store.compute_key(target.compute_key(), text))


def stored(number):
    """IR of a function that stores a number."""
    return (
        f"define void @run(ptr %out) {{\n  store double {number:e}, ptr %out, align 8\n  ret"
        f" void\n}}\n"
    )


def called(number):
    """What that function stores, loaded as a new process would."""
    objects.load.cache_clear()
    out = np.zeros(1)
    loaded = objects.load(stored(number))
    ctypes.CFUNCTYPE(None, ctypes.c_void_p)(loaded.address)(out.ctypes.data)
    return out[0]


def test_code_for_another_machine_or_of_another_text_is_another_file(folder, monkeypatch):
    def files():
        return len([*folder.glob("code/*.entry")])

    objects.load_object_code(stored(1.0))
    objects.load_object_code(stored(1.0))
    assert files() == 1
    objects.load_object_code(stored(2.0))
    assert files() == 2
    monkeypatch.setattr(target, "compute_key", lambda: "another processor")
    objects.load_object_code(stored(1.0))
    assert files() == 3


def test_a_changed_digit_in_a_text_is_not_compiled(folder):
    made = []
    for _ in range(2):
        assert (
            texts.get_text_of_parts((Part(),), lambda: made.append(1) or "TORQUE = 0.55", "text")
            == "TORQUE = 0.55"
        )
        (text,) = folder.glob("texts/*.entry")
        text.write_bytes(text.read_bytes().replace(b"0.55", b"0.66"))
    assert len(made) == 2


@pytest.mark.parametrize("parts", [(Nameless(),), (Part(), Nameless())])
def test_nothing_is_stored_of_a_part_known_by_its_address(folder, parts):
    """Another part at the same address once got the equations of the first."""
    made = []
    for _ in range(2):
        texts.get_text_of_parts(parts, lambda: made.append(1) or "text", "text")
    assert len(made) == 2
    assert not list(folder.glob("texts/*"))


# where it is kept


@WITHOUT_OWNERS
def test_a_new_folder_is_closed_to_others_whatever_the_umask(home):
    before = os.umask(0)
    try:
        assert store.find_cache_folder() == home
    finally:
        os.umask(before)
    assert stat.S_IMODE(home.stat().st_mode) == 0o700


@WITHOUT_OWNERS
def test_a_folder_of_an_older_version_is_closed_to_others(home):
    home.mkdir(parents=True)
    home.chmod(0o755)
    assert store.find_cache_folder() == home
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


def in_a_folder_of_a_group(folder, monkeypatch):
    monkeypatch.setattr(store, "_is_private_group", lambda number: False)
    folder.parent.chmod(0o775)
    return "a group can put another in its place"


def in_a_folder_of_another_user(folder, monkeypatch):
    usual = os.getuid()
    if usual:
        pytest.skip("only root gives a folder away")
    os.chown(folder.parent, 12345, 12345)
    return "another user can put another in its place"


def with_a_kind_that_is_open(folder, monkeypatch):
    (folder / "code").mkdir(exist_ok=True)
    (folder / "code").chmod(0o777)
    return f"other users can write to {folder / 'code'}"


def with_a_kind_that_is_a_link(folder, monkeypatch):
    (folder.parent / "theirs").mkdir()
    (folder / "texts").symlink_to(folder.parent / "theirs")
    return f"{folder / 'texts'} is a link or a file, and no folder"


def behind_a_link_that_others_can_change(folder, monkeypatch):
    (folder.parent / "open").mkdir()
    sound = folder.rename(folder.parent / "sound")
    (folder.parent / "open" / "link").symlink_to(sound)
    folder.symlink_to(folder.parent / "open" / "link")
    (folder.parent / "open").chmod(0o777)
    return "every user can put another in its place"


def by_a_link_of_another_user_where_all_share(folder, monkeypatch):
    if os.getuid():
        pytest.skip("only root gives a link away")
    (folder.parent / "shared").mkdir()
    sound = folder.rename(folder.parent / "sound")
    (folder.parent / "shared" / "link").symlink_to(sound)
    os.lchown(folder.parent / "shared" / "link", 12345, 12345)
    (folder.parent / "shared").chmod(0o1777)
    folder.symlink_to(folder.parent / "shared" / "link")
    return f"another user has put {folder.parent / 'shared' / 'link'} there"


def no_folder(folder, monkeypatch):
    folder.rmdir()
    folder.write_text("a file")
    return "it cannot be made or looked at (File exists)"


def read_only(folder, monkeypatch):
    # root may write anywhere
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.W_OK)
    return "it cannot be written to"


FAULTS = [
    foreign,
    open_to_all,
    open_to_a_group,
    within_reach,
    no_folder,
    read_only,
    in_a_folder_of_a_group,
    in_a_folder_of_another_user,
    with_a_kind_that_is_open,
    with_a_kind_that_is_a_link,
    behind_a_link_that_others_can_change,
    by_a_link_of_another_user_where_all_share,
]


@WITHOUT_OWNERS
def test_a_folder_of_ones_own_is_used_where_all_share_and_none_can_move_it(folder):
    """As in /tmp: in a folder with the sticky bit only the owner of an entry moves it."""
    folder.parent.chmod(0o1777)
    assert store.find_cache_folder() == folder


@WITHOUT_OWNERS
@pytest.mark.parametrize("fault", FAULTS)
def test_a_chosen_folder_that_is_not_the_users_own_is_refused(folder, monkeypatch, fault):
    folder.parent.chmod(0o700)
    reason = fault(folder, monkeypatch)
    with pytest.raises(UserError) as refused:
        store.find_cache_folder()
    assert f"TRACTEXP_CACHE_DIR={folder} cannot keep kernels: {reason}" in str(refused.value)
    assert "choose a folder of your own" in str(refused.value)


@WITHOUT_OWNERS
@pytest.mark.parametrize("fault", [open_to_all, open_to_a_group, within_reach, no_folder])
def test_in_the_place_of_a_usual_folder_that_is_not_the_users_own_comes_a_new_one(
    home, monkeypatch, capsys, fault
):
    reason = fault(store.find_cache_folder(), monkeypatch)
    undone: list = []
    monkeypatch.setattr(store.atexit, "register", undone.append)
    made = store.find_cache_folder()
    assert f"({home}: {reason}" in capsys.readouterr().err
    assert stat.S_IMODE(made.stat().st_mode) == 0o700
    # the same one next time, and in the processes that this one starts
    assert store.find_cache_folder() == made
    assert not capsys.readouterr().err
    undone[0]()
    assert not made.exists()


@pytest.mark.parametrize("home", ["/dev/null/nobody", ""])
def test_without_a_home_a_command_stores_kernels_until_it_ends(home):
    program = (
        "import os, sys; from pathlib import Path\n"
        "from tractexp.cache.store import CODE, find_cache_folder\n"
        "if not sys.argv[1]:\n"
        "    def unknown(*_): raise RuntimeError\n"
        "    Path.home = unknown\n"  # as for a user that the system does not know
        "CODE.write('x', b'1'); assert CODE.read('x') == b'1'; print(find_cache_folder())"
    )
    there = {
        k: v
        for k, v in os.environ.items()
        if k not in (store.CHOICE, "XDG_CACHE_HOME", "LOCALAPPDATA")
    }
    ran = subprocess.run(
        [sys.executable, "-c", program, home],
        env=there | {"HOME": home},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "kernels are compiled anew for every command" in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
    assert not Path(ran.stdout.strip()).exists()


def test_a_full_disk_costs_time_and_nothing_else(folder, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store.tempfile, "mkstemp", full)
    ONES.write("one", b"content")
    assert called(3.0) == 3.0
