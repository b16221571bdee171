"""The wheel and the sdist: two builds are the same to the byte, and they hold the package and
nothing else.
"""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
if not (ROOT / "setup.py").is_file():
    pytest.skip("no checkout: nothing to build", allow_module_level=True)

TOP = ("pyproject.toml", "setup.py", "README.md", "LICENSE")
FOLDERS = ("tractexp", "conf", "plugins")
KINDS = {".py", ".yaml", ".csv", ".json", ".cfg", ".dat", ".css", ".js", ".typed"}


def tree(folder: Path, mode: int, seconds: float) -> Path:
    """A checkout under `folder` whose files have this mode and this time."""
    for name in FOLDERS:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in TOP:
        shutil.copy(ROOT / name, folder / name)
    for path in folder.rglob("*"):
        if path.is_file():
            path.chmod(mode)
            os.utime(path, (seconds, seconds))
    return folder


def built(folder: Path, umask: int, *kinds: str) -> dict[str, bytes]:
    """{suffix: content} of what is built there."""
    environment = {name: value for name, value in os.environ.items() if name != "SOURCE_DATE_EPOCH"}
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", "made", *kinds, "."]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, umask=umask, env=environment
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return {path.suffix: path.read_bytes() for path in (folder / "made").iterdir()}


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """An sdist, and the wheel built of it."""
    folder = tree(tmp_path_factory.mktemp("first"), 0o644, 1_000_000_000)
    return folder / "made", built(folder, 0o022)


@pytest.mark.skipif(os.name == "nt", reason="modes and umask are of POSIX")
def test_another_time_mode_and_umask_give_the_same_bytes(first, tmp_path):
    """Once of the sdist, once of the files themselves."""
    other = built(tree(tmp_path, 0o600, 1_700_000_000), 0o077, "--sdist", "--wheel")
    assert set(other) == {".gz", ".whl"}
    assert {kind: other[kind] == first[1][kind] for kind in other} == {".gz": True, ".whl": True}


def test_the_wheel_holds_the_package_and_nothing_else(first):
    (path,) = first[0].glob("*.whl")
    with zipfile.ZipFile(path) as wheel:
        names = [Path(name) for name in wheel.namelist()]
    tops = {name.parts[0].partition("-")[0] for name in names}
    assert tops == {"tractexp", "tractexp_plugins"}
    inside = [name for name in names if not name.parts[0].endswith(".dist-info")]
    assert {name.suffix for name in inside} == KINDS
    sources = [
        p
        for name in FOLDERS
        for p in (ROOT / name).rglob("*")
        if p.is_file() and "__pycache__" not in p.parts
    ]
    assert Counter(name.name for name in inside) == Counter(path.name for path in sources)


def test_the_sdist_holds_what_the_wheel_is_built_of_and_nobody(first):
    (path,) = first[0].glob("*.tar.gz")
    with tarfile.open(path) as sdist:
        members = sdist.getmembers()
    assert {(m.uid, m.gid, m.uname, m.gname) for m in members} == {(0, 0, "", "")}
    assert all(m.isfile() or m.isdir() for m in members)
    parts = [Path(m.name).parts for m in members if m.isfile()]
    top = {path[1] for path in parts}
    assert top == {*TOP, *FOLDERS, "PKG-INFO", "setup.cfg", "tractexp.egg-info"}
    assert not any(
        "__pycache__" in path or path[-1].endswith((".pyc", ".so", ".log")) for path in parts
    )
