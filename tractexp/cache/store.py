"""The store: what was computed is on disk as an entry, read back under its key and never otherwise.

A key is the SHA-256 of all that an entry depends on, so an entry is the right one or is not there;
what cannot tell all of it has the key "", and nothing is stored. Some entries become code of this
process. Two things make that safe. Nobody but its user can write to the folder, nor put another in
its place. And each file begins with the SHA-256 of its own name and content: one that is damaged,
cut, exchanged or from another program is none, and is computed again. The sums alone would not keep
anyone out, who could write them too; that is what the folder is for. Beside the results of a run,
whose folder others may have made, sums are made with a secret of the user's: only what this user
has written is an entry there.
"""

import atexit
import contextlib
import dataclasses
import functools
import hashlib
import hmac
import importlib.metadata
import io
import json
import os
import platform
import re
import secrets
import shutil
import stat
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.cache import provenance
from tractexp.errors import UserError
from tractexp.storage import files, locks

CHOICE = "TRACTEXP_CACHE_DIR"
SUM = hashlib.sha256().digest_size  # bytes a file begins with
SECRET = "secret.key"  # in the cache folder
LONGEST_WAIT = 10.0  # s for another process that makes it
ENDING, EARLIER = ".entry", ".kept"  # of its name, now and in versions before 0.2
# nobody else's
NAME = re.compile(rf"[0-9a-f]+{re.escape(ENDING)}|[a-z]+_[0-9a-f]+{re.escape(EARLIER)}")
LIBRARIES = ("numpy", "scipy", "llvmlite")  # whose versions may change the last digits
# raised where arrays are unpacked
DAMAGED = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


class Store:
    """Entries of one kind, below the cache folder or in a `folder` of their own; beyond `limit` the
    oldest go.

    A process counts the entries of a large store at the first one it writes and at every 64th part
    of the limit; where they are too many, an eighth goes at once. To list and sort thousands at
    each takes far longer than to write it.
    """

    def __init__(self, kind: str, limit: int | None = None, folder: Path | None = None):
        """A store of one kind of entries, of which at most `limit` are kept, in its own folder."""
        self.kind, self.limit, self.folder, self._written = kind, limit, folder, 0

    def path(self, key: str) -> Path:
        """The file of an entry."""
        return (self.folder or find_cache_folder()) / self.kind / f"{key[:40]}{ENDING}"

    def read(self, key: str) -> bytes | None:
        """The content of an entry; None where there is none, or its file is damaged."""
        try:
            return _read_sound(self.path(key), self._read_secret()) if key else None
        except (OSError, UserError):
            return None

    def _read_secret(self) -> bytes:
        """The secret that its sums are made with: in a folder that others may have made the user's,
        else none.
        """
        return read_secret() if self.folder else b""

    def write(self, key: str, content: bytes) -> None:
        """Write an entry, whole or not at all; where that is impossible, it is computed again next
        time.
        """
        if not key:
            return
        with contextlib.suppress(OSError, UserError):
            path = self.path(key)
            path.parent.mkdir(mode=0o777 if self.folder else 0o700, parents=True, exist_ok=True)
            signature = _sum(path, content, self._read_secret())
            files.write(path, signature + content, lasting=False)
            if self.limit is not None and self._written % (1 + self.limit // 64) == 0:
                self._forget(path.parent, self.limit)
            self._written += 1

    def read_json(self, key: str) -> Any:
        """The plain data of an entry; None where there is none."""
        content = self.read(key)
        return None if content is None else json.loads(content)

    def write_json(self, key: str, content: Any) -> None:
        """Write an entry of plain data."""
        self.write(key, json.dumps(content, ensure_ascii=False).encode())

    def get(self, key: str, compute: Callable[[], bytes]) -> bytes:
        """The content of an entry, computed and written where there is none."""
        content = self.read(key)
        if content is None:
            self.write(key, content := compute())
        return content

    def arrays(
        self, key: str, compute: Callable[[], tuple[np.ndarray, ...]]
    ) -> tuple[np.ndarray, ...]:
        """The arrays of an entry, computed and written where there is none."""
        if (entry := self.read_arrays(key)) is not None:
            return tuple(entry.values())
        result = compute()
        self.write_arrays(key, **{f"arr_{k}": array for k, array in enumerate(result)})
        return result

    def read_arrays(self, key: str) -> dict[str, np.ndarray] | None:
        """The arrays of an entry by name; None where there are none. Nothing in it is unpickled."""
        content = self.read(key) or b""
        with (
            contextlib.suppress(*DAMAGED),
            np.load(io.BytesIO(content), allow_pickle=False) as entry,
        ):
            return {name: entry[name] for name in entry.files}
        return None

    def write_arrays(self, key: str, **arrays: np.ndarray) -> None:
        """Write an entry of arrays by name."""
        if not key:
            return
        packed = io.BytesIO()
        np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
        self.write(key, packed.getvalue())

    def _forget(self, folder: Path, limit: int) -> None:
        """Remove the entries that were written first, and an eighth more."""
        entries = list(folder.glob(f"*{ENDING}"))
        if len(entries) > limit:
            times = {}
            for path in entries:  # another process forgets, too: one may be gone
                with contextlib.suppress(FileNotFoundError):
                    times[path] = path.stat().st_mtime
            for path in sorted(times, key=times.__getitem__)[: len(entries) - limit + limit // 8]:
                path.unlink(missing_ok=True)


# some 10 kB each
CODE, TEXTS, DRAWINGS = Store("code", 4000), Store("texts", 4000), Store("drawings", 4000)
SEARCHES, DESCENTS = Store("searches", 3000), Store("descents", 4000)
DATABASES = Store("databases", 4)  # of 1 MB
KINDS = tuple(store.kind for store in (CODE, TEXTS, DRAWINGS, SEARCHES, DESCENTS, DATABASES))
MOST_LINKS = 40  # that a path leads through, as the system has it


def find_damaged_files(folder: Path) -> list[Path]:
    """The files of a cache folder that are damaged, or of an earlier version."""
    ours = [path for path in folder.rglob("*") if NAME.fullmatch(path.name)]
    return [path for path in ours if path.suffix == EARLIER or _read_sound(path) is None]


def _read_sound(path: Path, secret: bytes = b"") -> bytes | None:
    """The content of a file as it was written with a secret; None where there is none, or
    another.
    """
    try:
        data = files.read(path)
    except (OSError, UserError):
        return None
    content = data[SUM:]
    return content if hmac.compare_digest(data[:SUM], _sum(path, content, secret)) else None


def _sum(path: Path, content: bytes, secret: bytes = b"") -> bytes:
    """The SHA-256 of an entry's name and content, with a secret the HMAC."""
    told = path.name.encode() + b"\0" + content
    return hmac.digest(secret, told, "sha256") if secret else hashlib.sha256(told).digest()


def read_secret() -> bytes:
    """The user's secret, by which entries beside results are known as this user's; made if there is
    none yet.

    Raises `UserError` if its file cannot be written or read, or is not as long as it was made.
    """
    path = find_cache_folder() / SECRET
    if not path.exists():
        with locks.lock_file(path.with_suffix(".lock"), LONGEST_WAIT):
            if not path.exists():
                files.write(path, secrets.token_bytes(SUM), private=True)
    secret = files.read(path)
    if len(secret) != SUM:
        raise UserError(f"{path} is damaged; remove it, and what was kept is computed again")
    return secret


# Keys


def compute_key(*things: Any) -> str:
    """SHA-256 of numbers, texts, arrays, and of collections and dataclasses of them: equal for what
    is equal.
    """
    digest = hashlib.sha256()
    for thing in things:
        digest.update(_encode_content(thing))
    return digest.hexdigest()


def _encode_content(thing: Any) -> bytes:
    """Everything that tells a thing from another as bytes: arrays with type and shape, fields and
    items in order.
    """
    if isinstance(thing, np.ndarray):
        return f"{thing.dtype.str} {thing.shape} ".encode() + np.ascontiguousarray(thing).tobytes()
    if dataclasses.is_dataclass(thing):
        fields = {
            field.name: getattr(thing, field.name)
            for field in dataclasses.fields(thing)
            if field.init
        }
        return f"{type(thing).__qualname__} ".encode() + _encode_content(fields)
    if isinstance(thing, Mapping):
        return b"{%s}" % compute_key(*(item for pair in thing.items() for item in pair)).encode()
    if isinstance(thing, list | tuple):
        return b"[%s]" % compute_key(*thing).encode()
    return f"{type(thing).__name__} {thing!r} ".encode()


def describe_environment() -> str:
    """What every number computed here depends on, as one text: the code of all plugins, libraries,
    interpreter, processor.
    """
    versions = [f"{name} {read_version(name)}" for name in LIBRARIES]
    return repr(
        (provenance.hash_code(), versions, sys.version, platform.machine(), platform.processor())
    )


@functools.cache  # the files of a package are searched for each time
def read_version(library: str) -> str:
    """The version of a library that is installed."""
    return importlib.metadata.version(library)


def is_installed(part: Any) -> bool:
    """Whether a part's code is among that whose digest is taken: a plugin in no installed file may
    change unseen.
    """
    file = getattr(sys.modules.get(type(part).__module__), "__file__", None)
    return file is not None and any(
        Path(file).is_relative_to(folder) for folder in provenance.list_folders()
    )


# The folder


def find_cache_folder() -> Path:
    """$TRACTEXP_CACHE_DIR, else `tractexp` in the user's cache folder, else a temporary one.

    Raises `UserError` where the folder chosen cannot be written to, or can by others.
    """
    if chosen := os.environ.get(CHOICE):
        if reason := _explain_unfit(Path(chosen)):
            raise UserError(
                f"{CHOICE}={chosen} cannot keep kernels: {reason}; choose a folder of your own,"
                " such as a new one"
            )
        return Path(chosen)
    usual = _find_usual_folder()
    reason = _explain_unfit(usual, private=True) if usual else "no home folder is known"
    return usual if usual and not reason else _make_temporary(f"{usual or CHOICE}: {reason}")


def _find_usual_folder() -> Path | None:
    """`tractexp` in the user's cache folder; None where no home is known."""
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        if (base := Path(os.environ.get(name, ""))).is_absolute():
            return base / "tractexp"
    try:
        return Path.home() / ".cache" / "tractexp"
    except RuntimeError:
        return None


def _explain_unfit(folder: Path, private: bool = False) -> str:
    """Why a folder, created where there is none, cannot hold the store; "" where it can.

    `private`: one of ours that others can read, as an older version created it, is closed to them.
    """
    try:
        _create(folder)
        if hasattr(os, "geteuid"):  # Windows keeps a user's folders by other means
            if reason := _explain_writable(folder.resolve()) or _explain_reachable(folder):
                return reason
            if private and stat.S_IMODE(folder.stat().st_mode) != stat.S_IRWXU:
                folder.resolve().chmod(stat.S_IRWXU)
    except (OSError, ValueError) as error:
        return f"it cannot be made or looked at ({getattr(error, 'strerror', None) or error})"
    return "" if os.access(folder, os.W_OK | os.X_OK) else "it cannot be written to"


def _find_stranger(folder: Path, name: str, state: os.stat_result, entry: os.stat_result) -> str:
    """Why others have or could put something there by a name, in a folder that they can write to;
    "" where only its owner can.
    """
    if not state.st_mode & stat.S_ISVTX:
        who = "every user" if state.st_mode & stat.S_IWOTH else "a group"
        return f"{who} can put another in its place, since {who} can write to {folder}"
    if entry.st_uid not in (0, os.geteuid()):
        return f"another user has put {folder / name} there"
    return ""


def _explain_reachable(folder: Path) -> str:
    """Why others could put another folder in this one's place, "" where nobody can: of all that its
    path leads through.

    That is every folder in which one of its parts is looked up, before and behind each link.
    """
    here, parts, links = Path(folder.absolute().anchor), [*folder.absolute().parts[1:]], 0
    while parts:
        part = parts.pop(0)
        state, entry = here.stat(), (here / part).lstat()
        if state.st_uid not in (0, os.geteuid()):
            return f"another user can put another in its place, since {here} is theirs"
        if _may_others_write(state) and (why := _find_stranger(here, part, state, entry)):
            return why
        if stat.S_ISLNK(entry.st_mode):
            links += 1
            if links > MOST_LINKS:
                return "its links lead nowhere"
            target = Path(os.readlink(here / part))
            parts[:0] = target.parts[1:] if target.is_absolute() else target.parts
            here = Path(target.anchor) if target.is_absolute() else here
        else:
            here = here.parent if part == ".." else here / part
    return ""


def _explain_writable(folder: Path) -> str:
    """Why others could write into the store itself, or to one of its kinds; "" where nobody can."""
    if folder.stat().st_uid != os.geteuid():
        return "it belongs to another user"
    if folder.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "other users can write to it"
    for kind in KINDS:
        path = folder / kind
        if not os.path.lexists(path):
            continue
        state = path.lstat()
        if not stat.S_ISDIR(state.st_mode):
            return f"{path} is a link or a file, and no folder"
        if state.st_uid != os.geteuid() or state.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return f"other users can write to {path}"
    return ""


def _may_others_write(state: os.stat_result) -> bool:
    """Whether others may write there: all of them, or those of a group that is not the user's
    alone.
    """
    return bool(state.st_mode & stat.S_IWOTH) or (
        bool(state.st_mode & stat.S_IWGRP) and not _is_private_group(state.st_gid)
    )


@functools.cache
def _is_private_group(number: int) -> bool:
    """Whether a group is the one that many systems make for a user, of the same name and with
    nobody else in it.
    """
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(number), pwd.getpwuid(os.geteuid())
    except KeyError:
        return False
    return (
        group.gr_name == user.pw_name
        and user.pw_gid == number
        and set(group.gr_mem) <= {user.pw_name}
    )


def _create(folder: Path) -> None:
    """Create a folder where there is none, and those above it, closed to others
    whatever the umask.
    """
    if not folder.parent.is_dir():
        _create(folder.parent)
    folder.mkdir(mode=0o700, exist_ok=True)


def _make_temporary(reason: str) -> Path:
    """A folder of this process, and of those that it starts, which goes when it ends."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="tractexp-"))
    except OSError as error:
        raise UserError(
            f"kernels can be kept nowhere ({reason}; {error.strerror}); set {CHOICE} to a folder"
            " you can write to"
        ) from error
    print(
        f"tractexp: kernels are compiled anew for every command ({reason}); set {CHOICE} to a"
        " folder of your own",
        file=sys.stderr,
    )
    os.environ[CHOICE] = str(folder)
    owner = os.getpid()
    atexit.register(
        lambda: shutil.rmtree(folder, ignore_errors=True) if os.getpid() == owner else None
    )
    return folder
