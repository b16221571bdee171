"""Files within a .zip, by paths such as record.zip/a.cfg: read where they are, and nothing is
unpacked to the disk.

`tractexp/storage/files.py` alone asks here; it reads a file of an archive as it reads one of a
folder.
"""

import contextlib
import functools
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import IO

from tractexp.errors import UserError

ENDING = ".zip"
LARGEST_ZIP = 1 << 30  # bytes of an archive
LARGEST_DIRECTORY = 1 << 20  # bytes of its table of contents: thousands of files
MOST_MEMBERS = 2000  # files in it
LARGEST_MEMBER = 512 << 20  # bytes of one, unpacked
LARGEST_WHOLE = 2 << 30  # bytes of all, unpacked
# times that a member may unpack to, beyond so many bytes: no samples of an instrument do
LARGEST_RATIO, LEAST_BOMB = 300, 32 << 20
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # whose reader ends at the size stated
END = struct.Struct("<4s4H2LH")  # of central directory: signature, ..., its bytes, its place, ...
LONGEST_END = END.size + (1 << 16)
END_MARK, WIDE_MARK = b"PK\x05\x06", b"PK\x06\x07"
DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, struct.error)


def locate(path: Path | str) -> tuple[Path, str] | None:
    """The archive, and the name within it, of a path that leads into a .zip; None of any other
    path.
    """
    if ENDING not in str(path).lower():
        return None
    whole = Path(path)
    for archive in whole.parents:
        if archive.suffix.lower() == ENDING and archive.is_file():
            return archive, whole.relative_to(archive).as_posix()
    return None


def is_called_archive(path: Path | str) -> bool:
    """Whether a path is called as a .zip is, and is no folder."""
    return Path(path).suffix.lower() == ENDING and not Path(path).is_dir()


def is_archive(path: Path | str) -> bool:
    """Whether a file is called as a .zip is, and there."""
    return is_called_archive(path) and Path(path).is_file()


def list_members(archive: Path) -> Mapping[str, zipfile.ZipInfo]:
    """The files in an archive by their names, without folders, links and hidden files.

    Raises `UserError` for what is no .zip, is encrypted, or unpacks to more than any record has.
    """
    try:
        state = archive.stat()
        return _list_members_of_state(str(archive), state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise UserError(f"{archive} cannot be read: {error.strerror or error}") from error


@functools.lru_cache(maxsize=64)
def _list_members_of_state(path: str, changed: int, size: int) -> Mapping[str, zipfile.ZipInfo]:
    """Those of an archive in the state it has."""
    stated = _check_directory(path, size)
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
    except (*DAMAGE, ValueError) as error:
        raise UserError(f"{path}: not a whole .zip ({error}); get it again") from error
    if len(entries) != stated:
        raise UserError(
            f"{path}: not a whole .zip: it says that it has {stated} files, and lists"
            f" {len(entries)}; get it again"
        )
    found = {
        name: entry
        for entry in entries
        if (name := _name(entry)) and not entry.is_dir() and not _is_link(entry)
    }
    _check_sizes(path, found)
    return found


def _check_directory(path: str, size: int) -> int:
    """How many files an archive says it has; raises `UserError` where its table of contents is
    missing, or too large to be read at all.
    """
    if size > LARGEST_ZIP:
        raise UserError(
            f"{path} has {size / 1e6:.4g} MB, and a .zip that is read at most"
            f" {LARGEST_ZIP / 1e6:.4g} MB: extract it, and give a file of it"
        )
    with open(path, "rb") as file:
        file.seek(max(0, size - LONGEST_END))
        tail = file.read(LONGEST_END)
    at = tail.rfind(END_MARK)
    if at < 0 or len(tail) - at < END.size:
        raise UserError(f"{path}: not a whole .zip: it has no table of contents; get it again")
    stated, directory = END.unpack_from(tail, at)[4:6]
    if directory > LARGEST_DIRECTORY or tail[max(0, at - 20) : at].startswith(WIDE_MARK):
        raise UserError(
            f"{path} lists more files than records have, at most {MOST_MEMBERS}: extract it, and"
            " give a file of it"
        )
    return stated


def _check_sizes(path: str, found: Mapping[str, zipfile.ZipInfo]) -> None:
    """Raise `UserError` for files that are too many or too large, or cannot be unpacked."""
    if len(found) > MOST_MEMBERS:
        raise UserError(
            f"{path} holds {len(found)} files, and a .zip that is read at most {MOST_MEMBERS}:"
            " extract it, and give its folder"
        )
    for name, entry in found.items():
        large = max(entry.compress_size, 1) * LARGEST_RATIO < entry.file_size > LEAST_BOMB
        if entry.flag_bits & 1:
            raise UserError(
                f"{path}: '{name}' is encrypted: extract it with its password, and give the file"
            )
        if entry.file_size > LARGEST_MEMBER or large:
            raise UserError(
                f"{path}: '{name}' has {entry.file_size / 1e6:.4g} MB, packed as"
                f" {entry.compress_size / 1e6:.3g} MB, and at most {LARGEST_MEMBER / 1e6:.4g} MB"
                f" and {LARGEST_RATIO} times are read: extract it, and give the file"
            )
    whole = sum(entry.file_size for entry in found.values())
    if whole > LARGEST_WHOLE:
        raise UserError(
            f"{path} holds {whole / 1e6:.4g} MB, and at most {LARGEST_WHOLE / 1e6:.4g} MB are read:"
            " extract it, and give its folder"
        )


def _name(entry: zipfile.ZipInfo) -> str:
    """The path of a file within its archive; "" of one that is hidden, or would lie elsewhere."""
    name = entry.filename
    if not entry.flag_bits & 0x800:  # no UTF-8 said: what the packer's computer writes
        with contextlib.suppress(UnicodeError):
            name = _decode(name.encode("cp437"))
    parts = PurePosixPath(name.replace("\\", "/").lstrip("/")).parts
    hidden = any(part.startswith(".") or part == "__MACOSX" for part in parts)
    odd = not name.isprintable() or any(":" in part for part in parts)
    return "" if hidden or odd else "/".join(parts)


def _decode(raw: bytes) -> str:
    """A name in the encoding that it most likely has."""
    for encoding in ("utf-8", "gbk"):
        with contextlib.suppress(UnicodeError):
            return raw.decode(encoding)
    return raw.decode("cp437")


def _is_link(entry: zipfile.ZipInfo) -> bool:
    """Whether an entry is a symbolic link."""
    return stat.S_ISLNK(entry.external_attr >> 16)


def read_size(archive: Path, name: str) -> int:
    """Bytes of a file, unpacked. Raises `UserError` as `list_members`, `FileNotFoundError` where it
    is not there.
    """
    return _find_entry(archive, name).file_size


def _find_entry(archive: Path, name: str) -> zipfile.ZipInfo:
    """The entry of that name. Raises FileNotFoundError where there is none."""
    entry = list_members(archive).get(name)
    if entry is None:
        raise FileNotFoundError(2, "there is no such file", os.path.join(archive, name))
    return entry


@contextlib.contextmanager
def open_member(archive: Path, name: str) -> Iterator[IO[bytes]]:
    """A file of an archive, open to be read; raises `UserError` where it is damaged, and as `size`.

    It ends at the size that the archive states, and fails where its sum is another.
    """
    entry = _find_entry(archive, name)
    if entry.compress_type not in METHODS:
        raise UserError(
            f"{archive}: '{name}' is packed in a way that is not read here (method"
            f" {entry.compress_type}); extract it, and give the file"
        )
    try:
        with zipfile.ZipFile(archive) as opened, opened.open(entry) as file:
            yield file
    except DAMAGE as error:
        raise UserError(
            f"{archive}: '{name}' is damaged: it is not what the archive states; get it again"
        ) from error
