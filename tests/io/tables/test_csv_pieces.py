"""A large CSV file read piece by piece gives the samples and the faults that it gives in one."""

import numpy as np
import pytest

from aqualog.io.reader import ReadOptions
from aqualog.io.tables import csv
from aqualog.io.tables import csv_text as text_file
from aqualog.io.tables.csv import CsvReader
from aqualog.io.tables.csv_text import TextFile, open_text


def lines(n=400, *, unit=" [s]", step=0.01, sep=",", start=0.0):
    rng = np.random.default_rng(2)
    x = 60.0 + rng.standard_normal(n)
    return [sep.join([f"t{unit}", "omega_fl [rad/s]", "a_x [m/s^2]"])] + [
        sep.join([f"{start + k * step:.10g}", f"{x[k]:.4f}", f"{0.1 * x[k]:.3f}"]) for k in range(n)
    ]


def edited(**changes):
    out = lines()
    for at, text in changes.items():
        out[int(at[1:])] = text
    return "\n".join(out) + "\n"


FILES = {
    "plain": "\n".join(lines()) + "\n",
    "no end of the last line": "\n".join(lines()),
    "windows": "\r\n".join(lines()) + "\r\n",
    "blank lines at the end": "\n".join(lines()) + "\n" * 90,
    "blank lines in between": edited(l100="\n" * 70, l200=""),
    "semicolons": "\n".join(lines(sep=";")) + "\n",
    "bad cells": edited(l50="0.5,error,1.0", l51="0.51,12,n/a", l250="2.5,-,1", l333="x,1,2", l334=",1,2"),
    "rows of other widths": edited(l60="0.6,1", l61="0.61,1,2,3,4", l300="3.0", l301="# a note", l302="3.02,1,2,"),
    "cut": "\n".join(lines())[:-5],
    "cut in the second cell": "\n".join(lines())[:-12],
    "milliseconds without a unit": "\n".join(lines(2500, unit="", step=10.0, start=25_000_000)) + "\n",
    "seconds since 1970": "\n".join(f"{1.78e9 + k * 0.01:.2f},{k}" if k else "time [s],v_x [m/s]" for k in range(300)),
    "umlauts": edited(l70="0.7,1,2").replace("a_x", "Längsbeschleunigung"),
    "quotes": edited(l70='"0.70","61.5",2', l71='0.71,"62,5",3'),
    "comments above": "# logger 7\n# drive 3\n" + "\n".join(lines()) + "\n",
}  # fmt: skip


def held(path, name):
    """A file of this name, its channels, what a reader that holds it finds in them, and its faults."""
    path.write_bytes(FILES[name].encode())
    with CsvReader(path, ReadOptions()) as reader:
        infos = reader.channels()
        return path, infos, reader.read(infos), reader.faults


@pytest.mark.parametrize("size", [60, 1000, 1 << 20])
@pytest.mark.parametrize("name", FILES)
def test_pieces_are_the_whole(name, size, tmp_path, monkeypatch):
    path, infos, whole, faults = held(tmp_path / "a.csv", name)
    monkeypatch.setattr(text_file, "LARGE", 1)
    monkeypatch.setattr(text_file, "_BLOCK", 777)
    monkeypatch.setattr(csv, "PIECE", size)
    with CsvReader(path, ReadOptions()) as reader:
        assert isinstance(reader._data, TextFile)
        assert reader.channels() == infos
        (part,) = reader.parts(infos)
        pieces = list(part.pieces)
        assert len(pieces) > 3 or size > 1000 or name.startswith("seconds")
        for i, channel in enumerate(whole):
            np.testing.assert_array_equal(np.concatenate([p[i].t_ns for p in pieces]), channel.t_ns)
            np.testing.assert_array_equal(np.concatenate([p[i].values for p in pieces]), channel.values)
            assert all(p[i].absolute == channel.absolute for p in pieces)
        assert reader.faults == faults
    with CsvReader(path, ReadOptions()) as reader:  # a large file that is asked for as a whole
        np.testing.assert_array_equal(reader.read(infos)[0].values, whole[0].values)


REGULAR = {"plain", "no end of the last line", "windows", "semicolons", "umlauts", "comments above"}


@pytest.mark.parametrize("name", FILES)
def test_a_regular_file_is_not_held(name, tmp_path, monkeypatch):
    path, infos, whole, faults = held(tmp_path / "a[1]*.csv", name)  # a name, not a pattern
    monkeypatch.setattr(text_file, "_SMALL", 1)
    monkeypatch.setattr(text_file, "_BLOCK", 777)
    with CsvReader(path, ReadOptions()) as reader:
        assert reader.channels() == infos
        found = reader.read(infos)
        assert isinstance(reader._rows.text, TextFile) or name not in REGULAR
        assert reader.faults == faults
    for a, b in zip(found, whole, strict=True):
        np.testing.assert_array_equal(a.t_ns, b.t_ns)
        np.testing.assert_array_equal(a.values, b.values)


def test_a_file_that_grows_is_read_as_far_as_it_went(tmp_path, monkeypatch):
    path, infos, whole, _ = held(tmp_path / "a.csv", "plain")
    monkeypatch.setattr(text_file, "_SMALL", 1)
    with CsvReader(path, ReadOptions()) as reader:
        with path.open("a", encoding="utf-8") as file:
            file.write("4.00,1,2\n4.01,1")
        np.testing.assert_array_equal(reader.read(infos)[0].values, whole[0].values)


@pytest.mark.parametrize(
    "data", [b"\xef\xbb\xbft,a\n1,2\n", "t,a\n1,2\n".encode("utf-16"), b"t,a\xb0C\n1,2\n", b"t,a\r1,2\r"]
)
def test_what_is_not_plain_text_is_read_as_a_whole(data, tmp_path, monkeypatch):
    monkeypatch.setattr(text_file, "LARGE", 1)
    path = tmp_path / "a.csv"
    path.write_bytes(data)
    assert open_text(path) is None


def test_a_letter_across_two_blocks_is_plain_text(tmp_path, monkeypatch):
    monkeypatch.setattr(text_file, "LARGE", 1)
    monkeypatch.setattr(text_file, "_BLOCK", 5)
    path = tmp_path / "a.csv"
    path.write_bytes("t,aüüüü\n1,2\n".encode())
    text = open_text(path)
    assert text[:] == path.read_bytes()
    assert (text.find(b"\n"), text.find(b"x"), text.lines, text[-1:]) == (11, -1, 2, b"\n")
    text.close()
