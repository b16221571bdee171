"""The folder in which kernels are kept, and its files, of which none is used that was not written there whole.

What is read from it becomes code of this process. Two things make that safe. Nobody but its user can write to the
folder, nor put another in its place. And each file begins with the SHA-256 of its own name and content: one that is
damaged, cut, exchanged or put there by another program is none, and is made anew. The sums alone would not keep anyone
out, who could write them too; that is what the folder is for.
"""

import atexit
import contextlib
import hashlib
import hmac
import os
import shutil
import stat
import sys
import tempfile
from pathlib import Path

from tractexp import files
from tractexp.errors import UserError

CHOICE = "TRACTEXP_CACHE_DIR"
SUM = hashlib.sha256().digest_size  # bytes a file begins with


def cache_folder() -> Path:
    """Where kernels are kept: $TRACTEXP_CACHE_DIR, else `tractexp` in the user's cache folder, else a temporary one.

    Raises `UserError` where the folder chosen cannot be written to, or can by others.
    """
    if chosen := os.environ.get(CHOICE):
        if reason := _unfit(Path(chosen)):
            raise UserError(
                f"{CHOICE}={chosen} cannot keep kernels: {reason}; choose a folder of your own, such as a new one"
            )
        return Path(chosen)
    usual = _usual()
    reason = _unfit(usual, private=True) if usual else "no home folder is known"
    return usual if usual and not reason else _temporary(f"{usual or CHOICE}: {reason}")


def read(path: Path) -> bytes | None:
    """The content of a file as `write` left it; None where there is none, or another."""
    try:
        held = path.read_bytes()
    except OSError:
        return None
    content = held[SUM:]
    return content if hmac.compare_digest(held[:SUM], _sum(path, content)) else None


def write(path: Path, content: bytes) -> None:
    """Keep a file, whole or not at all; where that is impossible, it is made again next time."""
    with contextlib.suppress(OSError, UserError):
        path.parent.mkdir(mode=0o700, exist_ok=True)
        files.write(path, _sum(path, content) + content, lasting=False)


def _sum(path: Path, content: bytes) -> bytes:
    return hashlib.sha256(path.name.encode() + b"\0" + content).digest()


def _usual() -> Path | None:
    """`tractexp` in the user's cache folder; None where no home is known."""
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        if (told := Path(os.environ.get(name, ""))).is_absolute():
            return told / "tractexp"
    try:
        return Path.home() / ".cache" / "tractexp"
    except RuntimeError:
        return None


def _unfit(folder: Path, private: bool = False) -> str:
    """Why a folder, made where there is none, cannot keep kernels; "" where it can.

    `private`: one of ours that others can read, as an older version made it, is closed to them.
    """
    try:
        _make(folder)
        place = folder.resolve()
        found = place.stat()
        if hasattr(os, "geteuid"):  # Windows keeps a user's folders by other means
            if found.st_uid != os.geteuid():
                return "it belongs to another user"
            if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                return "other users can write to it"
            for parent in place.parents:
                mode = parent.stat().st_mode
                if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
                    return f"every user can put another in its place, since every user can write to {parent}"
            if private and stat.S_IMODE(found.st_mode) != stat.S_IRWXU:
                place.chmod(stat.S_IRWXU)
    except (OSError, ValueError) as error:
        return f"it cannot be made or looked at ({getattr(error, 'strerror', None) or error})"
    return "" if os.access(folder, os.W_OK | os.X_OK) else "it cannot be written to"


def _make(folder: Path) -> None:
    """Make a folder where there is none, and those above it, closed to others whatever the umask."""
    if not folder.parent.is_dir():
        _make(folder.parent)
    folder.mkdir(mode=0o700, exist_ok=True)


def _temporary(reason: str) -> Path:
    """A folder of this process, and of those that it starts, which goes when it ends."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="tractexp-"))
    except OSError as error:
        raise UserError(
            f"kernels can be kept nowhere ({reason}; {error.strerror}); set {CHOICE} to a folder you can write to"
        ) from error
    print(
        f"tractexp: kernels are compiled anew for every command ({reason}); set {CHOICE} to a folder of your own",
        file=sys.stderr,
    )
    os.environ[CHOICE] = str(folder)
    maker = os.getpid()
    atexit.register(lambda: shutil.rmtree(folder, ignore_errors=True) if os.getpid() == maker else None)
    return folder
