"""A writer of PQDIF files for tests, from the layout of IEEE 1159.3: trees of (tag, content) in
records with links.
"""

import struct
import uuid
import zlib
from datetime import datetime

import numpy as np

KINDS = {"waveform": "67f6af80", "phasor": "67f6af81", "log": "67f6af82"}
NUMBERS = {"<i2": 21, "<i4": 22, "<u4": 32, "<f4": 40, "<f8": 41}
MEASURED = {"V": 1, "A": 2, "W": 3, "var": 3, "Hz": 1}
UNITS = {"s": 2, "cycles": 3, "V": 6, "A": 7, "W": 9, "var": 10, "Hz": 15, "deg": 17}
IN_RMS, INSTANTANEOUS = (
    "a6b31ae5-b451-11d1-ae17-0060083a2628",
    "a6b31add-b451-11d1-ae17-0060083a2628",
)


def guid(text, family="f753"):
    full = text if text.count("-") == 4 else f"{text}-{family}-11cf-9d89-0080c72e70a3"
    return uuid.UUID(full).bytes_le


def scalar(tag, type_, raw, inside=True):
    return tag, "scalar", type_, raw, inside


def uint(tag, value):
    return scalar(tag, 32, struct.pack("<I", value))


def real(tag, value):
    return scalar(tag, 41, struct.pack("<d", value))


def identifier(tag, value):
    return scalar(tag, 60, value, inside=False)


def moment(tag, when, day=1):
    """A time: Excel's day and the second of it."""
    since = when - datetime(1899, 12, 30)
    second = since.seconds + 1e-6 * since.microseconds
    return scalar(tag, 50, struct.pack("<Id", since.days * day, second), inside=False)


def text(tag, letters):
    raw = letters.encode() + b"\0"
    return tag, "vector", 10, raw, len(raw)


def vector(tag, values, dtype):
    raw = np.asarray(values, dtype).tobytes()
    return tag, "vector", NUMBERS[dtype], raw, len(values)


def collection(tag, elements):
    return tag, "collection", 0, list(elements), 0


def body(elements):
    """The bytes of a record's body: collections first, then what they link to, each at a multiple
    of four.
    """
    made = bytearray()

    def room(size):
        at = len(made)
        made.extend(bytes(size + (-size % 4)))
        return at

    def put(elements):
        at = room(4 + 28 * len(elements))
        struct.pack_into("<i", made, at, len(elements))
        for k, (tag, kind, type_, content, more) in enumerate(elements):
            entry = at + 4 + 28 * k
            made[entry : entry + 16] = tag
            if kind == "collection":
                link, size, number, inside = put(content), 0, 1, 0
            elif kind == "scalar" and more:
                made[entry + 16 : entry + 19] = bytes((2, type_, 1))
                made[entry + 20 : entry + 28] = content.ljust(8, b"\0")
                continue
            else:
                raw = content if kind == "scalar" else struct.pack("<i", more) + content
                link, size, number, inside = (
                    room(len(raw)),
                    len(raw),
                    2 if kind == "scalar" else 3,
                    0,
                )
                made[link : link + len(raw)] = raw
            made[entry + 16 : entry + 19] = bytes((number, type_, inside))
            struct.pack_into("<ii", made, entry + 20, link, size)
        return at

    put(elements)
    return bytes(made)


def file(records, compressed=True):
    """The bytes of a file of [(tag of the record, elements)], the container before them."""
    style = (
        [uint(guid("8973861b", "f1c3"), 2), uint(guid("8973861c", "f1c3"), 1)] if compressed else []
    )
    container = [text(guid("89738608", "f1c3"), "made.pqd"), *style]
    made = b""
    every = [(guid("89738606", "f1c3"), container), *records]
    for k, (tag, elements) in enumerate(every):
        content = body(elements)
        content = zlib.compress(content) if compressed and k else content
        following = 0 if k == len(every) - 1 else len(made) + 64 + len(content)
        signature = guid("4a111440-e49f-11cf-9900-505144494600")
        made += (
            signature
            + tag
            + struct.pack("<iiiI", 64, len(content), following, zlib.adler32(content))
        )
        made += bytes(16) + content
    return made


def definition(
    name, phase, unit, kind="waveform", scaled=True, time="s", group="", characteristic=None
):
    """One channel: a series of times, counted, and one of values."""
    rms = characteristic or (INSTANTANEOUS if kind == "waveform" else IN_RMS)
    series = [
        ("c690e862", "f755", time, IN_RMS, 4),
        ("67f6af97", "f753", unit, rms, 3 if scaled else 1),
    ]
    listed = [
        collection(
            guid("b48d859a", "f5f5"),
            [
                uint(guid("b48d859b", "f5f5"), UNITS[of]),
                identifier(guid("3d786f9e", "f76e"), guid(what)),
                identifier(guid("b48d859c", "f5f5"), guid(value, family)),
                uint(guid("b48d85a1", "f5f5"), stored),
            ],
        )
        for value, family, of, what, stored in series
    ]
    return collection(
        guid("b48d858e", "f5f5"),
        [
            text(guid("b48d8590", "f5f5"), name),
            uint(guid("b48d8591", "f5f5"), phase),
            *([text(guid("b48d8594", "f5f5"), group)] if group else []),
            uint(guid("c690e872", "f755"), MEASURED[unit]),
            identifier(guid("b48d8592", "f5f5"), guid(KINDS[kind])),
            collection(guid("b48d8598", "f5f5"), listed),
        ],
    )


def source(*definitions, name="Substation"):
    listed = collection(guid("b48d858d", "f5f5"), definitions)
    return guid("89738619", "f1c3"), [text(guid("b48d8587", "f5f5"), name), listed]


def settings(frequency=50.0, ratios=(), use=True):
    """Monitor settings; `ratios` {number of the channel: (primary, secondary)}."""
    listed = [
        collection(
            guid("3d786f9a", "f76e"),
            [
                uint(guid("b48d858f", "f5f5"), number),
                real(guid("62f2818a", "f9c4"), primary),
                real(guid("62f2818b", "f9c4"), secondary),
            ],
        )
        for number, (primary, secondary) in dict(ratios).items()
    ]
    return guid("b48d858c", "f5f5"), [
        scalar(guid("62f28181", "f9c4"), 3, struct.pack("<I", use)),
        real(guid("0fa118c3-cb4a-11d2-b30b-fe25cb9a1760"), frequency),
        collection(guid("62f28182", "f9c4"), listed),
    ]


def instance(number, times, values, scale=1.0, offset=0.0, dtype="<i2"):
    """One channel of an observation. `times` are [runs, count, step, ...], or the number of a
    channel to share.
    """
    clock = (
        [vector(guid("3d786f99", "f76e"), times, "<f8")]
        if isinstance(times, list)
        else [uint(guid("8973861f", "f1c3"), times), uint(guid("89738620", "f1c3"), 0)]
    )
    value = [
        vector(guid("3d786f99", "f76e"), values, dtype),
        real(guid("3d786f96", "f76e"), scale),
        real(guid("3d786f97", "f76e"), offset),
    ]
    series = [collection(guid("3d786f94", "f76e"), each) for each in (clock, value)]
    return collection(
        guid("3d786f92", "f76e"),
        [uint(guid("b48d858f", "f5f5"), number), collection(guid("3d786f93", "f76e"), series)],
    )


def observation(when, *instances, triggered=None, name="event"):
    return guid("8973861a", "f1c3"), [
        text(guid("3d786f8a", "f76e"), name),
        moment(guid("3d786f8c", "f76e"), when),
        *([moment(guid("3d786f8e", "f76e"), triggered)] if triggered else []),
        collection(guid("3d786f91", "f76e"), instances),
    ]
