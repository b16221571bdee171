"""Records in a .zip, read where they are, within limits."""

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

import tractexp
import tractexp.data
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.storage import files, zip_archive

DATA = Path(tractexp.data.__file__).parent
TABLE, CFG, DAT = (
    (DATA / name).read_bytes() for name in ("tibet_30pct.csv", "tibet_50pct.cfg", "tibet_50pct.dat")
)
PAIR = {"north/tibet_50pct.CFG": CFG, "north/tibet_50pct.dat": DAT, "north/readme.txt": b"a b\n"}


@pytest.fixture
def pack(tmp_path, monkeypatch):
    """Writes a .zip of {name: content} in the current folder, changed by a function; its name."""
    monkeypatch.chdir(tmp_path)

    def written(members, change=lambda data: data, name="r.zip", method=zipfile.ZIP_DEFLATED):
        made = io.BytesIO()
        with zipfile.ZipFile(made, "w", method) as archive:
            for inside, content in members.items():
                archive.writestr(inside, content)
        Path(name).write_bytes(change(made.getvalue()))
        return name

    return written


def test_a_record_is_the_same_in_a_zip_and_beside_it(pack):
    inside = tractexp.read(pack(PAIR))
    beside = tractexp.read(str(DATA / "tibet_50pct.cfg"))
    for one, other in zip(inside, beside, strict=True):
        for name, values in one.record.channels.items():
            np.testing.assert_array_equal(values, other.record.channels[name])
        assert one.record.source.startswith("r.zip/north/tibet_50pct.CFG")
    assert [p.name for p in Path.cwd().iterdir()] == ["r.zip"]


def test_a_reader_finds_its_record_in_a_zip(pack, tmp_path):
    recording = comtrade.load(DATA / "tibet_50pct.cfg")
    comtrade.write(recording, tmp_path / "b.cff", "BINARY")
    pack({"a.csv": TABLE, "notes.txt": b"of words\n", "b.cff": (tmp_path / "b.cff").read_bytes()})
    read = build("data", {"name": "comtrade", "path": "r.zip"}).open_recording()
    assert [c.name for c in read.channels] == [c.name for c in recording.channels]
    assert read.source == "r.zip/b.cff"
    with pytest.raises(UserError, match=r"r.zip holds no file that ends in .cev"):
        build("data", {"name": "sel", "path": "r.zip"}).open_recording()


def test_look_names_the_file_within(pack):
    seen = tractexp.look(pack(PAIR), progress=False)
    assert "data=comtrade data.path=r.zip/north/tibet_50pct.CFG" in seen.commands[0]
    assert len(tractexp.read("r.zip/north/tibet_50pct.dat")) == 1
    table = pack({"a.csv": TABLE}, name="t.ZIP")
    assert "data.path=t.ZIP/a.csv" in tractexp.look(table, progress=False).commands[0]


def test_a_command_reads_what_look_names(pack):
    from command_line import run_command

    pack({"a.csv": TABLE})
    run = run_command(
        "task=convert", "task.to=parquet", "data=csv", "data.path=r.zip/a.csv", cwd="."
    )
    assert run.returncode == 0
    assert [*Path().rglob("*.parquet")]


def test_several_records_are_told_with_how_to_name_one(pack):
    pack(PAIR | {"south.csv": TABLE})
    words = (
        r"r.zip holds 2 records, north/tibet_50pct.CFG, south.csv: name one, tractexp look"
        r" r.zip/north/tibet_50pct.CFG, or make a table of all, tractexp task=survey"
        r" data.path=r.zip"
    )
    for call in (tractexp.read, lambda path: tractexp.look(path, progress=False)):
        with pytest.raises(UserError, match=words):
            call("r.zip")
    assert tractexp.look("r.zip/south.csv", progress=False).commands
    with pytest.raises(UserError, match=r"no such file in r.zip; did you mean 'south.csv'"):
        tractexp.read("r.zip/sout.csv")


@pytest.mark.parametrize("folder", [".", "r.zip"])
def test_a_survey_reads_what_is_in_a_zip(pack, folder):
    pack(PAIR | {"south.csv": TABLE})
    made = tractexp.survey(folder, cores=1, progress=False)
    above = "r.zip/" if folder == "." else ""
    assert [row["file"] for row in made.content["rows"]] == [
        f"{above}north/tibet_50pct.CFG",
        f"{above}south.csv",
    ]
    assert all(row["worth"] for row in made.content["rows"])
    from tractexp.configuration.plugin import build

    names = [row["event"] for row in made.content["rows"]]
    assert len(build("data", {"name": "archive", "path": folder, "train": names}).read().train) == 2


def test_names_of_other_computers_are_read(pack):
    """GBK and backslashes, as packers of Windows write them; what is hidden is left out."""
    members = {"AAAA.csv": TABLE, "__MACOSX/._b.csv": TABLE, "../c.csv": TABLE, "/d/e.txt": b"no"}
    name = "牵引".encode("gbk")
    pack(members, lambda data: data.replace(b"AAAA.csv", name + b".csv"))
    assert files.list_packed(Path("r.zip")) == [Path("r.zip/d/e.txt"), Path("r.zip/牵引.csv")]
    assert tractexp.read("r.zip")[0].record.source == "r.zip/牵引.csv"
    pack({r"a\b.csv": TABLE})
    assert tractexp.read("r.zip/a/b.csv")


def flagged(data):
    """The first file marked as encrypted."""
    changed = bytearray(data)
    changed[6] |= 1
    changed[data.index(b"PK\x01\x02") + 8] |= 1
    return bytes(changed)


def lying(data):
    """The first file said to have 100 bytes."""
    changed, at = bytearray(data), data.index(b"PK\x01\x02")
    struct.pack_into("<I", changed, at + 24, 100)
    return bytes(changed)


def swallowing(data):
    """The name of the first file so long that it takes in the others' entries."""
    changed, at = bytearray(data), data.index(b"PK\x01\x02")
    struct.pack_into("<H", changed, at + 28, 255)
    return bytes(changed)


REFUSED = [
    ({"a.csv": TABLE, "b.csv": TABLE}, swallowing, "it says that it has 2 files, and lists 1"),
    ({"a.csv": TABLE}, flagged, "'a.csv' is encrypted: extract it with its password"),
    ({"a.csv": TABLE}, lying, "'a.csv' is damaged"),
    ({"a.csv": TABLE}, lambda data: data[: len(data) // 2], "not a whole .zip"),
    ({"a.csv": TABLE}, lambda data: b"", "not a whole .zip"),
    ({"a.csv": TABLE}, lambda data: data[:99] + b"\xff" * 9 + data[108:], "'a.csv' is damaged"),
    ({}, lambda data: data, "there is no record in r.zip: it is empty"),
    ({"../a.csv": TABLE}, lambda data: data, "or its files are hidden or named as if they lay"),
    ({"a.pdf": b"%PDF"}, lambda data: data, "no record in r.zip: it holds a.pdf; endings"),
    ({"b.zip": b""}, lambda data: data, "holds another archive, 'b.zip': extract it"),
    ({"a.csv": bytes(40 << 20)}, lambda data: data, "has 41.94 MB, packed as .* MB, and at most"),
    ({f"{k}.csv": b"" for k in range(2001)}, lambda data: data, "holds 2001 files"),
]


@pytest.mark.parametrize(("members", "change", "words"), REFUSED, ids=[r[2] for r in REFUSED])
def test_what_cannot_be_read_is_refused_in_a_sentence(pack, members, change, words):
    pack(members, change)
    for call in (tractexp.read, lambda path: tractexp.look(path, progress=False)):
        with pytest.raises(UserError, match=words):
            call("r.zip")
    (row,) = tractexp.survey(".", cores=1, progress=False).content["rows"]
    assert row["kind"] == "not read"


def test_another_way_of_packing_is_named(pack):
    pack({"a.csv": TABLE}, method=zipfile.ZIP_BZIP2)
    with pytest.raises(UserError, match=r"'a.csv' is packed in a way that is not read here"):
        tractexp.read("r.zip")


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("LARGEST_ZIP", "has .* MB, and a .zip that is read at most"),
        ("LARGEST_DIRECTORY", "lists more files than records have"),
        ("LARGEST_MEMBER", "'a.csv' has .* packed as"),
        ("LARGEST_WHOLE", "r.zip holds .* MB"),
    ],
)
def test_limits_hold(pack, monkeypatch, limit, words):
    monkeypatch.setattr(zip_archive, limit, 40)
    zip_archive._list_members_of_state.cache_clear()
    pack({"a.csv": TABLE})
    with pytest.raises(UserError, match=words):
        tractexp.read("r.zip")
    zip_archive._list_members_of_state.cache_clear()


def test_a_zip_that_is_not_there_is_no_archive(pack):
    with pytest.raises(UserError, match=r"absent.zip: there is no such file"):
        tractexp.read("absent.zip")
    with pytest.raises(UserError, match=r"absent.zip/a.csv: there is no such file"):
        tractexp.read("absent.zip/a.csv")
