"""Damage that knows the structure of a file: `python benchmarks/structured_damage.py [--count
10000] [--first 0] [--seed 1]`.

Links, counts, types and emptiness are changed, with all around them sound; what is allowed is as in
mutated_files.py.

Bits that fall anywhere are mostly refused by the first check. These go behind it: compressed bodies
are unpacked, changed and packed again, archives rewritten.
"""

import functools
import io
import struct
import sys
import zipfile
import zlib

INTEGERS = (0, 1, -1, 2, 255, 65_535, 2**31 - 1, -(2**31), 1_000_000)
HEADER, ENTRY = struct.Struct("<16s16siiiI"), struct.Struct("<16sBBBxii")
COLLECTION = 1  # kind of an element


def restructured(paths, folder, rng):
    """The files of a record with one damaged structure in one of them; its path, and
    what was done.
    """
    for path in paths:
        (folder / path.name).write_bytes(path.read_bytes())
    target = paths[0 if len(paths) == 1 or rng.random() < 0.7 else 1]
    content, done = damage(target, rng) or (target.read_bytes(), "nothing")
    (folder / target.name).write_bytes(content)
    return folder / paths[0].name, f"{done} of {target.suffix}"


def choose(rng, options):
    return options[int(rng.integers(len(options)))]


def damage(path, rng):
    """(bytes of the damaged file, what was done) of a sound one, by its ending; None where nothing
    is known of it.
    """
    ways = {
        ".pqd": _pqdif,
        ".xlsx": _archive,
        ".zip": _directory,
        ".ods": _archive,
        ".cfg": _header,
        ".cff": _header,
        ".dat": _samples,
        ".cev": _report,
        ".parquet": _footer,
    }
    way = ways.get(path.suffix.lower())
    return way(path.read_bytes(), rng) if way else None


def _records(data):
    """Where the records of a PQDIF file begin."""
    starts = [0]
    while following := HEADER.unpack_from(data, starts[-1])[4]:
        starts.append(following)
    return starts


def _pqdif(data, rng):
    starts = _records(data)
    at = choose(rng, starts)
    if rng.random() < 0.4:
        field = choose(rng, [("header", 32), ("size", 36), ("link", 40), ("checksum", 44)])
        value = choose(rng, [*INTEGERS, *starts, at + 1, len(data), len(data) - 1])
        return data[: at + field[1]] + struct.pack("<i", value) + data[
            at + field[1] + 4 :
        ], f"{field[0]} {value}"
    header, size = HEADER.unpack_from(data, at)[2:4]
    content = data[at + header : at + header + size]
    packed = at > 0 and content[:1] == b"\x78"
    body = bytearray(zlib.decompress(content) if packed else content)
    done = _element(body, rng)
    made = zlib.compress(bytes(body)) if packed else bytes(body)
    if len(made) > size and at != starts[-1]:
        return _pqdif(data, rng)  # it would lie on the next record
    head = bytearray(data[at : at + header])
    struct.pack_into("<i", head, 36, len(made))
    struct.pack_into("<I", head, 44, zlib.adler32(made))
    return data[:at] + bytes(head) + made.ljust(size, b"\0") + data[at + header + size :], done


def _element(body, rng):
    """Change a count, or the kind, type, link or size of an element, somewhere in the tree of a
    body.
    """
    places, open_, seen = [], [0], set()
    while open_:
        at = open_.pop()
        if at in seen or at + 4 > len(body):
            continue
        seen.add(at)
        count = struct.unpack_from("<i", body, at)[0]
        places.append(("count", at))
        for k in range(max(0, min(count, 200))):
            own = at + 4 + k * ENTRY.size
            if own + ENTRY.size > len(body):
                break
            _, kind, _, _, link, _ = ENTRY.unpack_from(body, own)
            places += [
                ("kind", own + 16),
                ("type", own + 17),
                ("link", own + 20),
                ("size", own + 24),
            ]
            places += [("vector", link)] * (kind == 3 and 0 <= link <= len(body) - 4)
            open_ += [link] * (kind == COLLECTION)
    what, at = choose(rng, places)
    if what in ("kind", "type"):
        body[at] = int(rng.integers(256))
        return f"{what} {body[at]}"
    value = choose(rng, [*INTEGERS, 0, len(body), len(body) - 4, *sorted(seen)[:5]])
    struct.pack_into("<i", body, at, value)
    return f"{what} {value}"


def _archive(data, rng):
    """A member of a workbook lost, empty, cut, doubled in place of another, or with a digit or a
    tag changed.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as book:
        members = {name: book.read(name) for name in book.namelist()}
    name = choose(rng, sorted(members))
    text = members[name]
    way = choose(rng, ["lose", "empty", "cut", "exchange", "number", "tag"])
    if way == "lose":
        del members[name]
    elif way == "empty":
        members[name] = b""
    elif way == "cut":
        members[name] = text[: int(rng.integers(len(text) + 1))]
    elif way == "exchange":
        members[name] = members[choose(rng, sorted(members))]
    elif way == "number":
        digits = [k for k, byte in enumerate(text) if 48 <= byte < 58] or [0]
        k = choose(rng, digits)
        members[name] = text[:k] + str(choose(rng, INTEGERS)).encode() + text[k + 1 :]
    else:
        members[name] = text.replace(
            choose(rng, [b"<v", b"<c", b"<row", b' r="', b' t="']), b"<x", int(rng.integers(1, 3))
        )
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as book:
        for each, content in members.items():
            book.writestr(each, content)
    return out.getvalue(), f"{way} of {name}"


FIELDS = {  # {field of an entry in an archive's table of contents: (its place, its bytes)}
    "flags": (8, 2),
    "method": (10, 2),
    "sum": (16, 4),
    "packed size": (20, 4),
    "size": (24, 4),
    "length of the name": (28, 2),
    "length of what follows": (30, 2),
    "place": (42, 4),
}


def _directory(data, rng):
    """A field of an entry of a .zip, the counts at its end, or one of its files."""
    if rng.random() < 0.4:
        return _archive(data, rng)
    entries = [k for k in range(len(data)) if data[k : k + 4] == b"PK\x01\x02"]
    end = data.rindex(b"PK\x05\x06")
    fields = {name: (choose(rng, entries) + at, size) for name, (at, size) in FIELDS.items()}
    fields |= {"count": (end + 10, 2), "bytes": (end + 12, 4), "begin": (end + 16, 4)}
    name = choose(rng, sorted(fields))
    at, size = fields[name]
    value = choose(rng, [*INTEGERS, len(data), at]) % (1 << 8 * size)
    return data[:at] + value.to_bytes(size, "little") + data[at + size :], f"{name} {value}"


def _header(data, rng):
    """A count, a rate or a whole kind of lines of a COMTRADE configuration."""
    lines = data.split(b"\n")
    way = choose(rng, ["counts", "number", "rates", "no channels", "empty field"])
    if way == "counts":
        k = min(1, len(lines) - 1)
        lines[k] = (
            f"{choose(rng, INTEGERS)},{choose(rng, INTEGERS)}A,{choose(rng, INTEGERS)}D\r".encode()
        )
    elif way == "no channels":
        lines[2 : 2 + int(rng.integers(1, 8))] = []
    else:
        k = int(rng.integers(min(len(lines), 20)))
        fields = lines[k].split(b",")
        j = int(rng.integers(len(fields)))
        fields[j] = b"" if way == "empty field" else str(choose(rng, INTEGERS)).encode()
        lines[k] = b",".join(fields)
    return b"\n".join(lines), way


def _samples(data, rng):
    """The samples of a COMTRADE record: none, a part of one, or some over."""
    way = choose(rng, ["none", "part", "over"])
    made = {
        "none": b"",
        "part": data[: int(rng.integers(1, 20))],
        "over": data + data[: int(rng.integers(1, 40))],
    }[way]
    return made, way


def _report(data, rng):
    """A name, a column, the relay word or all values of an SEL event report left out."""
    lines = data.split(b"\n")
    k = int(rng.integers(len(lines)))
    fields = lines[k].split(b",")
    way = choose(rng, ["empty field", "empty fields", "no line", "short line", "word"])
    if way == "empty field":
        fields[int(rng.integers(len(fields)))] = b'""'
    elif way == "empty fields":
        fields = [b""] * len(fields)
    elif way == "short line":
        fields = fields[: int(rng.integers(len(fields)))]
    elif way == "word":
        fields[-2 if len(fields) > 1 else 0] = choose(
            rng, [b'"F"', b'"' + b"F" * 400 + b'"', b'"G0"', b'"0123"']
        )
    lines[k : k + 1] = [] if way == "no line" else [b",".join(fields)]
    return b"\n".join(lines), f"{way} in line {k + 1}"


def _footer(data, rng):
    """The footer of a Parquet file: its length, or a byte of it."""
    size = struct.unpack_from("<i", data, len(data) - 8)[0]
    if rng.random() < 0.3:
        value = choose(rng, [*INTEGERS, size - 1, size + 1, len(data)])
        return data[:-8] + struct.pack("<i", value) + data[-4:], f"length {value}"
    at = len(data) - 8 - int(rng.integers(1, size + 1))
    return data[:at] + bytes([int(rng.integers(256))]) + data[at + 1 :], f"byte {at}"


if __name__ == "__main__":
    import numpy as np
    from mutated_files import command, originals, run

    def known(folder):
        """The sound files of whose structure something is known."""
        made, rng = originals(folder), np.random.default_rng(0)
        return {name: paths for name, paths in made.items() if damage(paths[0], rng)}

    damaging = functools.partial(run, damaged=restructured, originals=known)
    sys.exit(command(damaging, __doc__, __file__))
