"""What becomes of damaged files: `python benchmarks/mutated_files.py [--count 10000] [--first 0]
[--seed 1]`.

One small record, written in every format that is read, is damaged in ways that happen to files -
bits, bytes, digits, fields and lines changed, lost, doubled or swapped, files cut - and given to
`tractexp.read` in a process of its own. Allowed is a reading, or one sentence. Not allowed: another
exception, a warning, words of Python in what a user reads, more than 5 s of a processor, more than
500 MB (a workbook's rows come from a process whose own memory is limited). Counts and worst figures
go to mutated_files.json; the exit code says whether all held. A case has a number, by which it is
made again; `--first K` adds cases K, K + 1, ... to those that are stored.
"""

import argparse
import io
import json
import multiprocessing
import os
import re
import shutil
import sys
import tempfile
import traceback
import warnings
import zipfile
from datetime import datetime
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import tractexp

tractexp.__version__  # noqa: B018

import made_pqdif  # noqa: E402
import numpy as np  # noqa: E402
from memory import peak, reset  # noqa: E402

from tractexp.errors import UserError  # noqa: E402
from tractexp.filetypes import comtrade  # noqa: E402
from tractexp.filetypes.cev_text import compute_checksum  # noqa: E402
from tractexp.record import find_reader  # noqa: E402
from tractexp.recording import Channel, Recording, Segment, StatusChannel  # noqa: E402
from tractexp.storage import files  # noqa: E402

SECONDS, MEGABYTES = 5.0, 500.0
LEAKS = re.compile(
    r"invalid literal|could not convert|list index|out of bounds|NoneType|codec|unpack|month must"
    r" be|Traceback"
    r"|object is not|expected str|Error:|Exception|<class|broadcast|dtype|\bndarray|not"
    r" subscriptable"
    r"|unsupported operand|must be real|keyword argument|positional|has no attribute|cannot"
    r" reshape|integer division"
    r"|zero-size|lambda|recursion|surrogate|ordinal not|null byte|embedded|is out of range for"
    r"|int\(\)|float\(\)|year \d+ is out"
)
NASTY = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1",
    "0",
    "",
    " ",
    "abc",
    "99999999999",
    "1e-320",
    "２",
    "1_0",
    "0x10",
    "1;5",
    "NULL",
    "#N/A",
    "32768",
    "-32768",
    "99999",
    "é",
    '"',
    "1,5",
    "4294967296",
    "2000000000",
    "1e99",
    "A",
    "D",
]


def record():
    """Three voltages and currents with a dip: 0.8 s at 1600 Hz."""
    t = np.arange(1280) / 1600
    scale = np.where((t >= 0.3) & (t < 0.45), 0.7, 1.0)
    turn = np.exp(1j * (2 * np.pi * 50 * t - 2 * np.pi / 3 * np.arange(3)[:, None]))
    volts, amperes = 20000 * turn.real * scale, 15000 * (turn * np.exp(-0.4j)).real * scale
    channels = [
        Channel(f"U{p}", np.round(v).astype(np.int16), "kV", "voltage", p, "Bus", 0.005)
        for p, v in zip("abc", volts, strict=True)
    ] + [
        Channel(f"I{p}", np.round(i).astype(np.int16), "A", "current", p, "Feeder", 0.02)
        for p, i in zip("abc", amperes, strict=True)
    ]
    states = [
        StatusChannel("trip", (t > 0.31).astype(int)),
        StatusChannel("close", (t > 0.5).astype(int)),
    ]
    return Recording(
        "made", channels, [Segment(0, 1280, 1600.0, 0.0)], 50.0, "Station", "device", status=states
    )


def of_1991(path):
    """The configuration of a record of 1999 as the first edition has it: no year, no ratios, no
    multiplier; the dates with the month first.
    """
    lines = path.read_text().splitlines()
    channels = [",".join(line.split(",")[:10]) for line in lines[2:8]]
    head = [",".join(lines[0].split(",")[:2]), lines[1], *channels]
    return "\n".join([*head, *(line for line in lines[8:-1])]) + "\n"


def phase_tables(made, folder):
    """A table of voltage and current for each phase."""
    t = made.segments[0].t
    return [
        files.write(
            folder / f"ev_{mark}.csv",
            "t,U [kV],I [A]\n"
            + "".join(
                f"{x:.7f},{u:.6g},{1e3 * i:.6g}\n"
                for x, u, i in zip(
                    t, made.channels[k].values(), made.channels[k + 3].values(), strict=True
                )
            ),
        )
        for k, mark in enumerate("ABC")
    ]


def pack(path, members):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for member in members:
            archive.writestr(member.name, member.read_bytes())
    return files.write(path, out.getvalue())


def event_report(made, every=1):
    """The record as an SEL relay's compressed event report; filtered, of 4 samples a cycle, with
    `every` 8.
    """

    def row(*cells):
        text = "".join(f"{cell}," for cell in cells)
        return f'{text}"{compute_checksum(text)}"'

    lines = [
        row('"FID"'),
        row('"FID=SEL-351S-R512"'),
        row(*(f'"{k}"' for k in ("MONTH", "DAY", "YEAR", "HOUR", "MIN", "SEC", "MSEC"))),
    ]
    lines += [
        row(3, 14, 2023, 15, 9, 26, 535),
        row('"FREQ"', '"SAM/CYC_A"', '"SAM/CYC_D"', '"NUM_OF_CYC"', '"EVENT"'),
        row(50, 32 // every, 4, 40, '"ER"'),
    ]
    lines += [
        row(
            '"IA"', '"IB"', '"IC"', '"VA(kV)"', '"VB(kV)"', '"VC(kV)"', '"TRIG"', '"51P * TRIP 52A"'
        )
    ]
    values = np.array(
        [made.channels[k].values() * (1e3 if k > 2 else 1) for k in (3, 4, 5, 0, 1, 2)]
    ).T / np.sqrt(2)
    for i, cells in enumerate(values[::every]):
        word = "" if i % 8 else '"B0"' if i > 490 else '"80"'
        lines.append(row(*(f"{x:.2f}" for x in cells), ">" if i == 480 // every else "", word))
    return "\r\n".join([*lines, row('"SETTINGS"'), '"CTR = 40', '","1234"']) + "\r\n"


def quality_files(made, columns):
    """The record as PQDIF: {name: bytes} of its waveforms, compressed and not, and of a log of its
    powers.
    """
    letters, when = {"voltage": "V", "current": "A"}, datetime(2024, 5, 17, 8, 30)
    waves = [
        made_pqdif.definition(
            c.name, "abc".index(c.phase) + 1, letters[c.quantity], group=c.circuit
        )
        for c in made.channels
    ]
    rows = [
        made_pqdif.instance(
            k, 0 if k else [1, made.samples, 1 / 1600], c.raw, 1e3 * c.gain * c.factor
        )
        for k, c in enumerate(made.channels)
    ]
    captured = [
        made_pqdif.source(*waves),
        made_pqdif.settings(),
        made_pqdif.observation(when, *rows),
    ]
    logged = [
        made_pqdif.definition(name, phase, unit, "log", scaled=False)
        for name, phase, unit in (("U", 15, "V"), ("P", 13, "W"), ("Q", 13, "var"))
    ]
    log = [
        made_pqdif.instance(k, [1, len(columns["t"]), 1 / 400], scale * columns[name], dtype="<f4")
        for k, (name, scale) in enumerate((("U", 27.5e3), ("P", 20e6), ("Q", 20e6)))
    ]
    powers = made_pqdif.file(
        [made_pqdif.source(*logged), made_pqdif.observation(when, *log)], compressed=False
    )
    return {
        "PQDIF": made_pqdif.file(captured),
        "PQDIF uncompressed": made_pqdif.file(captured, compressed=False),
        "PQDIF log": powers,
    }


def tables(made):
    """The record as tables: t, U, P, Q and waveforms."""
    t = np.arange(400) / 400
    U = np.where((t >= 0.3) & (t < 0.45), 0.7, 1.0)
    columns = {"t": t, "U": U, "P": 0.9 * U**1.5, "Q": 0.3 * U**2}
    # V, A
    waves = {"t": made.segments[0].t} | {c.name.lower(): 1e3 * c.values() for c in made.channels}

    def text(given, mark):
        rows = zip(*(v.tolist() for v in given.values()), strict=True)
        return (
            "\n".join([mark.join(given), *(mark.join(f"{x:.6g}" for x in row) for row in rows)])
            + "\n"
        )

    rows = text(columns, ",").partition("\n")[2]
    names = "b:tnow in s,m:u1:bus1 in p.u.,m:Psum:bus1 in p.u.,m:Qsum:bus1 in p.u.\n"
    german = (
        "Zeitpunkt in s;Bus 1\\m:u1 in p.u.;Last 1\\m:Psum:bus1 in p.u.;Last 1\\m:Qsum:bus1 in"
        " p.u.\n"
    )
    return columns, {
        ".csv": text(columns, ","),
        ".tsv": text(columns, "\t"),
        "_waves.csv": text(waves, ","),
        "_powerfactory.csv": f"All calculations,Bus 1,Load 1,Load 1\n{names}{rows}",
        "_digsilent.csv": german + rows.replace(",", ";").replace(".", ","),
    }


def open_document(columns):
    """A workbook of OpenDocument (.ods), as bytes."""
    text = '<table:table-cell office:value-type="string"><text:p>{}</text:p></table:table-cell>'
    number = '<table:table-cell office:value-type="float" office:value="{:.6g}"/>'
    rows = [[text.format(name) for name in columns]]
    rows += [[number.format(x) for x in row] for row in zip(*columns.values(), strict=True)]
    spaces = "".join(
        f' xmlns:{k}="urn:oasis:names:tc:opendocument:xmlns:{k}:1.0"'
        for k in ("office", "table", "text")
    )
    lines = "".join(f"<table:table-row>{''.join(row)}</table:table-row>" for row in rows)
    content = (
        f'<?xml version="1.0"?><office:document-content{spaces}><office:body><office:spreadsheet>'
        f'<table:table table:name="S">{lines}</table:table>'
        "</office:spreadsheet></office:body></office:document-content>"
    )
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("META-INF/manifest.xml", "<manifest/>")
        archive.writestr("content.xml", content)
    return packed.getvalue()


def originals(folder):
    """{name of the format: the files of one sound record}."""
    made, formats = record(), {}
    for kind in ("ASCII", "BINARY", "BINARY32", "FLOAT32"):
        formats[f"COMTRADE {kind}"] = comtrade.write(made, folder / f"{kind.lower()}.cfg", kind)
    for kind in ("ASCII", "BINARY", "FLOAT32"):
        formats[f"COMTRADE {kind} in one file"] = comtrade.write(
            made, folder / f"{kind.lower()}.cff", kind
        )
    formats["COMTRADE 1999"] = comtrade.write(made, folder / "old.cfg", "BINARY", 1999)
    formats["COMTRADE 1991"] = [
        files.write(folder / "first.cfg", of_1991(folder / "old.cfg")),
        files.write(folder / "first.dat", (folder / "old.dat").read_bytes()),
    ]
    formats["zip of a record"] = [pack(folder / "r.zip", formats["COMTRADE BINARY"])]
    formats["zip of one file a phase"] = [pack(folder / "phases.zip", phase_tables(made, folder))]
    formats["SEL CEV"] = [files.write(folder / "report.cev", event_report(made))]
    formats["SEL CEV filtered"] = [
        files.write(folder / "filtered.cev", event_report(made, every=8))
    ]
    columns, texts = tables(made)
    for name, content in quality_files(made, columns).items():
        formats[name] = [files.write(folder / f"{name.replace(' ', '_')}.pqd", content)]
    rows = "".join(
        "".join(f" {x:.8E}" for x in row) + "\n" for row in zip(*columns.values(), strict=True)
    )
    named = "".join(
        f'PGB({k}) Output Desc="{n}" Group="" Units="pu"\n' for k, n in enumerate("UPQ", 1)
    )
    formats["PSCAD"] = [
        files.write(folder / "case_01.out", f" title\n{rows}"),
        files.write(folder / "case.inf", named),
    ]
    for ending, content in texts.items():
        formats[f"table {ending}"] = [files.write(folder / f"table{ending}", content)]
    formats["table .ods"] = [files.write(folder / "table.ods", open_document(columns))]
    for ending, write in ((".parquet", "write_parquet"), (".xlsx", "write_excel")):
        try:
            import polars

            find_reader(f"table{ending}")
            getattr(polars.DataFrame(columns), write)(folder / f"table{ending}")
            formats[f"table {ending}"] = [folder / f"table{ending}"]
        except (ImportError, UserError):
            continue  # nothing reads or writes it here
    return formats


# ways of damage: bytes and a generator in, bytes out


def flip(data, rng):
    made = bytearray(data)
    for at in rng.integers(len(made), size=int(rng.integers(1, 9))):
        made[at] ^= 1 << int(rng.integers(8))
    return bytes(made)


def cut(data, rng):
    return data[: int(rng.integers(len(data)))]


def insert(data, rng):
    at = int(rng.integers(len(data) + 1))
    return data[:at] + rng.bytes(int(rng.integers(1, 9))) + data[at:]


def lose(data, rng):
    at = int(rng.integers(len(data)))
    return data[:at] + data[at + int(rng.integers(1, 9)) :]


def zero(data, rng):
    at, size = int(rng.integers(len(data))), int(rng.integers(1, 200))
    return data[:at] + bytes(len(data[at : at + size])) + data[at + size :]


def digit(data, rng):
    places = [i for i, byte in enumerate(data[:20000]) if 48 <= byte < 58]
    if not places:
        return flip(data, rng)
    made = bytearray(data)
    made[places[int(rng.integers(len(places)))]] = 48 + int(rng.integers(10))
    return bytes(made)


def _lines(data, rng, change, head=40):
    """Change the list of lines at a place that lies in the head of the file half of the time."""
    lines = data.split(b"\n")
    among = len(lines) if rng.random() < 0.5 else min(head, len(lines))
    change(lines, int(rng.integers(among)))
    return b"\n".join(lines)


def drop_line(data, rng):
    return _lines(data, rng, lambda lines, k: lines.pop(k))


def double_line(data, rng):
    return _lines(data, rng, lambda lines, k: lines.insert(k, lines[k]))


def blank_line(data, rng):
    return _lines(data, rng, lambda lines, k: lines.insert(k, b""))


def swap_lines(data, rng):
    def change(lines, k):
        other = int(rng.integers(len(lines)))
        lines[k], lines[other] = lines[other], lines[k]

    return _lines(data, rng, change)


def _fields(data, rng, change):
    def one(lines, k):
        mark = b"\t" if b"\t" in lines[k] else b","
        fields = lines[k].split(mark)
        change(fields, int(rng.integers(len(fields))))
        lines[k] = mark.join(fields)

    return _lines(data, rng, one)


def swap_fields(data, rng):
    def change(fields, k):
        other = int(rng.integers(len(fields)))
        fields[k], fields[other] = fields[other], fields[k]

    return _fields(data, rng, change)


def nasty_field(data, rng):
    def change(fields, k):
        fields[k] = NASTY[int(rng.integers(len(NASTY)))].encode()

    return _fields(data, rng, change)


def drop_field(data, rng):
    return _fields(data, rng, lambda fields, k: fields.pop(k))


DAMAGE = [
    flip,
    cut,
    insert,
    lose,
    zero,
    digit,
    drop_line,
    double_line,
    blank_line,
    swap_lines,
    swap_fields,
    nasty_field,
    nasty_field,
    drop_field,
]


def damaged(paths, folder, rng):
    """The files of a record with one to three kinds of damage in one of them; its path, and what
    was done.
    """
    done = []
    for path in paths:
        (folder / path.name).write_bytes(path.read_bytes())
    target = folder / paths[0 if len(paths) == 1 or rng.random() < 0.7 else 1].name
    data = target.read_bytes()
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        way = DAMAGE[int(rng.integers(len(DAMAGE)))]
        done.append(way.__name__)
        data = way(data, rng) if data else data
    target.write_bytes(data)
    return folder / paths[0].name, f"{'+'.join(done)} of {target.suffix}"


def outcome(path):
    """(kind, words, figures) of reading one file: how it ended, what was said, and events, mean U
    and P.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            events = tractexp.read(str(path))
            words = " | ".join(note for event in events for note in event.record.notes)
            kind = "read"
            figures = [
                len(events),
                *(float(np.mean([np.mean(getattr(e.record, k)) for e in events])) for k in "UP"),
            ]
        except UserError as error:
            kind, words, figures = "refused", str(error), []
        except Exception:
            return "traceback", traceback.format_exc()[-1500:], []
    return ("leak" if LEAKS.search(words.replace(str(path.parent), "")) else kind), words, figures


def _work(pipe):
    """A process that reads the files it is told, and says how it went, with seconds and growth
    [MB].
    """
    while (path := pipe.recv()) is not None:
        before, start = reset(), spent()
        kind, words, figures = outcome(Path(path))
        pipe.send((kind, words, figures, spent() - start, peak() - before))


def spent():
    """Seconds of processors that this process and those it has waited for took: they hold on a
    shared machine too.
    """
    return sum(os.times()[:4])


class Worker:
    """A reading process, replaced when it hangs or dies."""

    def __init__(self):
        self.context = multiprocessing.get_context("spawn")
        self.start()

    def start(self):
        self.pipe, other = self.context.Pipe()
        self.process = self.context.Process(target=_work, args=(other,), daemon=True)
        self.process.start()
        self.fresh = True

    def read(self, path):
        """How it went; what seems to hang or die is read a second time, by a new process."""
        first = self.once(path)
        return self.once(path) if first[0] == "hang or death" else first

    def once(self, path):
        self.pipe.send(str(path))
        # of a clock; a fresh one imports and compiles first
        limit = 120 if self.fresh else 12 * SECONDS
        try:
            if not self.pipe.poll(limit):
                raise EOFError
            answer = self.pipe.recv()
        except (EOFError, ConnectionError):
            self.process.kill()
            self.process.join()
            self.start()
            return "hang or death", "", [], limit, 0.0
        kind, words, figures, seconds, growth = answer
        if not self.fresh and kind in ("read", "refused"):
            kind = "slow" if seconds > SECONDS else "large" if growth > MEGABYTES else kind
        self.fresh = False
        return kind, words, figures, seconds, growth


def run(count, seed, first=0, damaged=damaged, originals=originals):
    """Counts and findings of so many files, each `damaged(paths, folder, rng)`: its path and what
    was done.
    """
    worker = Worker()
    with tempfile.TemporaryDirectory() as base:
        sound, broken = Path(base) / "sound", Path(base) / "broken"
        sound.mkdir()
        formats = originals(sound)
        counts = {name: {} for name in formats}
        worst = {"seconds": 0.0, "megabytes": 0.0}
        bad, right = [], {}
        for name, paths in formats.items():  # the sound files, which also warms the process up
            kind, words, right[name], *_ = worker.read(paths[0])
            if kind != "read":
                bad.append({"format": name, "kind": f"sound file {kind}", "words": words})
        for k in range(first, first + count):
            rng, name = np.random.default_rng([seed, k]), list(formats)[k % len(formats)]
            broken.mkdir(exist_ok=True)
            path, done = damaged(formats[name], broken, rng)
            kind, words, figures, seconds, growth = worker.read(path)
            if kind == "read":
                same = figures[:1] == right[name][:1] and np.allclose(
                    figures, right[name], rtol=1e-6
                )
                kind = "read as undamaged" if same else "read as it now stands"
            counts[name][kind] = counts[name].get(kind, 0) + 1
            worst = {
                "seconds": max(worst["seconds"], seconds),
                "megabytes": max(worst["megabytes"], growth),
            }
            if kind not in ("read as undamaged", "read as it now stands", "refused"):
                bad.append(
                    {"case": k, "format": name, "damage": done, "kind": kind, "words": words}
                )
            if (k + 1) % 500 == 0:
                print(f"{k + 1} files, {len(bad)} bad", flush=True)
            shutil.rmtree(broken)
        worker.pipe.send(None)
        worker.process.join()
        return {"cases": count, "seed": seed, "counts": counts, "worst": worst, "bad": bad}


def command(run, about, place):
    """The exit code of a benchmark's command: `run(count, seed, first)` damages, and its counts go
    to a file beside it.
    """
    asked = argparse.ArgumentParser(description=about.splitlines()[0])
    asked.add_argument("--count", type=int, default=10_000)
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--json", type=Path, default=Path(place).with_suffix(".json"))
    told = asked.parse_args()
    stored = json.loads(told.json.read_text(encoding="utf-8")) if told.first else None
    if stored and (stored["cases"], stored["seed"]) != (told.first, told.seed):
        sys.exit(f"{told.json} has {stored['cases']} cases of seed {stored['seed']}")
    found = run(told.count, told.seed, told.first)
    found = add(stored, found) if stored else found
    files.write_json(told.json, found)
    print(json.dumps(found["counts"], indent=1))
    for one in found["bad"][:40]:
        print(one)
    return len(found["bad"]) > 0


def add(stored, found):
    """The counts, worst figures and findings of two pieces of a run."""
    counts = {
        name: {
            kind: stored["counts"].get(name, {}).get(kind, 0) + of_kind.get(kind, 0)
            for kind in {**stored["counts"].get(name, {}), **of_kind}
        }
        for name, of_kind in found["counts"].items()
    }
    worst = {key: max(stored["worst"][key], value) for key, value in found["worst"].items()}
    return found | {
        "cases": stored["cases"] + found["cases"],
        "counts": counts,
        "worst": worst,
        "bad": stored["bad"] + found["bad"],
    }


if __name__ == "__main__":
    sys.exit(command(run, __doc__, __file__))
