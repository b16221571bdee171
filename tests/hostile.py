"""Files and folders that nobody should give a command, each made in a folder of its own: a reading,
or a sentence.
"""

import contextlib
import json
import os
import socket
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROWS = 400
ESCAPE = "\x1b]0;owned\x07\x1b[31m\x9b2J"  # sets a terminal's title, its colour, and clears it
TABLE = "t,U,P,Q"
NAMES = TABLE.split(",")
MOTOR = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "p_v": 1.4,
    "q_v": 3.0,
}


def columns(step: float = 0.005, power: float = 1.0) -> np.ndarray:
    """A dip (ROWS, 4) of t, U, P, Q."""
    t = step * np.arange(ROWS)
    U = np.where((np.arange(ROWS) >= 200) & (np.arange(ROWS) < 240), 0.6, 1.0)
    return np.column_stack([t, U, 0.8 * power * U, 0.6 * power * U**2])


def text(values: np.ndarray, names: str = TABLE, digits: int = 9) -> str:
    return "\n".join([names, *(",".join(f"{v:.{digits}g}" for v in row) for row in values)]) + "\n"


def workbook(path: Path, cells: str, **more: str) -> Path:
    """A workbook whose only sheet has these cells, as XML."""
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    kind = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    sheets = f'<sheets><sheet name="{more.get("name", "a")}" sheetId="1" r:id="rId1"/></sheets>'
    link = f'<Relationship Id="rId1" Type="{kind}/worksheet" Target="worksheets/sheet1.xml"/>'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        root = f'<Relationship Id="rId1" Type="{kind}/officeDocument" Target="xl/workbook.xml"/>'
        book.writestr("_rels/.rels", f'<Relationships xmlns="{_RELATIONS}">{root}</Relationships>')
        book.writestr(
            "xl/workbook.xml", f'<workbook xmlns="{main}" xmlns:r="{kind}">{sheets}</workbook>'
        )
        book.writestr(
            "xl/_rels/workbook.xml.rels",
            f'<Relationships xmlns="{_RELATIONS}">{link}</Relationships>',
        )
        book.writestr(
            "xl/worksheets/sheet1.xml",
            f'<worksheet xmlns="{main}"><sheetData>{cells}</sheetData></worksheet>',
        )
    return path


_RELATIONS = "http://schemas.openxmlformats.org/package/2006/relationships"


def rows_of_cells(values: np.ndarray) -> str:
    """The rows of a sheet: names, and values (N, 4)."""

    def row(n: int, cells: list[str]) -> str:
        return f'<row r="{n}">{"".join(cells)}</row>'

    def cell(k: int, n: int, value: float) -> str:
        return f'<c r="{"ABCD"[k]}{n}"><v>{float(value)!r}</v></c>'

    heads = [
        f'<c r="{"ABCD"[k]}1" t="inlineStr"><is><t>{name}</t></is></c>'
        for k, name in enumerate(NAMES)
    ]
    body = [
        row(n, [cell(k, n, value) for k, value in enumerate(one)])
        for n, one in enumerate(values, 2)
    ]
    return row(1, heads) + "".join(body)


def far_cell(path: Path) -> Path:
    return workbook(path, '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>')


def far_cell_of_a_table(path: Path) -> Path:
    return workbook(
        path, rows_of_cells(columns()) + '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'
    )


def repeated_cells(path: Path) -> Path:
    """An OpenDocument sheet of a few hundred bytes that stands for a million rows of 16,384
    numbers.
    """
    names = {"office": "office", "table": "table", "text": "text"}
    spaces = " ".join(
        f'xmlns:{k}="urn:oasis:names:tc:opendocument:xmlns:{v}:1.0"' for k, v in names.items()
    )
    cell = (
        '<table:table-cell table:number-columns-repeated="16384" office:value-type="float"'
        ' office:value="1"/>'
    )
    row = f'<table:table-row table:number-rows-repeated="1048576">{cell}</table:table-row>'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        book.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        book.writestr("META-INF/manifest.xml", "<manifest/>")
        book.writestr(
            "content.xml",
            f"<office:document-content {spaces}><office:body><office:spreadsheet><table:table"
            f' table:name="a">{row}'
            "</table:table></office:spreadsheet></office:body></office:document-content>",
        )
    return path


def empty_zip(path: Path) -> Path:
    with zipfile.ZipFile(path, "w"):
        return path


def parquet(path: Path, **odd: object) -> Path:
    import pyarrow
    from pyarrow import parquet

    values = dict(zip(NAMES, map(list, columns().T), strict=True)) | odd
    parquet.write_table(pyarrow.table({name: pyarrow.array(v) for name, v in values.items()}), path)
    return path


def endless_text_parquet(path: Path) -> Path:
    """A few kilobytes that stand for a text of 8 MB in each row."""
    import pyarrow
    from pyarrow import parquet

    notes = pyarrow.DictionaryArray.from_arrays(np.zeros(ROWS, np.int8), ["x" * (8 << 20)])
    numbers = dict(zip(NAMES, columns().T, strict=True))
    parquet.write_table(
        pyarrow.table({**numbers, "notes": notes}),
        path,
        compression="zstd",
        write_statistics=False,
    )
    return path


def long_parquet(path: Path) -> Path:
    """A few kilobytes that stand for 240 million numbers."""
    import pyarrow
    from pyarrow import parquet

    ones = pyarrow.DictionaryArray.from_arrays(np.zeros(1_000_000, np.int8), [1.0])
    group = pyarrow.table(dict.fromkeys(NAMES, ones))
    with parquet.ParquetWriter(path, group.schema, compression="zstd") as writer:
        for _ in range(60):
            writer.write_table(group, row_group_size=1_000_000)
    return path


def written(content: str | bytes) -> Callable[[Path], Path]:
    def make(path: Path) -> Path:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return make


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def socket_file(path: Path) -> Path:
    with socket.socket(socket.AF_UNIX) as end, contextlib.chdir(path.parent):
        end.bind(path.name)
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def link_to_itself(path: Path) -> Path:
    path.symlink_to(path.name)
    return path


def link_to(target: str) -> Callable[[Path], Path]:
    def make(path: Path) -> Path:
        path.symlink_to(target)
        return path

    return make


def unreadable(path: Path) -> Path:
    path.write_text(text(columns()))
    path.chmod(0)
    return path


def sparse(path: Path) -> Path:
    with path.open("wb") as file:
        file.write(text(columns()).encode())
        file.truncate(1 << 41)
    return path


def database(path: Path) -> Path:
    with sqlite3.connect(path) as made:
        made.execute("create table a (b)")
    return path


def noisy(power: float) -> np.ndarray:
    """A dip of a load that draws so much, with noise of 0.001 pu."""
    values = columns(power=power)
    values[:, 2:] += 0.001 * np.random.default_rng(1).standard_normal((ROWS, 2))
    return values


def waves(
    step: float, current: float = 100.0, voltage: float = 10_000.0, far: float = 0.0
) -> np.ndarray:
    """Three phases at 50 Hz [V, A] in 20 samples a cycle, `step` apart; the last one
    is `far` away.
    """
    t = step * np.arange(ROWS)
    angle = 2 * np.pi * (np.arange(ROWS)[:, None] / 20 - np.arange(3) / 3)
    U = (
        np.where((np.arange(ROWS) > 200) & (np.arange(ROWS) < 260), 0.6, 1.0)[:, None]
        * voltage
        * np.sin(angle)
    )
    t[-1] += far
    return np.column_stack([t, U, current * np.sin(angle - 0.5)])


def far_time() -> np.ndarray:
    values = columns(2e-12)
    values[-1, 0] = 10.0
    return values


def comtrade(
    samples: str = "400", ratio: str = "1", name: str = "UA", rate: str = "1000"
) -> Callable[[Path], Path]:
    """A configuration and its samples, of which one number is odd."""

    def make(path: Path) -> Path:
        units = ["V", "V", "V", "A", "A", "A"]
        names = [name, "UB", "UC", "IA", "IB", "IC"]
        lines = ["station,relay,1999", "6,6A,0D"]
        lines += [
            f"{k},{n},,,{u},{ratio},0,0,-32767,32767,1,1,P"
            for k, (n, u) in enumerate(zip(names, units, strict=True), 1)
        ]
        lines += [
            "50",
            "1",
            f"{rate},{samples}",
            "01/01/2020,00:00:00.000000",
            "01/01/2020,00:00:00.100000",
            "BINARY",
            "1",
        ]
        path.write_text("\r\n".join(lines) + "\r\n")
        angle = 2 * np.pi * (50 * np.arange(400)[:, None] / 1000 - np.arange(3) / 3)
        values = (10_000 * np.sin(np.hstack([angle, angle - 0.5]))).astype("<i2")
        body = b"".join(
            struct.pack("<ii", k, 1000 * k) + row.tobytes() for k, row in enumerate(values)
        )
        path.with_suffix(".dat").write_bytes(body)
        return path

    return make


def result(**odd: object) -> str:
    """A result.json whose model is the usual one, but for what is odd."""
    content = {
        "parameters": MOTOR,
        "objective": 1e-5,
        "epsilon_p": 0.01,
        "epsilon_q": 0.01,
        "simulations": 1,
        "refused": 0,
        "iterations": 1,
        "seconds": 1.0,
        "status": "ended",
        "seed": 0,
        "events": [],
        "at_bound": [],
        "units": {},
        "bounds": {name: [0.5 * v, 2 * v] for name, v in MOTOR.items()},
        "model": {
            "motor": {"name": "electromechanical"},
            "static": {"name": "exponential"},
            "effects": [],
        },
        "before": {"U0": 1.0, "P0": 0.8, "Q0": 0.6, "frequency": 50.0},
        "own_base": {"power": 1.0, "file_power": 1.0, "origin": "given"},
    }
    return json.dumps(content | odd)


DEEP = "[" * 100_000 + "]" * 100_000
VALUES = columns()

# {name: what makes it at a path}. A name is one of a file, with its ending.
INPUTS: dict[str, Callable[[Path], Path]] = {
    # workbooks
    "far_cell.xlsx": far_cell,
    "far_cell_of_a_table.xlsx": far_cell_of_a_table,
    "repeated.ods": repeated_cells,
    "empty_zip.xlsx": empty_zip,
    "no_book.xlsx": written(b"PK\x03\x04" + bytes(200)),
    "no_book.xls": written(b"\xd0\xcf\x11\xe0" + bytes(600)),
    "escapes.xlsx": lambda path: workbook(
        path, rows_of_cells(columns()).replace(">P<", ">P&#27;[31m<")
    ),
    # Parquet
    "lists.parquet": lambda path: parquet(path, P=[[1.0, 2.0]] * ROWS),
    "bytes.parquet": lambda path: parquet(path, Q=[b"\xff\x1b"] * ROWS),
    "structs.parquet": lambda path: parquet(path, U=[{"a": 1}] * ROWS),
    "nested_times.parquet": lambda path: parquet(path, t=[[0.1]] * ROWS),
    "byte_times.parquet": lambda path: parquet(path, t=[b"0.1"] * ROWS),
    "cut.parquet": written(b"PAR1" + bytes(40) + b"PAR1"),
    "long.parquet": long_parquet,
    # what is no ordinary file
    "pipe.csv": pipe,
    "pipe.cfg": pipe,
    "pipe.json": pipe,
    "pipe.cev": pipe,
    "pipe.xlsx": pipe,
    "socket.csv": socket_file,
    "folder.csv": folder,
    "folder.cfg": folder,
    "folder.json": folder,
    "itself.csv": link_to_itself,
    "nowhere.csv": link_to("nowhere"),
    "endless.csv": link_to("/dev/zero"),
    "random.cfg": link_to("/dev/urandom"),
    "unreadable.csv": unreadable,
    "sparse.csv": sparse,
    "sparse.cev": sparse,
    "sparse.json": sparse,
    # names
    os.fsdecode(b"not_utf8_\xff.csv"): written(text(VALUES)),
    "escapes\x1b]0;owned\x07.csv": written(text(VALUES)),
    "line\nbreak.csv": written(text(VALUES)),
    "[red]markup[@click=].csv": written(text(VALUES)),
    "-dash.csv": written(text(VALUES)),
    "n" * 240 + ".csv": written(text(VALUES)),
    # cells
    "empty.csv": written(""),
    "zeros.csv": written(bytes(5000)),
    "words.csv": written("these are\nwords\n"),
    "escaped_names.csv": written(text(VALUES, f"t,U,P,Q,{ESCAPE}")),
    "escaped_header.csv": written(text(VALUES, f"t,U,P,{ESCAPE}Q")),
    "escaped_cell.csv": written(text(VALUES).replace("1.5,", f"{ESCAPE},")),
    "surrogates.csv": written(text(VALUES, "t,U,P,Q,\udcff").encode(errors="surrogatepass")),
    "no_power.csv": written(text(columns(power=0.0))),
    "no_active_power.csv": written(text(VALUES * [1, 1, 0, 1])),
    "no_reactive_power.csv": written(text(VALUES * [1, 1, 1, 0])),
    "noise_for_power.csv": written(text(noisy(0.0))),
    "waves_picoseconds.csv": written(text(waves(2e-12), "t,ua,ub,uc,ia,ib,ic")),
    "waves_without_currents.csv": written(text(waves(1e-3, 0.0), "t,ua,ub,uc,ia,ib,ic")),
    "waves_without_voltages.csv": written(text(waves(1e-3, voltage=0.0), "t,ua,ub,uc,ia,ib,ic")),
    "waves_far.csv": written(text(waves(1e-3, far=1e12), "t,ua,ub,uc,ia,ib,ic")),
    "no_voltage.csv": written(text(VALUES * [1, 0, 1, 1])),
    "tiny_power.csv": written(text(columns(power=1e-300), digits=17)),
    "huge_power.csv": written(text(columns(power=1e300))),
    "huge.csv": written(text(VALUES).replace("0.8", "1e999")),
    "not_a_number.csv": written(text(VALUES).replace("0.8", "nan")),
    "picoseconds.csv": written(text(columns(2e-12))),
    "far_time.csv": written(text(far_time())),
    "years.csv": written(text(columns(1e7))),
    "still.csv": written(text(columns(0.0))),
    "subnormal_times.csv": written(text(columns(1e-310), digits=17)),
    "huge_times.csv": written(text(columns(1e300))),
    "one_row.csv": written(text(VALUES[:1])),
    "long_line.csv": written("t,U,P,Q\n" + "1," * 3_000_000),
    "quote.csv": written(text(VALUES).replace("1.5,", '"1.5,')),
    # beside a table
    "beside_deep.csv": lambda path: _beside(path, DEEP),
    "beside_list.csv": lambda path: _beside(path, "[1]"),
    "beside_infinite.csv": lambda path: _beside(
        path, '{"base": {"power": 1e999}, "name": "\\u001b[31m"}'
    ),
    "beside_surrogate.csv": lambda path: _beside(path, '{"name": "\\udcff", "note": "\\ud800"}'),
    "beside_endless.csv": lambda path: _beside(path, '{"name": ' + "9" * 10_000 + "}"),
    # COMTRADE and other recorders' files
    "many.cfg": comtrade(samples="9" * 18),
    "endless.cfg": comtrade(samples="9" * 5000),
    "flat.cfg": comtrade(ratio="0"),
    "infinite.cfg": comtrade(ratio="1e999"),
    "escapes.cfg": comtrade(name=f"UA{ESCAPE}"),
    "fast.cfg": comtrade(rate="5e11"),
    "slow.cfg": comtrade(rate="1e-12"),
    "words.cfg": written("a\nb\n"),
    "zeros.cfg": written(bytes(5000)),
    "zeros.cff": written(bytes(5000)),
    "zeros.dat": written(bytes(5000)),
    "zeros.cev": written(bytes(5000)),
    # results
    "deep.json": written(DEEP),
    "number.json": written("9" * 10_000),
    "list.json": written("[]"),
    "null.json": written("null"),
    "latin.json": written(b'{"a": "\xff"}'),
    "bare.json": written('{"parameters": {}}'),
    "kind.json": written('{"tractexp": "1", "kind": ["a"]}'),
    "no_kind.json": written('{"tractexp": "1"}'),
    "look.json": written(
        '{"tractexp": "1", "kind": "look", "sources": 3, "settings": 1, "content": null}'
    ),
    "identify.json": written('{"tractexp": "1", "kind": "identify", "result": [[]]}'),
    "nested.json": written(result(parameters={"C": {"a": [1]}})),
    "texts.json": written(result(parameters={"C": "x"})),
    "missing.json": written(result(parameters={})),
    "infinite.json": written(result(parameters={**MOTOR, "C": float("nan")})),
    "huge.json": written(result(parameters={**MOTOR, "C": 10**400})),
    "outside.json": written(result(parameters={**MOTOR, "X_prime": 1e30})),
    "no_model.json": written(result(model={})),
    "list_model.json": written(result(model=[1])),
    "nested_model.json": written(result(model={"motor": {"name": {"a": 1}}, "static": 3})),
    "no_before.json": written(result(before={})),
    "infinite_before.json": written(
        result(before={"U0": float("inf"), "P0": 1, "Q0": 1, "frequency": 50})
    ),
    "base.json": written(result(own_base={"power": 0, "file_power": 1.0, "origin": "given"})),
    "list_base.json": written(result(own_base=[1])),
    "database.csv": database,
    "database.json": database,
}


def _beside(path: Path, content: str) -> Path:
    path.with_suffix(".json").write_text(content)
    return written(text(VALUES))(path)


def made(place: Path, only: Callable[[str], bool] = lambda name: True) -> dict[str, Path]:
    """{name: path} of the inputs, each in a folder of its own below `place`."""
    paths = {}
    for k, (name, make) in enumerate(INPUTS.items()):
        if only(name):
            folder = place / str(k)
            folder.mkdir(parents=True)
            paths[name] = make(folder / name)
    return paths
