"""A run's folder: an earlier whole run is there until a newer one is whole, whoever is killed and
whatever is full.
"""

import contextlib
import errno
import itertools
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tractexp.errors import UserError
from tractexp.storage import files, run_folder
from tractexp.storage.run_folder import CONFIGURATION, LOCK, WHOLE, settle

# of `os`: each changes what is on the disk
CALLS = ("replace", "mkdir", "unlink", "rmdir", "open", "fsync")
NOTES = "mine"


def configured(seed: int) -> dict[str, str]:
    return {name: f"seed={seed}" for name in ("config.yaml", "overrides.yaml")}


def results(seed: int):
    """What a task writes: the second seed's has a page of its own and no history."""

    def write(folder: Path) -> list[Path]:
        paths = [
            files.write(folder / "result.json", f"seed={seed}"),
            files.write(folder / "conf" / "m.yaml", f"{seed}"),
        ]
        if seed == 1:
            paths.append(files.write(folder / "history.csv", f"seed={seed}"))
        return paths

    return write


def run(folder: Path, seed: int) -> None:
    with run_folder.run_folder(folder, configured(seed), frozenset()) as place:
        place.place(results(seed))


def whole(seed: int) -> dict[str, str]:
    """A folder that holds the run of a seed, and nothing of another."""
    left = {f"{CONFIGURATION}/{name}": text for name, text in configured(seed).items()}
    left |= {"result.json": f"seed={seed}", "conf/m.yaml": f"{seed}", "notes.txt": NOTES}
    return left | ({"history.csv": "seed=1"} if seed == 1 else {})


def state(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): p.read_text() for p in sorted(folder.rglob("*")) if p.is_file()
    }


def ours(folder: Path) -> dict[str, str]:
    """Without what is on the way."""
    return {name: text for name, text in state(folder).items() if not name.startswith(".tractexp")}


@pytest.fixture
def earlier(tmp_path) -> Path:
    folder = tmp_path / "run"
    run(folder, 1)
    (folder / "notes.txt").write_text(NOTES)
    assert state(folder) == whole(1)
    return folder


def ended_at(count: int, monkeypatch, end) -> None:
    """Let the call of this number that changes the disk end by `end`."""
    numbers = itertools.count(1)
    for name in CALLS:
        usual = getattr(os, name)

        def counted(*arguments, usual=usual, **more):
            if next(numbers) == count:
                end()
            return usual(*arguments, **more)

        monkeypatch.setattr(os, name, counted)


def test_a_newer_run_takes_the_place_of_the_earlier_and_leaves_what_is_not_its(earlier):
    run(earlier, 2)
    assert state(earlier) == whole(2)


@pytest.mark.skipif(os.name == "nt", reason="forks")
def test_who_is_killed_at_any_moment_loses_no_whole_run(earlier, monkeypatch):
    """Of a folder that is looked at then: the earlier run whole, or the newer one, which the next
    command settles.
    """
    seen = set()
    for count in itertools.count(1):
        run(earlier, 1)
        if not (child := os.fork()):
            ended_at(count, monkeypatch, lambda: os._exit(9))
            run(earlier, 2)
            os._exit(0)
        _, code = os.waitpid(child, 0)
        left = ours(earlier)
        assert (earlier / WHOLE / run_folder.GOES).exists() or left in (whole(1), whole(2)), count
        newer = settle(earlier) or left == whole(2)
        left = ours(earlier)
        assert left == whole(2 if newer else 1), count
        seen.add(newer)
        if code == 0:
            break
    assert count > 20
    assert seen == {True, False}
    run(earlier, 3)
    # what the killed left is gone
    assert not [name for name in state(earlier) if name.startswith(".tractexp")]


def test_a_disk_that_is_full_at_any_write_loses_no_whole_run(earlier, monkeypatch):
    tried = []

    def full():
        tried.append(1)
        raise OSError(errno.ENOSPC, "No space left on device")

    for count in itertools.count(1):
        run(earlier, 1)
        with monkeypatch.context() as patch, contextlib.suppress(UserError, OSError):
            ended_at(count, patch, full)
            run(earlier, 2)
        newer = settle(earlier) or ours(earlier) == whole(2)
        assert ours(earlier) == whole(2 if newer else 1), count
        if len(tried) < count:
            break
    assert count > 20


def test_a_second_run_says_who_holds_the_folder_and_changes_nothing(earlier):
    before = state(earlier)
    with run_folder.run_folder(earlier, configured(2), frozenset()):
        code = (
            "import sys; from pathlib import Path\n"
            "from tractexp.storage.run_folder import run_folder\n"
            "with run_folder(Path(sys.argv[1]), {}, frozenset()): pass"
        )
        done = subprocess.run(
            [sys.executable, "-c", code, str(earlier)], capture_output=True, text=True
        )
        assert f"{earlier} is in use by process {os.getpid()} on " in done.stderr
        with pytest.raises(UserError, match=f"in use by process {os.getpid()} on .*, since "):
            run(earlier, 3)
    assert state(earlier) == before
    assert not (earlier / LOCK).exists()


def test_a_run_that_is_refused_leaves_no_folder_and_one_that_was_there_as_it_was(earlier, tmp_path):
    for folder in (earlier, tmp_path / "new"):
        before = state(folder)
        with (
            pytest.raises(UserError, match="wrong"),
            run_folder.run_folder(folder, configured(2), frozenset()),
        ):
            raise UserError("wrong")
        assert state(folder) == before
    assert not (tmp_path / "new").exists()


def test_what_a_run_reads_stays(earlier):
    read = frozenset({earlier / "history.csv"})
    with run_folder.run_folder(earlier, configured(2), read) as place:
        place.place(results(2))
    assert state(earlier) == whole(2) | {"history.csv": "seed=1"}


@pytest.mark.skipif(os.name == "nt", reason="makes links")
@pytest.mark.parametrize("way", ["whole", "within", "target", "pipe"])
def test_a_folder_of_others_moves_nothing_by_links(way, tmp_path):
    mine, given = tmp_path / "mine", tmp_path / "given"
    mine.mkdir()
    (mine / "key").write_text("secret")
    given.mkdir()
    (given / WHOLE).mkdir(parents=True)
    if way == "whole":
        (given / WHOLE).rmdir()
        (given / WHOLE).symlink_to(mine)
    elif way == "within":
        (given / WHOLE / "x").symlink_to(mine / "key")
    elif way == "target":
        (given / "conf").symlink_to(mine)
        (given / WHOLE / "conf").mkdir()
        (given / WHOLE / "conf" / "key").write_text("theirs")
    else:
        os.mkfifo(given / WHOLE / "x")
    try:
        assert not settle(given)
    except UserError as error:
        assert "would be moved by a link" in str(error)  # noqa: PT017
    assert state(mine) == {"key": "secret"}


def test_a_folder_of_others_names_no_other_file_to_go(tmp_path):
    (tmp_path / "mine").write_text("x")
    given = tmp_path / "given"
    (given / WHOLE).mkdir(parents=True)
    (given / "notes.txt").write_text("x")
    (given / WHOLE / run_folder.GOES).write_text("../mine\nnotes.txt\nresult.json")
    assert settle(given)
    assert (tmp_path / "mine").exists()
    assert (given / "notes.txt").exists()


def test_two_folders_of_one_name_are_two(tmp_path):
    made = [files.make_new_folder(tmp_path / "looks" / "a_10-00-00") for _ in range(3)]
    assert [path.name for path in made] == ["a_10-00-00", "a_10-00-00_2", "a_10-00-00_3"]
