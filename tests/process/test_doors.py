"""Every file that somebody else may have written, in every shape that none should have, at the door
that reads it.

It is read, left out, or refused in one sentence: no other exception, no wait, no memory beyond what
is there.
"""

import contextlib
import functools
import io
import json
import os
import resource
import shutil
import signal
import socket
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

import tractexp
import tractexp.data
from tractexp.cli.again import build_repeat_command
from tractexp.errors import UserError

if os.name == "nt":
    pytest.skip("named pipes, sockets and links are made", allow_module_level=True)

DATA = Path(tractexp.data.__file__).parent
SECONDS = 30  # of one reading, on a machine that is busy with others
# bytes of addresses of this process while it reads: a sparse file of 3 GB is not read whole
MEMORY = 6 << 30
LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k + 1}: &a{k + 1} [{', '.join(10 * [f'*a{k}'])}]\n" for k in range(9)
)


# Shapes of a file


def socketed(path: Path) -> None:
    with contextlib.chdir(path.parent), socket.socket(socket.AF_UNIX) as end:
        end.bind(path.name)


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(3 << 30)


def halved(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def cycled(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


@functools.cache
def packed(content: bytes = b"t,U,P,Q\n" * 10, encrypted: bool = False) -> bytes:
    """A .zip of one table."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.csv", content)
    data = bytearray(made.getvalue())
    if encrypted:
        data[6] |= 1
        data[data.index(b"PK\x01\x02") + 8] |= 1
    return bytes(data)


def bomb() -> bytes:
    return packed(bytes(100 << 20))


SHAPES: dict[str, Callable[[Path], object]] = {
    "pipe": lambda path: (path.unlink(), os.mkfifo(path)),
    "link to nowhere": lambda path: (path.unlink(), path.symlink_to("absent")),
    "link to a device": lambda path: (path.unlink(), path.symlink_to("/dev/zero")),
    "link to a pipe": lambda path: (
        path.unlink(),
        os.mkfifo(f"{path}.pipe"),
        path.symlink_to(f"{path}.pipe"),
    ),
    "cycle": cycled,
    "socket": lambda path: (path.unlink(), socketed(path)),
    "folder": lambda path: (path.unlink(), path.mkdir()),
    "giant": lambda path: (path.unlink(), sparse(path)),
    "empty": lambda path: path.write_bytes(b""),
    "cut": halved,
    "aliases": lambda path: path.write_text(LAUGHS),
    "brackets": lambda path: path.write_text("[" * 200_000),
    "a number": lambda path: path.write_text("5"),
    "a list": lambda path: path.write_text("[1, [2], {}]"),
    "keys of others": lambda path: path.write_text(
        '{"a": {"b": null}, "task": [], "hydra": 5, "run": {}}'
    ),
    "zeros": lambda path: path.write_bytes(bytes(5000)),
    "bomb": lambda path: path.write_bytes(bomb()),
    "archive with a password": lambda path: path.write_bytes(packed(encrypted=True)),
    "archive within an archive": lambda path: path.write_bytes(packed().replace(b".csv", b".zip")),
    "archive with nothing": lambda path: path.write_bytes(b"PK\x05\x06" + bytes(18)),
    "archive with a lie": lambda path: path.write_bytes(packed()[:-12] + b"\xff" * 12),
    "many columns": lambda path: path.write_text(3 * (",".join(["1"] * 300_000) + "\n")),
    "a name of brackets": lambda path: path.write_text(
        f"t,{'U [' * 30_000},P,Q\n" + "".join(f"{k},1,1,1\n" for k in range(9))
    ),
    "no text": lambda path: path.write_bytes(bytes(range(128, 256)) * 50),
}


# Folders as they should be, and the doors that read them


def run_of(folder: Path) -> Path:
    """The folder of a run and of a sweep's job, with all that is read of either."""
    (folder / ".hydra").mkdir(parents=True)
    runtime = {
        "cwd": str(folder),
        "config_sources": [],
        "choices": {"optimizer": "pso", "data": "tibet"},
    }
    contents = {
        "hydra.yaml": {"hydra": {"runtime": runtime}},
        "overrides.yaml": ["seed=1"],
        "config.yaml": {"task": {"name": "identify"}, "seed": 1, "optimizer": {"name": "pso"}},
    }
    for name, content in contents.items():
        (folder / ".hydra" / name).write_text(yaml.safe_dump(content))
    ended = {"objective": 1.0, "epsilon_p": 1.0, "epsilon_q": 1.0, "parameters": {"C": 0.9}}
    (folder / "result.json").write_text(json.dumps(ended))
    (folder / "history.csv").write_text(
        "iteration,simulations,seconds,objective\n0,20,0.1,2\n1,40,0.2,1\n"
    )
    status = {
        "status": "finished",
        "message": "",
        "configuration": "a",
        "inputs": "b",
        "seconds": 1.0,
        "choices": {"optimizer": "pso"},
        "seed": 1,
    }
    (folder / "status.json").write_text(json.dumps(status))
    (folder / "sweep.json").write_text(json.dumps({"run": "x"}))
    return folder


def compared(folder: Path) -> object:
    from tractexp.studies.comparison.load import read_sweep

    return read_sweep(folder.parent)


def its_state(folder: Path) -> object:
    from tractexp.sweep import status
    from tractexp.tracking import sweepfile

    sweepfile.does_wait(folder)
    return status.read(folder), status.read_objective(folder), sweepfile.read_parent(folder)


def kept(folder: Path) -> Path:
    """A run that waits to be logged."""
    from tractexp.tracking import TrackedRun
    from tractexp.tracking.runfile import save

    save(
        run_of(folder),
        TrackedRun("e", "one", artifacts=[folder / "result.json"]),
        "sqlite:///absent.db",
    )
    return folder


def waiting(folder: Path) -> object:
    from tractexp.tracking import runfile
    from tractexp.tracking.sync import _keep_files_inside, count_unsynced

    count_unsynced(folder)
    one = runfile.read(folder)
    return one and _keep_files_inside(one.run, folder, lambda line: None)


def records(folder: Path) -> Path:
    folder.mkdir(parents=True)
    for name in ("tibet_30pct.csv", "tibet_50pct.cfg", "tibet_50pct.dat"):
        shutil.copy(DATA / name, folder / name)
    (folder / "tibet_30pct.json").write_text("{}")
    return folder


def model_of(folder: Path) -> Path:
    folder.mkdir(parents=True)
    (folder / "m.yaml").write_text(
        "defaults: [{motor: electromechanical}, {static: exponential}, _self_]\n"
    )
    return folder


def modeled(folder: Path) -> object:
    from tractexp.configuration.composition import read_choice

    return read_choice("model", str(folder / "m.yaml"))


def zipped(folder: Path) -> Path:
    """A .zip of a record and a table."""
    folder.mkdir(parents=True)
    with zipfile.ZipFile(folder / "r.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("tibet_30pct.csv", "tibet_50pct.cfg", "tibet_50pct.dat"):
            archive.write(DATA / name, name)
    return folder


def unzipped(folder: Path) -> object:
    return tractexp.read(str(folder / "r.zip" / "tibet_50pct.cfg"))


def surveyed(folder: Path) -> object:
    return tractexp.survey(str(folder), cores=1, progress=False)


def loaded(folder: Path) -> object:
    return tractexp.load(folder / "result.json")


def read_table(folder: Path) -> object:
    return tractexp.read(str(folder / "tibet_30pct.csv"))


def looked(folder: Path) -> object:
    return tractexp.look(str(folder / "tibet_50pct.cfg"), progress=False)


DOORS = [  # the file, the folder that holds it as it should be, and what reads it
    (".hydra/hydra.yaml", run_of, lambda folder: build_repeat_command([str(folder)])),
    (".hydra/overrides.yaml", run_of, lambda folder: build_repeat_command([str(folder)])),
    (".hydra/config.yaml", run_of, compared),
    (".hydra/hydra.yaml", run_of, compared),
    ("result.json", run_of, compared),
    ("history.csv", run_of, compared),
    ("status.json", run_of, compared),
    ("status.json", run_of, its_state),
    ("sweep.json", run_of, its_state),
    ("result.json", run_of, loaded),
    ("mlflow.json", kept, waiting),
    ("result.json", kept, waiting),
    ("m.yaml", model_of, modeled),
    ("tibet_30pct.csv", records, read_table),
    ("tibet_30pct.json", records, read_table),
    ("tibet_50pct.cfg", records, looked),
    ("tibet_50pct.dat", records, looked),
    ("r.zip", zipped, unzipped),
    ("r.zip", zipped, surveyed),
]


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """Raise `TimeoutError` for what waits, and `MemoryError` for what takes more than there should
    be.
    """

    def late(*_):
        raise TimeoutError(f"it takes more than {SECONDS} s")

    before, most = signal.signal(signal.SIGALRM, late), resource.getrlimit(resource.RLIMIT_AS)
    signal.alarm(SECONDS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, most[1]))
    try:
        yield
    finally:
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_AS, most)
        signal.signal(signal.SIGALRM, before)


def outcome(read: Callable[[Path], object], folder: Path) -> str:
    """What is wrong with how a door takes a file; "" for nothing."""
    here = Path.cwd()
    try:
        with limited():
            read(folder)
    except UserError as error:
        return "" if str(error).strip() else "it is refused without a word"
    except BaseException as error:
        return f"{type(error).__name__}: {error!s:.90}"
    finally:
        os.chdir(here)
    return ""


@pytest.mark.parametrize(
    ("name", "made", "read"), DOORS, ids=[f"{name} {read.__name__}" for name, _, read in DOORS]
)
def test_every_shape_of_a_file_is_read_left_or_refused(name, made, read, tmp_path):
    assert outcome(read, made(tmp_path / "as it should be" / "0")) == ""
    found = {}
    for k, (shape, give) in enumerate(SHAPES.items()):
        folder = made(tmp_path / str(k) / "0")
        give(folder / name)
        found[shape] = outcome(read, folder)
        shutil.rmtree(tmp_path / str(k))
    assert {shape: why for shape, why in found.items() if why} == {}


# Fuzzing that knows structure: a tree as it should be, of which a few nodes are exchanged, taken
# out or added

POOL = (
    None,
    True,
    0,
    -1,
    2**70,
    1e308,
    "",
    "x",
    "${oc.env:HOME}",
    "../..",
    "\x1b[31mred",
    "a\nnext: b",
    [],
    {},
    [[]],
    {"a": None},
    {"_target_": "os.system"},
    "x" * 10_000,
    [*range(1000)],
    "9" * 400,
    "sqlite:////x.db",
    "NaN",
)
TREES = [
    door
    for door in DOORS
    if door[0].endswith((".json", ".yaml")) and not door[0].startswith("tibet")
]
QUICK_CASES = 300


def places(node, path=()) -> Iterator[tuple]:
    """The paths of all nodes of a tree."""
    yield path
    inner = (
        node.items()
        if isinstance(node, dict)
        else enumerate(node)
        if isinstance(node, list)
        else ()
    )
    for key, value in inner:
        yield from places(value, (*path, key))


def mutated(tree, rng):
    """A tree with one node changed."""
    paths = [*places(tree)]
    path, other = paths[rng.integers(len(paths))], POOL[rng.integers(len(POOL))]
    if not path:
        return other if rng.random() < 0.2 else tree
    node = tree
    for key in path[:-1]:
        node = node[key]
    way = rng.integers(5)
    if way == 0:
        del node[path[-1]]
    elif way == 1:
        node[path[-1]] = [node[path[-1]], other]
    elif way == 2 and isinstance(node, dict):
        node[str(other)[:30]] = other
    else:
        node[path[-1]] = other
    return tree


def fuzzed(cases: int, seed: int, root: Path, first: int = 0) -> dict[int, str]:
    """{number of a case: what is wrong}: of each, one to three nodes of one file are changed."""
    import numpy as np

    found = {}
    for k in range(first, first + cases):
        rng = np.random.default_rng([seed, k])
        name, made, read = TREES[rng.integers(len(TREES))]
        folder = made(root / str(k) / "0")
        path = folder / name
        library = json if name.endswith(".json") else yaml
        tree = json.loads(path.read_text()) if library is json else yaml.safe_load(path.read_text())
        for _ in range(rng.integers(1, 4)):
            if isinstance(tree, dict | list):
                tree = mutated(json.loads(json.dumps(tree)), rng)
        path.write_text(json.dumps(tree) if library is json else yaml.safe_dump(tree))
        if why := outcome(read, folder):
            found[k] = f"{name} {read.__name__}: {why}: {path.read_text()[:120]}"
        shutil.rmtree(root / str(k))
    return found


FOUND = (368, 1177, 2396, 6277)  # of seed 1: names longer than a system takes for a file's


def test_what_was_found_stays_mended(tmp_path):
    assert [why for k in FOUND for why in fuzzed(1, 1, tmp_path, first=k).values()] == []


def test_trees_with_a_few_nodes_changed_are_read_left_or_refused(tmp_path):
    """`benchmarks/mutated_folders.py` does ten thousand."""
    assert fuzzed(QUICK_CASES, 0, tmp_path) == {}
