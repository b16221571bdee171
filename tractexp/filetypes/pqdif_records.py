"""The physical structure of a PQDIF file: records one after another, each a tree of tagged
elements.

A record has a header of 64 bytes, with the place of the next one, and a body, compressed or not,
that begins with a collection: a count, and for each element its tag (a GUID), its kind, its type,
and where in the body it lies.

Source: IEEE Std 1159.3-2019 (and -2003), clause on the physical structure.
"""

import struct
import uuid
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.remarks import Remarks
from tractexp.filetypes.text import decode
from tractexp.storage import files
from tractexp.text.wording import count_noun

SIGNATURE = uuid.UUID("4a111440-e49f-11cf-9900-505144494600").bytes_le
HEADER = struct.Struct("<16s16siiiI")
ENTRY = struct.Struct("<16sBBBxii")
HEADER_BYTES = 64
LARGEST = 256 * 2**20  # bytes of all bodies together, decompressed
MOST_RECORDS = 100_000
# of one record: compressed zeros may announce millions, each of which takes memory
MOST_ELEMENTS = 200_000
LONGEST_TEXT = 400  # letters of a text that are read
BYTE = np.dtype("u1")
COUNT = np.dtype("<i4")
COLLECTION, SCALAR, VECTOR = 1, 2, 3  # kinds of elements
MOMENT = np.dtype([("day", "<u4"), ("second", "<f8")])  # since 30 December 1899
TYPES = {
    1: "<u1",
    2: "<u2",
    3: "<u4",
    10: "S1",
    20: "<i1",
    21: "<i2",
    22: "<i4",
    30: "<u1",
    31: "<u2",
    32: "<u4",
    40: "<f4",
    41: "<f8",
    50: MOMENT,
    60: "V16",
}
ZLIB, PER_RECORD = 1, 2  # of the container's compression: the algorithm, the style


def tag(text: str) -> bytes:
    """A GUID, as files store it, of its usual spelling."""
    return uuid.UUID(text).bytes_le


CONTAINER = tag("89738606-f1c3-11cf-9d89-0080c72e70a3")
STYLE, ALGORITHM = (tag(f"8973861{digit}-f1c3-11cf-9d89-0080c72e70a3") for digit in "bc")


@dataclass(eq=False)
class Body:
    """The bytes of a record's body; `where` names file and record, `entries` counts the elements
    that were read.
    """

    data: bytes
    where: str
    encoding: str | None
    entries: int = 0

    def part(self, at: int, count: int, dtype: np.dtype = BYTE) -> np.ndarray:
        """A view of `count` values from a byte on. Raises `UserError` where the body has none
        there.
        """
        if at < 0 or count < 0 or at + count * dtype.itemsize > len(self.data):
            raise self.describe_damage(
                f"an element of {count} values lies at byte {at} of a body of {len(self.data)}"
            )
        return np.frombuffer(self.data, dtype, count, at) if count else np.empty(0, dtype)

    def describe_damage(self, why: str) -> UserError:
        """The error of a damaged file, with the place."""
        return UserError(
            f"{self.where}: {why}: the file is damaged; get it from the recorder again"
        )


class Collection:
    """The elements of a collection by their tags; what is not there, or of another kind, is None or
    empty.
    """

    def __init__(self, body: Body, at: int) -> None:
        """Raises `UserError` for what is no collection, and where more elements are read than the
        body can hold.
        """
        count = int(body.part(at, 1, COUNT)[0])
        body.entries += max(count, 0)
        if count < 0 or body.entries * ENTRY.size > len(body.data) or body.entries > MOST_ELEMENTS:
            raise body.describe_damage(
                f"a collection at byte {at} has {count} elements, more than fit into the record"
            )
        self.body = body
        self.entries = list(ENTRY.iter_unpack(body.part(at + 4, count * ENTRY.size).tobytes()))
        self.at = at

    def collections(self, name: bytes) -> Iterator["Collection"]:
        """The collections of one tag, in their order."""
        for each, kind, _, _, link, _ in self.entries:
            if each == name and kind == COLLECTION:
                yield Collection(self.body, link)

    def collection(self, name: bytes) -> "Collection | None":
        """The first collection of that name; None without."""
        return next(self.collections(name), None)

    def vectors(self, name: bytes) -> Iterator[np.ndarray]:
        """The vectors (N,) of one tag whose type holds numbers, letters or moments."""
        for each, kind, type_, _, link, _ in self.entries:
            if each == name and kind == VECTOR and type_ in TYPES:
                count = int(self.body.part(link, 1, COUNT)[0])
                yield self.body.part(link + 4, count, np.dtype(TYPES[type_]))

    def vector(self, name: bytes) -> np.ndarray | None:
        """The first vector of that name; None without."""
        return next(self.vectors(name), None)

    def texts(self, name: bytes) -> list[str]:
        """The texts of one tag, without what follows their end."""
        texts = [
            v[:LONGEST_TEXT].tobytes().partition(b"\0")[0]
            for v in self.vectors(name)
            if v.dtype.kind == "S"
        ]
        return [decode(each, self.body.where, self.body.encoding)[0].strip() for each in texts]

    def text(self, name: bytes) -> str:
        """The first text of that name; "" without."""
        return next(iter(self.texts(name)), "")

    def scalar(self, name: bytes) -> Any:
        """The value of a scalar, where it is one of the types above."""
        for k, (each, kind, type_, embedded, link, _) in enumerate(self.entries):
            if each != name or kind != SCALAR or type_ not in TYPES:
                continue
            dtype = np.dtype(TYPES[type_])
            # a value of up to eight bytes stands in place of the link
            own = self.at + 4 + ENTRY.size * k + 20
            inside = embedded and dtype.itemsize <= 8
            return self.body.part(own if inside else link, 1, dtype)[0]
        return None

    def number(self, name: bytes, default: float = 0.0) -> float:
        """A scalar that is a finite number, else `default`."""
        value = self.scalar(name)
        if value is None or value.dtype.kind not in "uif":
            return default
        return float(value) if np.isfinite(value) else default

    def identifier(self, name: bytes) -> bytes:
        """A scalar that is a GUID; b"" where there is none."""
        value = self.scalar(name)
        return (
            b""
            if value is None or value.dtype.kind != "V" or value.dtype.names
            else value.tobytes()
        )

    def moment(self, name: bytes) -> tuple[int, float] | None:
        """A scalar that is a time: the day since 30 December 1899, and the second of it."""
        value = self.scalar(name)
        if value is None or value.dtype.names is None or not np.isfinite(value["second"]):
            return None
        return int(value["day"]), float(value["second"])


def read_records(
    path: Path, encoding: str | None, remarks: Remarks
) -> Iterator[tuple[bytes, Collection]]:
    """(tag, body's collection) of each record after the container. Raises `UserError` for what is
    no PQDIF file.

    Remarks tell what no link between the records reaches.
    """
    data = files.read(path)
    if not data.startswith(SIGNATURE):
        raise UserError(
            f"{path}: this is no PQDIF file: it does not begin with the signature of a PQDIF record"
        )
    at, count, compressed, room, following = 0, 0, False, LARGEST, 0
    reached: dict[int, int] = {}
    while count < MOST_RECORDS:
        count += 1
        where = f"{path}: record {count}"
        stored = _read_stored(data, at, count, path, remarks)
        if stored is None:
            return
        reached[at], following = stored.end, stored.following
        body = _decompress_body(stored.content, room, where) if compressed else stored.content
        room -= len(body)
        if stored.checksum not in (0, *_list_checksums(stored.content, body)):
            remarks.add(
                f"record {count}: the checksum does not fit: it was altered, or damaged on its way"
            )
        if body:
            collection = Collection(Body(body, where, encoding), 0)
            if stored.kind == CONTAINER:
                compressed = _is_compressed(collection, where)
            else:
                yield stored.kind, collection
        if not 0 < following < len(data) or following in reached:
            break
        at = following
    _tell_link(count, following, len(data), reached, remarks)
    _tell_unreached(data, reached, remarks)


def _tell_link(
    count: int, following: int, size: int, reached: Mapping[int, int], remarks: Remarks
) -> None:
    """Remark on the last record that was read, whose link leads behind the end, or back."""
    if following > size:
        remarks.add(_describe_end("before", count + 1))
    elif following and following in reached:
        remarks.add(
            f"record {count} links back to byte {following}, a record that was read: a link is"
            " damaged"
        )


class _Stored(NamedTuple):
    """A record as the file holds it: its content compressed or not, the byte after it, and the
    first one of the record that it links to.
    """

    kind: bytes
    content: bytes
    checksum: int
    end: int
    following: int


def _read_stored(data: bytes, at: int, count: int, path: Path, remarks: Remarks) -> _Stored | None:
    """The record, the `count`-th, at a byte of the file; None, with a remark, where the file ends
    before or in it. Raises `UserError` where there is none.
    """
    if at + HEADER_BYTES > len(data):
        remarks.add(_describe_end("before", count))
        return None
    signature, kind, header, size, following, checksum = HEADER.unpack_from(data, at)
    if signature != SIGNATURE or header < HEADER_BYTES or size < 0:
        raise UserError(
            f"{path}: record {count}: byte {at} is no header of a record: the file is damaged; get"
            " it again"
        )
    end = at + header + size
    if len(data) < end and size:
        remarks.add(_describe_end("within", count))
        return None
    return _Stored(kind, data[at + header : end], checksum, end, following)


def _describe_end(where: str, count: int) -> str:
    """The remark on a file that ends "before" or "within" a record."""
    return f"the file ends {where} record {count}: it is not whole; what comes before is read"


def _list_checksums(content: bytes, body: bytes) -> Iterator[int]:
    """The checksums that writers give a record: Adler-32 or CRC-32, of its body compressed
    or not.
    """
    for data in (content, body):
        yield zlib.adler32(data)
        yield zlib.crc32(data)


def _tell_unreached(data: bytes, reached: Mapping[int, int], remarks: Remarks) -> None:
    """Remark on bytes that belong to no record that was read; `reached` {first byte of a record:
    its end}.

    Zeros fill a file up. Other bytes are records that a damaged link, or a deleted one, leaves out.
    """
    end = 0
    for first, stop in [*sorted(reached.items()), (len(data), len(data))]:
        if first > end and (between := data[end:first]).strip(b"\0"):
            found = between.count(SIGNATURE)
            what = count_noun(found, "record") if found else f"{len(between)} bytes"
            remarks.add(
                f"no link leads to {what} from byte {end} on: they are not read; where the recorder"
                " did not delete them, a link is damaged: get the file again"
            )
        end = max(end, stop)


def _is_compressed(container: Collection, where: str) -> bool:
    """Whether the records after the container are compressed, each by itself."""
    style = container.number(STYLE)
    algorithm = container.number(ALGORITHM)
    if not (style and algorithm):
        return False
    if (style, algorithm) != (PER_RECORD, ZLIB):
        raise UserError(
            f"{where}: compression style {style:g}, algorithm {algorithm:g}; read are {PER_RECORD}"
            f" (each record) with {ZLIB} (zlib), and no compression: save the file as PQDIF 1.5"
            " with the recorder's software"
        )
    return True


def _decompress_body(content: bytes, room: int, where: str) -> bytes:
    """The bytes of a compressed body. Raises `UserError` where it is damaged, or larger than
    `room`.
    """
    inflate = zlib.decompressobj()
    try:
        body = inflate.decompress(content, room + 1)
    except zlib.error as error:
        raise UserError(
            f"{where}: its compressed body is damaged; get the file from the recorder again"
        ) from error
    if len(body) > room:
        raise UserError(
            f"{where}: the file's records hold more than {LARGEST / 1e6:.0f} MB decompressed; give"
            " a part of it"
        )
    if not inflate.eof:
        raise UserError(
            f"{where}: its compressed body ends too early; get the file from the recorder again"
        )
    return body
