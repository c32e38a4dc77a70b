"""CSV in every dialect that loggers write, with every fault, and back from our own writer."""

import codecs
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aqualog.align.mapping import SignalMap, resolve
from aqualog.core.errors import ConfigError, LogError, SignalError
from aqualog.io.open_log import open_log
from aqualog.io.reader import CsvFormat, ReadOptions
from aqualog.io.tables import csv_text as text_file
from aqualog.io.tables.columns import split_unit, unique_names
from aqualog.io.tables.csv import CsvReader
from aqualog.io.tables.parquet import ParquetReader
from aqualog.io.write_table import TableColumn, write_csv


class Read:
    """A file written, read whole, and what was said about it."""

    def __init__(self, path: Path, **options):
        with CsvReader(path, ReadOptions(**options)) as reader:
            self.infos = reader.channels()
            self.channels = {c.info.path: c for c in reader.read(self.infos)}
            self.faults = reader.faults

    def __getitem__(self, path):
        return self.channels[path].values.tolist()

    def t(self, path):
        return self.channels[path].t_ns.tolist()

    @property
    def units(self):
        return {i.path: i.unit for i in self.infos}

    def noted(self, *parts):
        return any(all(p in n for p in parts) for n in self.faults.notes)


@pytest.fixture
def read(tmp_path):
    def write_and_read(text, encoding="utf-8", **options):
        path = tmp_path / "log.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        before = path.read_bytes()
        result = Read(path, **options)
        assert path.read_bytes() == before
        return result

    return write_and_read


def table(rows=40, separator=",", line=lambda k: (f"{k / 100:.2f}", f"{k * 1.5:.1f}"), end="\n"):
    return "".join(separator.join(line(k)) + end for k in range(rows))


def nan_as_none(values):
    return [None if np.isnan(v) else v for v in values]


def test_comma_point_utf8(read):
    log = read("t [s],omega_fl [rad/s],v_x (km/h),Öl [°C]\n0.00,1.5,36,80\n0.01,-2e1,37.5,81\n0.02,.5,38.,82\n")
    assert log.units == {"omega_fl": "rad/s", "v_x": "km/h", "Öl": "°C"}
    assert log["omega_fl"] == [1.5, -20.0, 0.5]
    assert log.t("v_x") == [0, 10_000_000, 20_000_000]
    assert log.faults.notes == ()
    assert log.faults.lost_samples == 0
    assert [i.count for i in log.infos] == [3, 3, 3]
    assert {i.file for i in log.infos} == {"log.csv"}
    assert not log.channels["v_x"].absolute


def test_semicolon_decimal_comma_latin1(read):
    text = (
        "Zeit [s];Temperature [°C];Gänge;v [m/s²]\r\n" + "0,00;21,5;1;-0,25\r\n0,01;21,75;1;1,5e-3\r\n0,02;22;2;3\r\n"
    )
    log = read(text, "latin-1")
    assert log.units == {"Temperature": "°C", "Gänge": "", "v": "m/s²"}
    assert log["Temperature"] == [21.5, 21.75, 22.0]
    assert log["v"] == [-0.25, 0.0015, 3.0]
    assert log.t("v") == [0, 10_000_000, 20_000_000]


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_tab_units_row_t_ms_utf16(read, encoding):
    text = "t_ms\tv_x\tmu\tDruck\n\tkm/h\t-\tbar\n" + "100\t36\t0.5\t2.1\n120\t37\t0.25\t2.2\n"
    mark = {"utf-16-le": codecs.BOM_UTF16_LE, "utf-16-be": codecs.BOM_UTF16_BE}.get(encoding, b"")
    log = read(mark + text.encode(encoding))
    assert log.units == {"v_x": "km/h", "mu": "-", "Druck": "bar"}
    assert log.t("v_x") == [100_000_000, 120_000_000]
    assert log["Druck"] == [2.1, 2.2]


@pytest.mark.parametrize(("below", "is_noted"), [("m/s", True), ("kph", False), ("", False), ("km/h", False)])
def test_a_row_of_units_that_contradicts_the_header_is_noted(read, below, is_noted):
    log = read(f"t [s],v_x [km/h],torque\ns,{below},N*m\n" + "0.1,36,5\n0.2,37,6\n")
    assert log.units == {"v_x": "km/h", "torque": "N*m"}
    assert log.noted('"v_x"', "in km/h, as its header says", "row of units says m/s") == is_noted
    assert bool(log.faults.notes) == is_noted


def test_one_damaged_byte_does_not_change_the_names(read):
    raw = ("t [s],Öl [°C],v\n" + table(200, line=lambda k: (f"{k / 100:.2f}", "80", "7"))).encode()
    damaged = raw.replace(b"0.77,80", b"0.77,8\xff")
    log = read(damaged)
    assert log.units["Öl"] == "°C"
    assert np.isnan(log["Öl"][77])
    assert log.noted("line 79")


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_separators_and_line_ends(read, separator, end):
    log = read(f"t [s]{separator}v{end}" + table(20, separator, end=end))
    assert log["v"] == [k * 1.5 for k in range(20)]
    assert log.faults.notes == ()


def test_preamble_of_a_logger(read):
    text = "sep=;\n# comment; with; signs\nLogger: ACME 5\nSample rate: 100\nDriver;Mr X\n\n"
    text += "t;v;a\ns;km/h;m/s^2\n\n0;1;2\n1;2;3\n2;3;4\n"
    log = read(text)
    assert log.units == {"v": "km/h", "a": "m/s^2"}
    assert log["a"] == [2, 3, 4]
    assert log.faults.notes == ()


LONG = [f"{k},5;{k};0,5\n" for k in range(5000)]
PROVEN = [f"{k},5;{1 + k / 1000:.3f}\n" for k in range(200)]
LAYOUTS = {  # text, units, values, times [ns]
    "header in a comment, as numpy writes it": ("# t [s],v [m/s]\n0.0,1\n0.1,2\n", {"v": "m/s"}, {"v": [1, 2]}),
    "groups above the names": (
        "ESP,ESP,MOT\nt,v,M\ns,km/h,Nm\nfloat,float,float\n0.0,1,2\n0.1,2,3\n",
        {"v": "km/h", "M": "Nm"}, {"M": [2, 3]},
    ),
    "a preamble as wide as the table": (
        "Vehicle,Golf,dry\nDate,today,noon\nt [s],v [m/s],w\n" + "".join(f"{k},{k},{k}\n" for k in range(200)),
        {"v": "m/s", "w": ""}, {},
    ),
    "quotes": (
        '"t [s]","v, filtered [m/s]"\n"0.0","1.5"\n"0.1","2.5"\n', {"v, filtered": "m/s"}, {"v, filtered": [1.5, 2.5]},
    ),
    "a quoted decimal comma between commas": (
        't,v,name\n"0,0","1,5","a ""b"", c"\n"0,1","2,5",d\n"0,2","3,5",e\n', {}, {"v": [1.5, 2.5, 3.5]},
        [0, 10**8, 2 * 10**8],
    ),
    "separators at the ends of rows": ("t,v\n0.0,1,\n0.1,2,\n0.2,3,\n", {"v": ""}, {"v": [1, 2, 3]}),
    "separators at all ends": ("t,v,\n0.0,1,\n0.1,2,\n0.2,3,\n", {"v": ""}, {"v": [1, 2, 3]}),
    "blanks around cells": ("t [s], v [m/s] , w\n 0.0, 1.5 , 2\n 0.1, 2.5 ,\n", {}, {"v": [1.5, 2.5], "w": [2]}),
    "thousands that are proven": (
        "t;m;n\n0,5;1.234,5;1.000\n1,5;12.345.678,25;999\n2,5;0,25;1.234\n", {},
        {"m": [1234.5, 12345678.25, 0.25], "n": [1000, 999, 1234]},
    ),
    "a decimal sign for each column": (
        "t;a;m\n0;1.5;1.234,5\n1;2.5;1.235,5\n2;3.25;1.236,5\n", {},
        {"a": [1.5, 2.5, 3.25], "m": [1234.5, 1235.5, 1236.5]},
    ),
    "a column of points in a file of commas": (
        "t [s];v;n;p\n0,00;50,5;3;1.234\n0,01;51,5;4;5.678\n", {}, {"p": [1.234, 5.678], "n": [3, 4]},
    ),
    "thousands in a file of commas": (
        "t [s];v;p\n0,00;50,5;790\n0,01;51,5;1.570\n", {}, {"p": [790, 1570]},
    ),
    "thousands in a file of points": (
        "t [s];v;p\n0.00;50.5;790\n0.01;51.5;1,570\n", {}, {"p": [790, 1570]},
    ),
    "fractions beside integers in a file of commas": (
        "t [s];v;p\n0,00;50,5;1\n0,01;51,5;0.570\n", {}, {"p": [1, 0.57]},
    ),
    "integers of a file of commas that turn into fractions": (
        "t [s];n;v\n" + "".join([*LONG[:700], "700,5;700,25;0,5\n", *LONG[701:]]), {},
        {"n": [*range(700), 700.25, *range(701, 5000)]},
    ),
    "thousands proven in one column hold in the others": (
        "t [s];v;n;p\n0;1.234,5;1.234;0.250\n1;2,5;2.345;1.234\n", {}, {"n": [1234, 2345], "p": [0.25, 1.234]},
    ),
    "one damaged cell proves no thousands": (
        "t [s];p\n" + "".join([*PROVEN[:7], "1.234.007,5;1.007\n", *PROVEN[8:]]), {},
        {"p": [round(1 + k / 1000, 3) for k in range(200) if k != 7]},
    ),
    "a late change of type": (
        "t [s],v\n" + "".join(f"{k},{k}\n" for k in range(5000)) + "5000,1.25\n", {}, {"v": [*range(5000), 1.25]},
    ),
    "truth values": (
        "t [s],on_water,b\n0,true,False\n1,false,TRUE\n2,True,false\n", {}, {"on_water": [1, 0, 1], "b": [0, 1, 0]},
    ),
    "a column that starts late": (
        "t [s],v,late\n" + "".join(f"{k},1,{'' if k < 4000 else '5.5'}\n" for k in range(5000)), {},
        {"late": [5.5] * 1000},
    ),
    "no end of the last line": ("t [s],v\n0,1\n1,2", {}, {"v": [1, 2]}),
    "dates beside times of day": (
        "Date;Time;v\n28.02.2026;23:59:59,5;1,5\n01.03.2026;00:00:00,5;2,5\n", {}, {"v": [1.5, 2.5]},
        [1772323199500000000, 1772323200500000000],
    ),
    "German dates beside times of day": (
        "Datum;Uhrzeit;v\n01.03.2026;12:00:00,00;1,5\n01.03.2026;12:00:00,01;2,5\n", {}, {"v": [1.5, 2.5]},
        [1772366400000000000, 1772366400010000000],
    ),
    "times out of order and twice": (
        "t [s],v\n2,1\n1,2\n1,3\n0,4\n", {}, {"v": [1, 2, 3, 4]}, [2 * 10**9, 10**9, 10**9, 0],
    ),
    "the logger's clock before UTC": (
        "utc [ms],t [s],v\n1.53322649e+12,46408.655,1\n1.53322649e+12,46408.7445,2\n", {}, {"v": [1, 2]},
        [46408655000000, 46408744500000],
    ),
    "whole seconds": ("time,v\n" + "".join(f"{k},1\n" for k in range(600)), {}, {}, [k * 10**9 for k in range(600)]),
}  # fmt: skip


@pytest.mark.parametrize("case", LAYOUTS)
def test_layouts(read, case):
    text, units, values, *times = LAYOUTS[case]
    log = read(text)
    assert {name: log.units[name] for name in units} == units
    assert {name: log[name] for name in values} == values
    assert not times or log.t("v") == times[0]
    assert not times or log.channels["v"].absolute == (times[0][-1] > 10**18)

    assert log.faults.lost_samples == (case == "one damaged cell proves no thousands")
    assert not log.faults.truncated
    assert not log.noted("line") or log.faults.lost_samples


def test_thousands_that_other_columns_show_are_noted(read):
    log = read("t [s];v;p\n0,00;50,5;790\n0,01;51,5;1.570\n")
    assert log.noted('column "p": "." is between thousands, since other columns')
    assert read(LAYOUTS[FOREIGN][0]).noted('whether "1.234" is a fraction or thousands is not proven')


@pytest.mark.parametrize("head", ["omega_fl", "speed [rad/s]"])
def test_a_signal_whose_cells_are_all_text_is_noted(read, head):
    name = head.partition(" [")[0]
    assert read(f"t [s];v;{head};note\n0;1;0x55;a\n1;2;0x56;b\n").noted(
        f'column "{name}" is left out: 2 of 2 cells', "0x55"
    )
    assert not read(f"t [s];v;{head};note\n0;1;0x55;a\n1;2;0x56;b\n").noted('"note" is left out')


FOREIGN = "a column of points in a file of commas"


@pytest.mark.parametrize("encoding", ["cp1252", "mac_roman", "cp850", "utf-8-sig"])
def test_unit_proves_the_code_page(read, encoding):
    assert read("t [s],Öltemperatur [°C]\n" + table(), encoding).units == {"Öltemperatur": "°C"}


@pytest.mark.parametrize(
    ("separator", "cells", "expected"),
    [(";", ["1.234,5", "12,5"], [1234.5, 12.5]), (";", ["1.234.567", "1.234", "5"], [1234567, 1234, 5]),
     (";", ["1,234.5", "1,234", "0.5"], [1234.5, 1234, 0.5]), (";", ["-1.234.567,25", "7"], [-1234567.25, 7]),
     (",", ['"1,234.5"', "7.5", '"1,000"'], [1234.5, 7.5, 1000]), (",", ['"1,234"', "950"], [1234, 950]),
     (",", ['"0,234"', '"9,5"', "7"], [0.234, 9.5, 7]), (";", ["1", "2", "3"], [1, 2, 3]),
     (";", ["1.234", "5.678"], [1.234, 5.678]), (";", ["1,234", "5,678"], [1.234, 5.678]),
     (";", ["1,5e3", "-,5", "+2,"], [1500, -0.5, 2]), (";", [".5", "5.", "1E-3"], [0.5, 5, 1e-3])],
)  # fmt: skip
def test_decimal_and_thousands(read, separator, cells, expected):
    sign = "," if separator == ";" else "."
    rows = [f"0{sign}{k}{separator}{c}\n" for k, c in enumerate(cells)]
    log = read(f"t{separator}v\n" + "".join(rows))
    assert log["v"] == expected
    assert log.faults.lost_samples == 0


def test_both_decimal_signs_in_one_column_are_not_guessed_at(read):
    log = read("t [s];v\n0;1,5\n1;1.234\n2;2,5\n3;3,5\n")
    assert nan_as_none(log["v"]) == [1.5, None, 2.5, 3.5]
    assert log.faults.lost_samples == 1
    assert log.noted('"v"', "line 3")


def test_point_is_no_decimal_sign_beside_decimal_commas(read):
    lines = [f"{k},0;{k},5;1,5\n" for k in range(200)]
    lines[150] = "150,0;1.234;1,5\n"
    log = read("t [s];v;w\n" + "".join(lines))
    assert np.isnan(log["v"][150])
    assert log.faults.lost_samples == 1
    assert log.noted('"v"', "line 152")


def test_blank_is_no_sample_and_bad_is_nan(read):
    log = read("t [s],a,b\n0.0,1,\n0.1,,5\n0.2,NaN,6\n0.3,-,7\n0.4,#N/A,8\n0.5,inf,9\n0.6,null,1\n0.7,1e999,2\n")
    assert log.t("a") == [k * 100_000_000 for k in (0, 2, 3, 4, 5, 6, 7)]
    assert nan_as_none(log["a"]) == [1] + [None] * 6
    assert log["b"] == [5, 6, 7, 8, 9, 1, 2]
    assert log.faults.lost_samples == 0


def test_faults_are_counted_once(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],v,w\n" + table(200, line=lambda k: (f"{k}", "x" if k == 9 else "1", "2")) + "oops,1,1\n")
    with CsvReader(path, ReadOptions()) as reader:
        v, w = reader.channels()
        reader.read([w])
        assert reader.faults.lost_samples == 1
        reader.read([w, v])
        reader.read([v])
        assert reader.faults.lost_samples == 2


def test_read_keeps_the_order_asked_for(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],v,w\n0,1,2\n1,3,4\n")
    with CsvReader(path, ReadOptions()) as reader:
        v, w = reader.channels()
        assert [c.info.path for c in reader.read([w, v])] == ["w", "v"]
        assert reader.read([]) == []


def test_text_columns_are_no_channels(read):
    log = read("t [s],v,state,gear\n" + table(40, line=lambda k: (str(k), "1", "OK", "P" if k % 4 == 0 else "3")))
    assert [i.path for i in log.infos] == ["v"]
    assert log.noted('"gear"', "10 of 40 cells looked at", '"P"')
    assert not log.noted('"state"')


def test_duplicate_names(read):
    log = read("t [s],v [m/s],v [km/h],v\n0,1,2,3\n1,4,5,6\n")
    assert [(i.path, i.name, i.unit) for i in log.infos] == [("v", "v", "m/s"), ("v#2", "v", "km/h"), ("v#3", "v", "")]
    assert log["v#2"] == [2, 5]
    assert log.noted('"v"', "several")
    with pytest.raises(SignalError, match="several channels bear this name"):
        resolve(read("t [s],v_x [m/s],v_x [km/h]\n0,1,2\n1,4,5\n").infos, SignalMap())


def test_two_times_are_one_too_many(read):
    text = "t [s],v,t [s],w\n0,1,0.5,3\n1,4,1.5,6\n"
    with pytest.raises(LogError, match=r'several columns called "t".*channel = "t"'):
        read(text)
    assert read(text, time_channel="t").t("w") == [0, 10**9]


@pytest.mark.parametrize("is_large", [False, True])
@pytest.mark.parametrize(("before", "line"), [("", 3), ("9,9\n" * 30, 33)])
def test_a_line_without_an_end_is_refused(read, monkeypatch, is_large, before, line):
    monkeypatch.setattr(text_file, "LONGEST_LINE", 100)
    monkeypatch.setattr(text_file, "_BLOCK", 90)
    monkeypatch.setattr(text_file, "LARGE", 1 if is_large else 1 << 20)
    text = "t [s],v\n0,1\n" + before
    with pytest.raises(LogError, match=rf"line {line} is longer than 100 bytes"):
        read(text + "1" * 101 + "\n2,3\n")
    assert read(text + "1,2" + " " * 97 + "\n2,3\n")["v"][-1] == 3


@pytest.mark.parametrize("content", [b"t,v\n0,1\n1,\0\0\n", "t,v\n0,1\n1,2\n".encode("utf-16-le")])
def test_nul_bytes_are_named(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"text with NUL bytes \(first at line [13]\)"):
        open_log(path)


def test_short_and_long_rows(read):
    lines = [f"{k / 100:.2f},{k},7\n" for k in range(300)]
    lines[10] = "0.10,10\n"
    lines[20] = "0.20,20,7,9\n"
    log = read("t [s],v,w\n" + "".join(lines))
    assert len(log["v"]) == 299
    assert 20.0 not in log["v"]
    assert len(log["w"]) == 298
    assert log.faults.lost_samples == 2
    assert log.noted("line 12 ", "fewer")
    assert log.noted("line 22 ", "more")


def test_a_short_and_a_long_row_do_not_cancel(read):
    log = read("t [s],v,w\n" + table(line=lambda k: (f"{k}", "1", "2")) + "40,1\n41,1,2,3\n42,1,2\n")
    assert log.t("w")[-1] == 42 * 10**9
    assert log.noted("line 42", "fewer")
    assert log.noted("line 43", "more")


def test_blank_lines_and_comments_among_the_data(read):
    log = read("t [s],v\n0,1\n\n1,2\n# lap 2\n2,3\n,\n\n")
    assert log["v"] == [1, 2, 3]
    assert log.faults.lost_samples == 0
    assert log.noted("line 5", "comment")


def test_file_that_ends_inside_a_row(read):
    log = read("t [s],v,w\n" + table(line=lambda k: (f"{k}", "123.5", "2")) + "40,12")
    assert log.faults.truncated
    assert log["v"][-1] == 123.5
    assert len(log["v"]) == 40
    assert log.noted("line 42")


def test_zeros_behind_a_power_cut(read):
    log = read(b"t [s],v\n" + table(200).encode() + b"\0" * 100)
    assert len(log["v"]) == 200
    assert log.faults.lost_samples >= 1


def test_stray_quote(read):
    lines = [f"{k},{k}\n" for k in range(200)]
    lines[50] = '50,"50\n'
    log = read("t [s],v\n" + "".join(lines))
    assert len(log["v"]) >= 199
    assert log["v"][-1] == 199


@pytest.mark.parametrize(
    ("header", "cells", "t_ns"),
    [
        ("t", ("0.1", "0.2"), (10**8, 2 * 10**8)),
        ("Time [s]", ("0.1", "0.2"), (10**8, 2 * 10**8)),
        ("time [ms]", ("0.5", "1.5"), (500_000, 1_500_000)),
        ("TIMESTAMP_US", ("5", "10"), (5000, 10_000)),
        ("t_ns", ("9007199254740993", "9007199254740995"), (9007199254740993, 9007199254740995)),
        ("Zeit (ms)", ("5", "10"), (5_000_000, 10_000_000)),
        ("timestamps [min]", ("1", "2"), (60 * 10**9, 120 * 10**9)),
        ("t [s]", ("8388607.000000001", "8388607.000000002"), (8388607000000001, 8388607000000002)),
        ("utc", ("2026-03-01T12:00:00.010Z", "2026-03-01T12:00:00.020Z"), (1772366400010000000, 1772366400020000000)),
        ("time", ("2026-03-01 12:00:00.010", "2026-03-01 12:00:00.020"), (1772366400010000000, 1772366400020000000)),
        (
            "time",
            ("2026-03-01T13:00:00.01+01:00", "2026-03-01T13:00:00.02+01:00"),
            (1772366400010000000, 1772366400020000000),
        ),
        ("Zeit", ("01.03.2026 12:00:00", "01.03.2026 12:00:01"), (1772366400000000000, 1772366401000000000)),
        ("time", ("12:00:00.010", "12:00:00.020"), (43200010000000, 43200020000000)),
        ("timestamp", ("1772366400.123456789", "1772366400.133456789"), (1772366400123456789, 1772366400133456789)),
        ("timestamp", ("1772366400123", "1772366400133"), (1772366400123000000, 1772366400133000000)),
        ("timestamp", ("1772366400123456", "1772366400133456"), (1772366400123456000, 1772366400133456000)),
        ("timestamp", ("1772366400123456789", "1772366400133456789"), (1772366400123456789, 1772366400133456789)),
    ],
)  # fmt: skip
def test_times(read, header, cells, t_ns):
    log = read(f"{header},v\n{cells[0]},1\n{cells[1]},2\n")
    assert log.t("v") == list(t_ns)
    assert log.channels["v"].absolute == (t_ns[0] > 10**18)


@pytest.mark.parametrize(("step", "by", "unit"), [(10, 1, "ms"), (1, 1, "ms"), (0.007, 1e9, "ns")])
def test_whole_numbers_over_an_absurd_time_are_no_seconds(read, step, by, unit):
    """Up to rounding, as of seconds that somebody multiplied."""
    log = read("time,v\n" + "".join(f"{k * step * by},1\n" for k in range(30_000)))
    assert log.t("v")[:2] == [0, step * by * (10**6 if unit == "ms" else 1)]
    assert log.noted("no unit", f"as {unit} ")


@pytest.mark.parametrize(("header", "step", "notes"), [("t", 0.01, 0), ("time", 0.01, 1), ("t", 10, 1)])
def test_t_is_in_seconds_unless_its_steps_are_others(read, tmp_path, header, step, notes):
    log = read(f"{header},v\n" + "".join(f"{k * step:.6g},1\n" for k in range(30_000)))
    assert [log.t("v")[1], len(log.faults.notes)] == [10_000_000, notes]
    pl.DataFrame({header: [k * step for k in range(30_000)], "v": [1.0] * 30_000}).write_parquet(tmp_path / "x.parquet")
    with ParquetReader(tmp_path / "x.parquet", ReadOptions()) as reader:
        reader.read(reader.channels())
        assert sum("no unit" in n for n in reader.faults.notes) == notes


def test_a_date_that_can_be_read_two_ways(read):
    with pytest.raises(LogError, match="day and month"):
        read("time,v\n03/01/2026 12:00:00,1\n03/01/2026 12:00:01,2\n")
    assert read("time,v\n02/28/2026 12:00:00,1\n03/01/2026 12:00:01,2\n").t("v")[0] == 1772280000000000000


def test_rows_without_a_time(read):
    lines = [f"{k},{k}\n" for k in range(200)]
    lines[30], lines[31] = ",30\n", "??,31\n"
    log = read("t [s],v\n" + "".join(lines))
    assert len(log["v"]) == 198
    assert log.faults.lost_samples == 2
    assert log.noted('"t"', "line 32")


def test_the_users_time(read):
    text = "t [s],clock,v\n0,100,1\n1,200,2\n"
    log = read(text, time_channel="clock", time_unit="us")
    assert log.t("v") == [100_000, 200_000]
    assert log["t"] == [0, 1]
    assert read(text, time_unit="ms").t("v") == [0, 10**6]
    assert read(text, time_channel="other").noted('"other"')
    with pytest.raises(ConfigError, match="km/h"):
        read(text, time_unit="km/h")


def told(name="*", **keys):
    return {"csv": {name: CsvFormat.of(keys)}}


def test_a_separator_that_is_not_tried_by_itself(read):
    text = "t~v\n" + table(separator="~")
    with pytest.raises(LogError, match=r"one column only.*\[csv\] separator"):
        read(text)
    assert read(text, **told(separator="~"))["v"][2] == 3.0
    assert read(text, **told("lo*.csv", separator="~"))["v"][2] == 3.0
    with pytest.raises(LogError, match="one column only"):
        read(text, **told("other.csv", separator="~"))


def test_the_separator_that_is_named_alone_is_tried(read):
    text = "t;v\n" + table(separator=";")
    with pytest.raises(LogError, match='has no "comma", by which the map says'):
        read(text, **told(separator="comma"))
    assert read("t v\n" + table(separator=" "), **told(separator="space"))["v"][2] == 3.0


@pytest.mark.parametrize(("sign", "value"), [(".", 1.234), (",", 1234.0)])
def test_a_decimal_sign_that_no_cell_proves_is_told_and_can_be_said(read, sign, value):
    text = "t;v\n" + "".join(f"{k};{k}.234\n" for k in range(1, 40))
    log = read(text)
    assert log["v"][0] == 1.234
    assert log.noted('whether "1.234" is a fraction or thousands is not proven', "[csv] decimal")
    log = read(text, **told(decimal=sign))
    assert log["v"][0] == value
    assert not log.noted("not proven")


@pytest.mark.parametrize("cell", ["0.234", "1234.567", "1.2345", "1.2"])
def test_one_cell_proves_the_decimal_sign(read, cell):
    assert not read("t;v\n" + "".join(f"{k};{k}.234\n" for k in range(1, 40)) + f"40;{cell}\n").noted("not proven")


def test_decimal_comma_that_is_said(read):
    log = read("t;v\n" + "".join(f"{k};{k},5\n" for k in range(1, 40)) + "40;1.234,5\n", **told(decimal=","))
    assert log["v"][-1] == 1234.5
    with pytest.raises(LogError, match="columns hold numbers"):
        read("t;v\n" + "".join(f"{k},0;{k},5\n" for k in range(40)), **told(decimal="."))


def test_an_encoding_that_is_said(read):
    text = "t;Größe\n" + table(separator=";")
    assert read(text, "cp850", **told(encoding="cp850")).infos[0].name == "Größe"
    assert read(text, "utf-16-le", **told(encoding="utf-16-le")).infos[0].name == "Größe"
    assert read(text, "utf-8-sig", **told(encoding="utf-8")).infos[0].name == "Größe"
    with pytest.raises(LogError, match=r"is not in the utf-8 that the map names \(line 1, byte 4: f6"):
        read(text, "cp1252", **told(encoding="utf-8"))


def test_an_encoding_that_is_guessed_is_told_with_the_way_to_say_it(read):
    assert read("t;Größe\n" + table(separator=";"), "cp1252").noted("taken as", '[csv] encoding = "cp1252"')
    german = "Zeit [s];Längsbeschleunigung [g]\n" + table(separator=";")
    assert read(german, "cp1252").noted("taken as cp1252", '[csv] encoding = "cp1252"')
    russian = "t;скорость колеса и угол поворота\n" + table(separator=";")
    assert read(russian, "cp1251").noted("taken as cp1251", '[csv] encoding = "cp1251"')
    odd = ("t;v [°C]\n" + table(8000, ";")).encode("cp1252") + b"99;\x81\n"
    assert read(odd).noted("is cp1252, but not everywhere (first at line 8002); taken as latin-1")


def test_utf_16_without_a_mark_is_opened_if_it_is_said(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(("t,v\n" + table()).encode("utf-16-le"))
    with pytest.raises(LogError, match=r"NUL bytes.*\[csv\] encoding"):
        open_log(path)
    with open_log(path, ReadOptions(**told(encoding="utf-16-le"))) as log:
        assert log.read(log.channels())[0].values[2] == 3.0


def test_a_first_line_without_an_end_is_named(read, monkeypatch):
    monkeypatch.setattr("aqualog.io.tables.csv_dialect._HEAD_BYTES", 1000)
    with pytest.raises(LogError, match="first line is longer than 1000 bytes"):
        read("t," + ",".join(f"x{k}" for k in range(1000)) + "\n" + table())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("0.0,1\n0.1,2\n0.2,3\n", "no header line"),
        ("a,b\n0.0,1\n0.1,2\n", r"no time column among: a, b.*\[time\] channel"),
        (
            "t,a,b\n" + "".join(f"{k}.5,{k},1\n" for k in range(60)) + "".join(f"{k}.5;{k};1\n" for k in range(60, 99)),
            r'column "t" is no time: .*separator or decimal mark; \[time\] channel = "t"',
        ),
        ("just one\ncolumn of\ntext\n", "one column only"),
        ("t,v\nx,y\nz,w\n", "not a table|no data"),
        ("t,v\n", "one line only"),
        ("a,b,c\none,two,three\nfour,five,six\nseven,eight,nine\n", "not a table"),
        ("t,v\n0,1,2\n1,2,3\n2,3,4\n3,4,5\n", "2 names, but 3 cells"),
        ("t,v\n0,1,2,5\n", "2 names, but 4 cells in a row, as decimal commas make"),
    ],
)
def test_refusals_say_what_to_do(read, text, says):
    with pytest.raises(LogError, match=says) as caught:
        read(text)
    assert "log.csv" in caught.value.line()
    assert caught.value.hint


def test_missing_file(tmp_path):
    with pytest.raises(LogError, match="cannot be opened"):
        CsvReader(tmp_path / "no.csv", ReadOptions())


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [("omega_fl [rad/s]", "omega_fl", "rad/s"), ("v_x (km/h)", "v_x", "km/h"),
     ("speed (filtered)", "speed (filtered)", ""), ("max. SoC [%)", "max. SoC", "%"),
     ("Flow +500 [l/h]", "Flow +500", "l/h"), ("cell[3]", "cell[3]", ""), ("mu [1]", "mu", "1"),
     ("a[m/s^2]", "a", "m/s^2"), ("a [m/(s^2)] ", "a", "m/(s^2)"), ("v [raw] [km/h]", "v [raw]", "km/h"),
     ("Geschwindigkeit / km/h", "Geschwindigkeit", "km/h"), ("v []", "v", ""), ("[s]", "[s]", "")],
)  # fmt: skip
def test_split_unit(header, name, unit):
    assert split_unit(header) == (name, unit)


def test_unique_names():
    assert unique_names(["a", "a", "a#2", "", "a"]) == ("a", "a#3", "a#2", "column_4", "a#4")
    many = unique_names(["a"] * 50_000)  # at once, not after a minute
    assert many[-1] == "a#50000"
    assert len(set(many)) == 50_000


def test_written_headers(tmp_path):
    path = tmp_path / "a.csv"
    x = np.array([0.0, np.nan, 2.5])
    write_csv(
        path, [TableColumn("t", "s", np.arange(3) * 0.01), TableColumn("=1+2", "", x), TableColumn("v", "km/h", x)]
    )
    assert path.read_text().splitlines() == ["t [s],'=1+2,v [km/h]", "0.0,0.0,0.0", "0.01,,", "0.02,2.5,2.5"]
    assert set(Read(path).channels) == {"=1+2", "v"}
    write_csv(path, [TableColumn("t", "s", np.arange(3) * 0.01), TableColumn("v", "km/h", x)], decimal_comma=True)
    assert path.read_text().splitlines() == ["t [s];v [km/h]", "0,0;0,0", "0,01;", "0,02;2,5"]


def test_write_errors(tmp_path):
    column = TableColumn("t", "s", np.zeros(2))
    with pytest.raises(LogError, match="cannot be written"):
        write_csv(tmp_path / "no" / "a.csv", [column, column.__class__("v", "", np.zeros(2))])
    with pytest.raises(ValueError, match="differ in length"):
        write_csv(tmp_path / "a.csv", [column, TableColumn("v", "", np.zeros(3))])
    with pytest.raises(ValueError, match="one name"):
        write_csv(tmp_path / "a.csv", [column, column])


finite = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(st.characters(codec="utf-8", categories=("L", "N", "P", "S", "Zs")), min_size=1, max_size=12).map(
    lambda s: " ".join(f"x{s}y".split())
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(st.tuples(st.integers(0, 10**15), finite | st.none(), finite), min_size=1, max_size=30),
    decimal_comma=st.booleans(),
    name=names,
    unit=st.sampled_from(["", "km/h", "rad/s", "°C", "-", "%", "m/s²"]),
    formula=st.sampled_from(["", "=", "-", "@", "+"]),
)
def test_round_trip(tmp_path, rows, decimal_comma, name, unit, formula):
    path = tmp_path / "a.csv"
    t_ns = np.array([r[0] for r in rows], dtype=np.int64)
    v = np.array([np.nan if r[1] is None else r[1] for r in rows], dtype=np.float64)
    w = np.array([r[2] for r in rows], dtype=np.float64)
    columns = [TableColumn("t", "s", t_ns * 1e-9), TableColumn(formula + name, unit, v), TableColumn("w", "N*m", w)]
    write_csv(path, columns, decimal_comma=decimal_comma)
    log = Read(path)
    kept = ~np.isnan(v)
    assert log.units == {formula + name: unit, "w": "N*m"}
    assert log.t("w") == t_ns.tolist()
    assert log["w"] == w.tolist()
    assert log.t(formula + name) == t_ns[kept].tolist()
    assert log[formula + name] == v[kept].tolist()
    assert log.faults.lost_samples == 0


@pytest.mark.real
@pytest.mark.parametrize("trip", ["A05", "A11", "B24"])
def test_bmw_i3(real_logs, trip):
    log = Read(real_logs / "bmw_i3" / f"Trip{trip}.csv")
    assert log.units["Battery Temperature"] == "°C"
    assert log.units["max. SoC"] == "%"
    assert log.units["Longitudinal Acceleration"] == "m/s^2"
    assert np.unique(np.diff(log.t("Velocity"))).tolist() == [10**8]
    assert log.faults.lost_samples == 0
    assert not any("�" in i.path + i.unit for i in log.infos)


@pytest.mark.real
def test_porsche_981(real_logs):
    for path in sorted((real_logs / "porsche_981").glob("*.csv")):
        log = Read(path)
        assert log.channels
        assert log.faults.notes == ()
    imu = Read(real_logs / "porsche_981" / "imu_50Hz.csv")
    assert len(imu["InlineAcc"]) == len(imu["YawRate"]) == 62780
    assert imu.t("InlineAcc")[:2] == [0, 20_000_000]


@pytest.mark.real
def test_toyota_rav4(real_logs):
    for path in sorted((real_logs / "toyota_rav4").glob("*.csv")):
        log = Read(path)
        assert log.faults.notes == ()
        assert log.t(log.infos[0].path)[0] > 46_408 * 10**9
    assert Read(real_logs / "toyota_rav4" / "wheel_speed.csv").units["wheel_speed_fl"] == "m/s"


def test_words_for_a_bad_sample(read):
    words = ["NaN", "-nan", "inf", "-Inf", "-", "--", "null", "None", "#N/A", "N/A", "#VALUE!"]
    log = read("t [s],v,w\n" + "".join(f"{k},{x},{k}\n" for k, x in enumerate(["1", *words, *["3"] * 20])))
    assert nan_as_none(log["v"]) == [1, *[None] * len(words), *[3] * 20]
    assert log.faults.lost_samples == 0


def test_line_numbers_count_every_line_of_the_file(read):
    text = "Logger x\n\nt,v,w\ns,m/s,m\n\n0,1,1\n\n\n1,2,2,9\n# note\n2,3,3\n3\n4,fault,4\n5,6,6\nx,7,7\n6,8,8\n"
    log = read(text)
    assert nan_as_none(log["v"]) == [1, 3, None, 6, 8]
    assert log.t("w") == [k * 10**9 for k in (0, 2, 4, 5, 6)]
    for line in (9, 12, 13, 15):
        assert log.noted(f"line {line}"), log.faults.notes


def test_line_numbers_of_a_regular_file(read):
    lines = [f"{k},{k}\n" for k in range(3000)]
    lines[2000] = "2000,fault\n"
    lines[2500] = "later,1\n"
    log = read("made by x\nt [s],v\n" + "".join(lines))
    assert log.noted('"v"', "line 2003")
    assert log.noted('"t"', "line 2503")
    assert log.faults.lost_samples == 2


@pytest.mark.parametrize("text", ["fault", "1.2.3", "0x1F", "1 2", "1_000", "\u0663", "12:30"])
def test_what_is_no_number_is_not_made_one(read, text):
    lines = [f"{k},{k},{k}\n" for k in range(400)]
    lines[350] = f"350,{text},350\n"
    log = read("t [s],v,w\n" + "".join(lines))
    assert [k for k, v in enumerate(nan_as_none(log["v"])) if v is None] == [350]
    assert log.faults.lost_samples == 1
    assert log.noted('"v"', "line 352")


@pytest.mark.parametrize("bad", ["x", "", "25:99:00", "2026-13-01T00:00:00"])
def test_stamp_that_is_no_date_costs_its_row(read, bad):
    cells = [f"2026-03-01T12:00:{k:02}" for k in range(9)]
    cells[4] = bad
    log = read("time,v\n" + "".join(f"{c},{k}\n" for k, c in enumerate(cells)))
    assert log["v"] == [0, 1, 2, 3, 5, 6, 7, 8]
    assert log.faults.lost_samples == 1
    assert log.noted("line 6")


@pytest.mark.parametrize("bad", ["x", "", "nan", "inf", "1e300", "9" * 30])
def test_number_that_is_no_time_costs_its_row(read, bad):
    cells = [str(k / 100) for k in range(9)]
    cells[4] = bad
    log = read("t [s],v\n" + "".join(f"{c},{k}\n" for k, c in enumerate(cells)))
    assert log["v"] == [0, 1, 2, 3, 5, 6, 7, 8]
    assert log.faults.lost_samples == 1
    assert log.noted("line 6")


def test_steps_are_exact_over_a_long_drive(read):
    log = read("t [s],v\n" + "".join(f"{k / 100:.2f},1\n" for k in range(0, 400_000, 7)))
    assert (np.diff(log.t("v")) == 70_000_000).all()


def test_unnamed_index_does_not_shift_the_names(read):
    assert read(",t [s],v\n0,0.5,1.5\n1,0.6,2.5\n")["v"] == [1.5, 2.5]
    with pytest.raises(LogError):
        read("t,v\n0,0.5,1.5\n1,0.6,2.5\n2,0.7,3.5\n")


@pytest.mark.parametrize(
    "content",
    [b"\n\n\n", b"\xef\xbb\xbf", b"\xff\xfe", b"t,v", b"t;\n0;\n1;\n2;\n", b"\x00\x01\x02,\x03\n" * 50,
     bytes(range(256)) * 64, b"t,v\n" + b"x" * 300_000 + b",1\n", b"\xff\xfet\x00,\x00\x00\xd8", b'"' * 1000,
     b"just some words\nand, perhaps, more\n", b'{"t": [1, 2, 3], "v": [1, 2, 3]}\n'],
)  # fmt: skip
def test_what_is_no_table_is_refused(read, content):
    with pytest.raises(LogError):
        read(content)


def saved(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def same(a, b):
    return a.info == b.info and np.array_equal(a.t_ns, b.t_ns) and np.array_equal(a.values, b.values, equal_nan=True)


def test_any_projection_gives_the_same(tmp_path):
    rows = [",".join([str(k / 100), *(f"{k}.{c}" if (k + c) % 7 else "" for c in range(12))]) for k in range(50)]
    path = saved(tmp_path, "t," + ",".join(f"c{c}" for c in range(12)) + "\n" + "\n".join(rows))
    with CsvReader(path, ReadOptions()) as reader:
        infos = {c.name: c for c in reader.channels()}
        whole = {c.info.name: c for c in reader.read(infos.values())}
    for asked in (["c7"], ["c9", "c2", "c11"], ["c3", "c3"], []):
        with CsvReader(path, ReadOptions()) as reader:
            found = reader.read(infos[n] for n in asked)
            again = reader.read([infos[n] for n in asked])
        assert [c.info.name for c in found] == asked
        assert all(same(a, b) for a, b in zip(found, again, strict=True))
        assert all(same(c, whole[c.info.name]) for c in found)


often = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


def german(text):
    return text.replace(",", ";").replace(".", ",")


def opens_or_refuses(path):
    try:
        found = Read(path).channels
    except LogError:
        return None
    for channel in found.values():
        assert channel.t_ns.shape == channel.values.shape
        assert channel.t_ns.dtype == np.int64
        assert channel.values.dtype == np.float64
        assert not np.isinf(channel.values).any()
    return found


@often
@given(st.binary(max_size=400))
def test_random_bytes(tmp_path, content):
    opens_or_refuses(saved(tmp_path, content))


@often
@given(st.text(alphabet=list("tv0123456789.,;|\t\n\r\"' -+eE[]()#:/°\u0663"), max_size=300))
def test_random_text(tmp_path, content):
    opens_or_refuses(saved(tmp_path, content))
    opens_or_refuses(saved(tmp_path, "t [s];v;w\n0;1;2\n1;2;3\n" + content))


ROWS = [f"{k / 100:.2f},{k * 1.25 - 20},{k % 5},{'' if k % 3 else k * 100.125}" for k in range(40)]
HEAD = "t [s],v [m/s],n,slow\n"
bytes_of_tables = st.sampled_from([bytes([b]) for b in b'0159.,;|\t\n\r"-+eE#x \x00\x1f\xff\xc3\xb0'])


@often
@given(
    st.lists(
        st.tuples(
            st.integers(0, len("\n".join(ROWS)) - 1), st.sampled_from(["replace", "insert", "delete"]), bytes_of_tables
        ),
        min_size=1,
        max_size=3,
    ),
    st.booleans(),
)
def test_damage_stays_in_its_rows(tmp_path, damages, is_german):
    body = ("\n".join(ROWS) + "\n").encode()
    head = HEAD.encode()
    if is_german:
        body, head = german(body.decode()).encode(), german(HEAD).encode()
    whole = body.split(b"\n")
    for at, kind, byte in damages:
        behind = at if kind == "insert" else at + 1
        body = body[:at] + (b"" if kind == "delete" else byte) + body[behind:]
    path = saved(tmp_path, head + body)
    try:
        log = Read(path)
        found, faults = log.channels, log.faults
    except LogError:
        return
    untouched = set(body.split(b"\n")) & set(whole)
    for position, name in ((1, "v"), (2, "n"), (3, "slow")):
        if name not in found:
            assert any(name in note for note in faults.notes), "a column must not vanish without a word"
            continue
        pairs = set(zip(found[name].t_ns.tolist(), found[name].values.tolist(), strict=True))
        for row in untouched:
            cells = row.decode().replace(";", "|").replace(",", "." if is_german else "|").split("|")
            if len(cells) == 4 and cells[position]:
                assert (round(float(cells[0]) * 100) * 10_000_000, float(cells[position])) in pairs, row


@often
@given(st.integers(1, len(HEAD + "\n".join(ROWS))))
def test_every_cut_is_read_or_refused(tmp_path, size):
    text = (HEAD + "\n".join(ROWS))[:size]
    found = opens_or_refuses(saved(tmp_path, text))
    lines = text.count("\n")
    if found is None:
        assert lines < 3
    else:
        assert found["v"].values.tolist()[: lines - 1] == [k * 1.25 - 20 for k in range(lines - 1)]


@pytest.mark.parametrize(
    ("end", "told"), [("21.2345\n", False), ("21.2345", False), ("21.2\n", False), ("21.2", True), ("21.23456", False)]
)
def test_a_last_number_that_may_be_cut_is_told(tmp_path, end, told):
    text = "t [s],v_x [m/s]\n" + "".join(f"{k / 100:.2f},{20 + k / 7000:.4f}\n" for k in range(60)) + "0.60," + end
    with CsvReader(saved(tmp_path, text), ReadOptions()) as reader:
        (v,) = reader.read(reader.channels())
        assert v.values.size == 61
        assert any("line 62 may be cut" in n for n in reader.faults.notes) is told
        assert not reader.faults.truncated


@pytest.mark.parametrize("where", ["between", "inside", "same cell", "end"])
def test_a_page_that_was_never_written_is_rows_that_are_missing(read, where):
    rows = [f"{k * 0.01:.2f},{k % 7:.3f},{k % 5:.3f}\n" for k in range(400)]
    data = "t [s],v_x [m/s],a_x [m/s^2]\n" + "".join(rows)
    begin = {"between": data.index(rows[100]), "inside": data.index(rows[100]) + 7, "same cell": data.index(rows[100]) + 6,
             "end": len(data)}[where]  # fmt: skip
    end = {"between": data.index(rows[140]), "inside": data.index(rows[140]) + 12,
           "same cell": data.index(rows[140]) + 6, "end": len(data)}[where]  # fmt: skip
    found = read((data[:begin] + "\0" * (end - begin) + data[end:]).encode() + bytes(676 * (where == "end")))
    assert len(found["v_x"]) == 400 if where == "end" else len(found["v_x"]) <= 361
    assert abs(found.faults.lost_samples - 40) <= 3
    assert "NUL bytes, as what was never written does: about 4" in " ".join(found.faults.notes)


@pytest.mark.parametrize("long", [False, True])
def test_rows_of_separators_alone_are_no_loss(read, long):
    """Spreadsheets leave them behind a table; another row being wrong makes no difference."""
    rows = [f"{k / 100:.2f},{k}" for k in range(60)]
    rows[30] = ",30"
    rows += [","] * 20
    if long:
        rows[10] = "0.1,1,2"
    log = read("t [s],v\n" + "\n".join(rows) + "\n")
    assert len(log["v"]) == 59 - long
    assert log.faults.lost_samples == 1 + long
