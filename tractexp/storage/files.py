"""Paths of files, how others' files are read, and the only way in which the package writes: whole,
or not at all.

Nothing else in the package opens a file to write. What a job prints, which grows, has its own way
in.
"""

import contextlib
import dataclasses
import errno
import importlib.resources
import io
import itertools
import json
import math
import os
import re
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from tractexp.errors import UserError
from tractexp.storage import zip_archive
from tractexp.storage.time_limit import grant_time
from tractexp.storage.zip_archive import is_archive as is_archive
from tractexp.storage.zip_archive import is_called_archive as is_called_archive

PACKAGE = "pkg://"  # starts the path of a file inside an installed package
PART = ".tractexp.part"  # ends the name of a file that is being written
# that name: nobody else gives a file such a one
OWN = re.compile(r"\..*\.[a-z0-9_]{8}" + re.escape(PART), re.DOTALL)
LARGEST = 2 << 30  # bytes of a file that is read at once: a record
CONFIGURATION, RESULT = 4 << 20, 128 << 20  # bytes of what a run reads, and leaves
ODD = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def locate_file(path: str) -> Path:
    """The path of a file that may be named as `pkg://package/file`; raises `UserError` for an
    unknown package.
    """
    if not path.startswith(PACKAGE):
        return Path(path)
    package, _, name = path.removeprefix(PACKAGE).partition("/")
    try:
        return Path(str(importlib.resources.files(package))) / name
    except (ImportError, ValueError, TypeError) as error:
        raise UserError(f"{path}: there is no installed package '{package}'") from error


def read_packaged_text(name: str) -> str:
    """The text of a file that the package brings along, such as `blocks/chart.js`."""
    return (Path(__file__).parents[1] / name).read_text(encoding="utf-8")


def is_there(path: Path | str) -> bool:
    """Whether there is an ordinary file; raises `UserError` for what only seems to be one, and for
    no name of a file.

    To open a named pipe waits for ever, a device may have no end, and a name that is no text can be
    stored nowhere.
    """
    name = str(path)
    if len(name.splitlines()) > 1:
        raise UserError(f"{name}: this name has a line break; rename the file")
    try:
        os.fsencode(name).decode()
        kind = stat.S_IFMT(os.stat(path).st_mode)
    except UnicodeError:
        raise UserError(f"{name}: this name is no UTF-8 text; rename the file") from None
    except (FileNotFoundError, NotADirectoryError):
        if os.path.islink(path):
            raise UserError(f"{name} is a link that leads nowhere; give the file itself") from None
        packed = zip_archive.locate(path)
        return packed is not None and packed[1] in zip_archive.list_members(packed[0])
    except (OSError, ValueError) as error:
        raise UserError(
            f"{name:.200} cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error
    if kind in ODD:
        raise UserError(
            f"{name} is {ODD[kind]}, no ordinary file; write what it holds to a file, and give that"
        )
    return kind == stat.S_IFREG


def check_there(path: Path) -> None:
    """Raise `UserError` where there is no ordinary file."""
    if not is_there(path):
        raise UserError(
            f"{path} is a folder, not a file" if path.is_dir() else f"{path}: there is no such file"
        )


def read(path: Path | str, limit: int | None = None, *, largest: int = LARGEST) -> bytes:
    """The content of an ordinary file, or its first bytes to a limit.

    Parameters
    ----------
    path : Path or str
        Of a file, or of one in a .zip.
    limit : int or None
        Bytes that are read; None: all.
    largest : int
        Bytes that a file has at most.

    Returns
    -------
    bytes

    Raises
    ------
    UserError
        For what is no ordinary file, is larger than `largest` or cannot be read.
    FileNotFoundError
        Where it is missing.
    """
    try:
        with open_ordinary_file(path) as file:
            bytes_there = read_size(path)
            if limit is None and bytes_there > largest:
                size_and_most = (
                    f"{bytes_there / 1e6:.4g} MB, and a file of its kind at most"
                    f" {largest / 1e6:.4g} MB"
                )
                raise UserError(f"{path} has {size_and_most}: give a part")
            return file.read(-1 if limit is None else limit)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from error


@contextlib.contextmanager
def open_ordinary_file(path: Path | str) -> Iterator[IO[bytes]]:
    """An ordinary file, or one in a .zip, open to be read. Raises `UserError` for what only seems
    to be one, `OSError` as `open`.
    """
    is_there(path)
    grant_time(read_size(path))
    if packed := zip_archive.locate(path):
        with zip_archive.open_member(*packed) as file:
            yield file
        return
    with open(path, "rb", opener=_open_at_once) as file:
        kind = stat.S_IFMT(os.fstat(file.fileno()).st_mode)
        if kind in ODD:  # put in the place of a file meanwhile
            raise UserError(f"{path} is {ODD[kind]}, no ordinary file")
        yield file


def read_size(path: Path | str) -> int:
    """Bytes of a file, or of one in a .zip. Raises `OSError` where it is missing."""
    packed = zip_archive.locate(path)
    return zip_archive.read_size(*packed) if packed else os.stat(path).st_size


def list_folder(folder: Path) -> list[Path]:
    """The paths in a folder, or those of the files of one in a .zip, in order of name; [] where it
    is none.

    Raises `UserError` for a .zip that cannot be read.
    """
    packed = zip_archive.locate(folder / "file")
    if packed is None:
        return sorted(folder.iterdir()) if folder.is_dir() else []
    return [path for path in list_packed(packed[0]) if path.parent == folder]


def list_packed(archive: Path) -> list[Path]:
    """All files in a .zip, in order of name. Raises `UserError` for one that cannot be read."""
    return sorted(archive / name for name in zip_archive.list_members(archive))


def read_state(path: Path | str) -> tuple[int, int]:
    """(bytes, time of the last change [ns]) of a file; of one in a .zip, when that was changed.

    Raises `OSError` where it is missing.
    """
    packed = zip_archive.locate(path)
    return read_size(path), os.stat(packed[0] if packed else path).st_mtime_ns


def is_packed(path: Path | str) -> bool:
    """Whether a path leads into a .zip, so that nothing can be mapped from the disk."""
    return zip_archive.locate(path) is not None


def exists(path: Path | str) -> bool:
    """Whether there is a file or a folder of that name, also in a .zip; raises nothing."""
    try:
        return os.path.exists(path) or is_there(path)
    except (UserError, OSError, ValueError):
        return False


def _open_at_once(path: str, flags: int) -> int:
    """Open without waiting for the other end of a named pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def read_text(path: Path | str, largest: int = LARGEST) -> str:
    """The text of an ordinary file in UTF-8. Raises `UserError` for what is none, and as `read`."""
    try:
        return read(path, largest=largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: byte {error.start + 1} is not UTF-8 text") from error


def read_json(path: Path | str, largest: int = RESULT) -> Any:
    """The content of a JSON file. Raises `UserError` for what is none, and as `read`."""
    try:
        text = read(path, largest=largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(
            f"{path}: byte {error.start + 1} is not UTF-8 text; JSON is written in UTF-8"
        ) from error
    return parse_json(text, path)


def parse_json(text: str, path: Path | str) -> Any:
    """The content of a text in JSON that came from `path`. Raises `UserError` for what is none."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise UserError(f"{path}: line {error.lineno}: not valid JSON ({error.msg})") from error
    except RecursionError as error:
        raise UserError(
            f"{path}: its brackets lie deeper within one another than can be read"
        ) from error
    except ValueError as error:  # what Python's reader of whole numbers refuses
        raise UserError(f"{path}: a whole number in it has more digits than can be read") from error


def write(
    path: Path | str, content: str | bytes, *, lasting: bool = True, private: bool = False
) -> Path:
    """Write a file in one move: a reader never sees half of it, and a full disk leaves none.

    Parameters
    ----------
    path : Path or str
        Where it is written; its folder is created if need be.
    content : str or bytes
        Text is written as UTF-8.
    lasting : bool
        Whether it has reached the disk when this returns, and outlives a loss of power; a cache or
        a log need not wait for that.
    private : bool
        Whether nobody else can read it.

    Returns
    -------
    Path

    Raises
    ------
    UserError
        Where the folder or the file cannot be written.
    """
    path = Path(path)
    with raise_as_user_error(path), _make_part_file(path) as temporary:
        _fill(temporary, encode_text(content), lasting, private)
        os.replace(temporary, path)
        if lasting:
            _settle(path.parent)
    return path


def encode_text(content: str | bytes) -> bytes:
    """Text as UTF-8; half a character, as in a name that is no text, becomes its escape."""
    return content.encode(errors="backslashreplace") if isinstance(content, str) else content


def copy(source: Path | str, target: Path | str) -> Path:
    """Copy a file, whole or not at all. Raises `UserError` where it cannot be read or written."""
    with raise_as_user_error(Path(target)):
        content = Path(source).read_bytes()
    return write(target, content)


def move(source: Path | str, target: Path | str) -> Path:
    """Give a file that is whole its place, in one move within a disk. Raises `UserError` where that
    is impossible.
    """
    target = Path(target)
    with raise_as_user_error(target):
        os.replace(source, target)
        _settle(target.parent)
    return target


class Transcript(io.TextIOBase):
    """A program's output, into a file: where that cannot be written, as on a full disk, only the
    output is lost.
    """

    def __init__(self, path: Path):
        """Write to a file where it can be opened; elsewhere what is written is lost in silence."""
        super().__init__()
        try:
            self._file: IO[str] | None = path.open("w", encoding="utf-8", buffering=1)
        except OSError:
            self._file = None

    def write(self, text: str) -> int:
        """Write a text and return its length; a full disk is no error of the run."""
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.write(text)
        return len(text)

    def flush(self) -> None:
        """Hand what was written to the system."""
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.flush()

    def close(self) -> None:
        """Close the file; closing twice does nothing."""
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
        self._file = None
        super().close()


def make_new_folder(path: Path) -> Path:
    """A folder that was not there: of this name, or with a number behind it. Raises `UserError`
    where it cannot be.
    """
    with raise_as_user_error(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        for k in itertools.count(1):
            named = path if k == 1 else path.with_name(f"{path.name}_{k}")
            with contextlib.suppress(FileExistsError):
                named.mkdir()
                return named
    raise AssertionError("numbers end nowhere")


def is_inside(path: Path, folder: Path) -> bool:
    """Whether a file or folder, with everything below it, lies below another folder, wherever links
    lead; pipes do not.
    """
    whole = folder.resolve()
    try:
        every = [path, *path.rglob("*")] if path.is_dir() else [path]
        return all(
            one.resolve().is_relative_to(whole) and (one.is_file() or one.is_dir()) for one in every
        )
    except (OSError, RuntimeError, ValueError):  # a link to itself; a name that is none
        return False


def find_leftovers(folder: Path) -> list[Path]:
    """Partial files of killed processes of ours in `folder` and below, those of the last hour
    apart.
    """
    now = time.time()
    halves = []
    for path in folder.rglob(f"*{PART}"):
        with contextlib.suppress(OSError):
            ours = OWN.fullmatch(path.name) and path.is_file() and not path.is_symlink()
            if ours and now - path.stat().st_mtime > 3600:
                halves.append(path)
    return halves


@contextlib.contextmanager
def raise_as_user_error(path: Path) -> Iterator[None]:
    """Within it, what the system refuses is a `UserError` that names the path."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{path} cannot be written: {error.strerror or error}") from error


@contextlib.contextmanager
def _make_part_file(path: Path) -> Iterator[Path]:
    """A new file in the folder of `path`, which is created if need be; the file is removed at the
    end.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:100]}.", suffix=PART)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def _fill(temporary: Path, data: bytes, lasting: bool, private: bool) -> None:
    """Write a temporary file whole: to the disk where it must be `lasting`, closed to others where
    it is `private`.
    """
    with temporary.open("wb") as file:
        file.write(data)
        file.flush()
        if lasting:
            os.fsync(file.fileno())
    if not private:  # as a temporary file is
        os.chmod(temporary, 0o666 & ~_read_umask())


def _settle(folder: Path) -> None:
    """Let a folder's own entries reach the disk, where the system can."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        # a file system that knows no such thing
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)


def write_json(path: Path | str, content: Any, *, private: bool = False) -> Path:
    """Write JSON that any reader takes: numbers that do not exist (nan, infinity) become null."""
    text = json.dumps(make_plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return write(path, text, private=private)


def make_plain(content: Any) -> Any:
    """Content as JSON knows it.

    Dataclasses, NumPy's arrays, tuples and paths are turned into plain ones, nan into None.
    """
    if isinstance(content, dict):
        return {str(key): make_plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [make_plain(value) for value in content]
    if hasattr(content, "tolist"):
        return make_plain(content.tolist())
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if dataclasses.is_dataclass(content) and not isinstance(content, type):
        return make_plain(dataclasses.asdict(content))
    return content if isinstance(content, int | bool | None) else encode_text(str(content)).decode()


def _read_umask() -> int:
    """The rights that this process takes from new files."""
    now = os.umask(0)
    os.umask(now)
    return now
