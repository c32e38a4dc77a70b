"""Tables as CSV: a spreadsheet opens them, and nothing in them runs."""

import math

import polars as pl
import pytest

from aqualog.report.spreadsheet import csv_bytes

FRAME = pl.DataFrame(
    {
        "name": ["=1+2", "a;b", None],
        "x [m]": [0.1 + 0.2, math.nan, -1.5],
        "ci": [[1.0, None], None, [2.0]],
        "n": [1, 2, 3],
    }
)


def test_cells():
    assert csv_bytes(FRAME).decode().splitlines() == ["name,x [m],ci,n", "'=1+2,0.3,1.0; ,1", "a;b,,,2", ",-1.5,2.0,3"]


def test_decimal_commas_come_with_semicolons_and_the_mark_of_utf8():
    data = csv_bytes(FRAME, decimal_comma=True)
    assert data[:3] == b"\xef\xbb\xbf"
    assert data.decode("utf-8-sig").splitlines()[1:] == ['\'=1+2;0,3;"1.0; ";1', '"a;b";;;2', ";-1,5;2.0;3"]
    back = pl.read_csv(data, separator=";", decimal_comma=True)
    assert back["x [m]"].to_list() == [0.3, None, -1.5]


@pytest.mark.parametrize("frame", [pl.DataFrame(), pl.DataFrame(schema={"a": pl.Float64})])
def test_without_rows_the_heading_is_left(frame):
    assert csv_bytes(frame).decode().strip() == ",".join(frame.columns)
