"""The CSV reader: what it accepts, what it makes of it, and every way it refuses."""

import json
import sys

import numpy as np
import pytest

from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.record import detect


def rows(n=400):
    """(n, 4) t, U, P, Q of a dip, 6 digits."""
    t = np.arange(n) * 1e-3
    U = np.where((t >= 0.1) & (t < 0.2), 0.6, 1.0)
    return np.round(np.column_stack([t, U, 0.8 * U, 0.4 * U**2]), 6)


def text(table=None, header="t,U,P,Q", mark=","):
    table = rows() if table is None else table
    return "\n".join([header, *(mark.join(f"{x:g}" for x in row) for row in table)]) + "\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def read(content=None, **settings):
    with open("dip.csv", "w", encoding="utf-8") as file:
        file.write(text() if content is None else content)
    return build("data", {"name": "csv", "train": ["dip.csv"], **settings}).read().train[0]


def with_cell(line, column, cell):
    """The good file with the cell of one line (from 1, the header is line 1) replaced."""
    lines = text().splitlines()
    cells = lines[line - 1].split(",")
    cells[column] = cell
    lines[line - 1] = ",".join(cells)
    return "\n".join(lines)


def without_voltage(*lines):
    """The good file with U nan in some lines."""
    table = text().splitlines()
    for line in lines:
        cells = table[line - 1].split(",")
        table[line - 1] = ",".join([cells[0], "nan", *cells[2:]])
    return "\n".join(table)


@pytest.mark.usefixtures("here")
class TestWhatIsRead:
    def test_columns_become_the_record(self):
        record = read()
        np.testing.assert_array_equal(
            np.column_stack([record.t, record.U, record.P, record.Q]).round(9), rows()
        )
        assert (record.name, record.source, record.notes) == ("dip", "dip.csv", ())
        assert record.f is None
        assert detect(record).depth == pytest.approx(0.4)

    @pytest.mark.parametrize("mark", [",", ";", "\t"])
    def test_any_order_any_separator_comments_and_spare_columns(self, mark):
        table = rows()
        wide = np.column_stack(
            [table[:, [2, 0]], np.full(400, 7.0), table[:, [3, 1]], np.full(400, 49.9)]
        )
        header = mark.join(["P", " t", "breaker", "Q ", "U", "f"])
        content = "# a recorder\n\n" + text(wide, header, mark).replace("\n", "  # remark\n", 3)
        record = read("\ufeff" + content)
        np.testing.assert_array_equal(np.column_stack([record.U, record.P, record.Q]), table[:, 1:])
        assert record.f[0] == 49.9
        assert record.notes == ("columns not used: breaker",)

    def test_kilovolts_and_megawatts_are_divided_by_the_base(self):
        table = rows() * [1, 27.5, 20, 20]
        record = read(text(table), base_voltage=27.5, base_power=20.0)
        np.testing.assert_allclose(
            np.column_stack([record.U, record.P, record.Q]), rows()[:, 1:], atol=1e-6
        )
        assert (record.base.voltage, record.base.power) == (27.5, 20.0)

    def test_gaps_in_power_are_written_nan(self):
        assert np.isnan(read(with_cell(12, 2, "nan")).P[10])

    def test_a_sidecar_gives_name_and_note(self, here):
        (here / "dip.json").write_text(
            json.dumps({"name": "Tuesday", "note": "synthetic stand-in", "truth": {}})
        )
        record = read()
        assert record.name == "Tuesday"
        assert record.notes == ("synthetic stand-in",)

    def test_a_file_inside_an_installed_package(self, here, monkeypatch):
        (here / "in_package").mkdir()
        (here / "in_package" / "__init__.py").touch()
        (here / "in_package" / "inside.csv").write_text(text())
        monkeypatch.syspath_prepend(here)
        path = "pkg://in_package/inside.csv"
        record = build("data", {"name": "csv", "train": [path]}).read().train[0]
        sys.modules.pop("in_package")
        assert (record.name, record.source, record.samples) == ("inside", path, 400)

    def test_files_of_one_name_in_two_folders_keep_different_names(self, here):
        for folder in ("a", "b"):
            (here / folder).mkdir()
            (here / folder / "dip.csv").write_text(text())
        events = build(
            "data", {"name": "csv", "train": ["a/dip.csv"], "validate": ["b/dip.csv"]}
        ).read()
        assert [events.train[0].name, events.validate[0].name] == ["a/dip.csv", "b/dip.csv"]


@pytest.mark.usefixtures("here")
class TestWhatIsRefused:
    @pytest.mark.parametrize(
        ("content", "says"),
        [
            (
                "",
                r"dip.csv: the file is empty; it must start with a line naming the columns t,U,P,Q",
            ),
            ("# only a remark\n", "the file is empty"),
            ("t,U,P,Q\n", "there are no rows below the header line"),
            (
                text(header="when,U,P,Q"),
                "column t is missing; the header line names when, U, P, Q; .*data.columns={t: '",
            ),
            (text(header="t,U,P,X"), "column Q is missing"),
            (
                text(rows()[:, [0, 1, 2, 3, 3]], "t,U,P,Q,Q"),
                "Q could be any of the columns 'Q', 'Q'; say which",
            ),
            (with_cell(5, 2, "abc"), "dip.csv: line 5, column P: 'abc' is not a number"),
            (
                without_voltage(5, 6, 7, 8),
                "dip.csv: line 5: U = nan is not a finite number; only P and Q",
            ),
            (without_voltage(2), "line 2: U = nan is not a finite number; only P and Q may have"),
            (without_voltage(*range(5, 60, 2)), "line 5: U = nan is not a finite number"),
            (with_cell(5, 0, "0.002"), "line 5: time does not increase: t = 0.002 s after 0.002 s"),
            (with_cell(9, 1, "0"), "line 9: U = 0, but voltage must be above zero everywhere"),
            (with_cell(9, 1, "-0.4"), "line 9: U = -0.4, but"),
            (with_cell(9, 2, "inf"), "line 9: P = inf is not a finite number"),
            ("# remark\n\n" + with_cell(9, 1, "-0.4"), "line 11: U = -0.4"),
            (
                text(np.delete(rows(), [50, 51, 52, 53], axis=0)),
                "line 52: t advances by 0.005 s where 0.001 s is usual: rows are missing",
            ),
            (
                text().replace(".", ","),
                "line 2 has 6 cells where the header line names 4 columns; if the decimal mark",
            ),
            (
                text(rows() * [1, 110, 30, 30]),
                "U starts at 110, which is not per unit .* data.base_voltage",
            ),
            (
                "\n".join(line[: line.rfind(",")] for line in text().splitlines()),
                "column Q is missing",
            ),
            (
                text().replace("0.003,1,0.8,0.4", "0.003,1,0.8"),
                "line 5 has 3 cells where the others have 4",
            ),
        ],
    )
    def test_a_bad_file_gets_a_sentence_with_the_place(self, content, says):
        with pytest.raises(UserError, match=says):
            read(content)

    def test_a_missing_file_is_refused_with_the_nearest_name(self):
        read()
        with pytest.raises(
            UserError, match=r"dpi.csv: there is no such file in \.; did you mean 'dip.csv'\?"
        ):
            build("data", {"name": "csv", "train": ["dpi.csv"]}).read()

    def test_a_missing_folder_or_package_is_said(self):
        with pytest.raises(UserError, match="that folder does not exist"):
            build("data", {"name": "csv", "train": ["nowhere/dip.csv"]}).read()
        with pytest.raises(UserError, match="there is no installed package 'no_such_package'"):
            build("data", {"name": "csv", "train": ["pkg://no_such_package/dip.csv"]}).read()

    def test_text_that_is_not_of_the_encoding_asked_for_is_refused(self, here):
        (here / "dip.csv").write_bytes("t,U,P,Q,Störung\n".encode("latin-1"))
        with pytest.raises(
            UserError, match=r"dip.csv: not utf-8 text; leave data.encoding out to have it detected"
        ):
            build("data", {"name": "csv", "train": ["dip.csv"], "encoding": "utf-8"}).read()

    def test_a_broken_sidecar_is_refused(self, here):
        (here / "dip.json").write_text("{")
        with pytest.raises(UserError, match=r"dip.json: line 1: not valid JSON"):
            read()

    @pytest.mark.parametrize(
        ("settings", "says"),
        [
            ({"train": []}, "data.train is empty"),
            (
                {"path": "dip.csv"},
                "data.train and data.validate are numbers of its dips, and 'dip.csv' is none",
            ),
            ({"validate": ["dip.csv"]}, "name 'dip.csv' twice"),
            ({"base_voltage": 0.0}, "data.base_voltage=0.0 is out of range"),
            ({"frequency": float("nan")}, "data.frequency=nan is out of range"),
        ],
    )
    def test_a_bad_setting_is_refused(self, settings, says):
        with pytest.raises(UserError, match=says):
            build("data", {"name": "csv", "train": ["dip.csv"], **settings})
