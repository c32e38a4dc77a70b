"""Cells that the library reads as numbers as they stand are those that their text says."""

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aqualog.io.tables.csv import Rows, find_rows
from aqualog.io.tables.csv_cells import STYLES, numbers
from aqualog.io.tables.csv_dialect import find_layout

SIGNS = st.sampled_from(["", "-", "+"])
DIGITS = st.text("0123456789", min_size=0, max_size=22)
NUMBER = st.tuples(
    SIGNS, DIGITS, st.sampled_from(["", "."]), DIGITS, st.sampled_from(["", "e5", "E-7", "e+300", "e-400", "e999"])
).map("".join)
EXACT = st.one_of(st.floats(), st.floats(width=32), st.integers(-(2**70), 2**70)).map(repr)
ODD = st.sampled_from([
    "", " ", " 1.5", "1.5 ", "nan", "NaN", "inf", "-Infinity", "--", "n/a", "true", "1_0", "0x10", "1,5", "1.5.2", "e5",
    ".", "-", "+", "1e", '"2.5"', '""', '" 3"', "١", "1.5e", "infinit", "١.٥", "1\\t", "#5", "1/2",
])  # fmt: skip
CELL = st.one_of(NUMBER, EXACT, ODD)


def both_ways(cells):
    text = "\n".join(f"{k};{cell}" for k, cell in enumerate(cells)).encode()
    rows = Rows(text, ";", 2, np.arange(len(cells)), faults=None)
    return rows.cells([0, 1], where="", numbers={1})[1], rows.cells([0, 1], where="")[1]


def same(a, b):
    for x, y in zip((a.values, a.blank, a.unreadable), (b.values, b.blank, b.unreadable), strict=True):
        np.testing.assert_array_equal(x.view("u8") if x.dtype == float else x, y.view("u8") if y.dtype == float else y)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.one_of(NUMBER, EXACT), min_size=1, max_size=8))
def test_numbers_are_those_of_their_text(cells):
    read, text = both_ways(cells)
    same(numbers(read, STYLES[0]), numbers(text, STYLES[0]))


@settings(max_examples=150, deadline=None)
@given(st.lists(CELL, min_size=1, max_size=4))
def test_other_cells_are_those_of_their_text(cells):
    read, text = both_ways(cells)
    same(numbers(read, STYLES[0]), numbers(text, STYLES[0]))


@pytest.mark.parametrize(("cells", "dtype"), [(["1", "2.5", "", "1e5"], pl.Float64), (["1", "--", "2"], pl.String)])
def test_one_cell_that_is_no_number_makes_all_of_them_text(cells, dtype):
    assert both_ways(cells)[0].dtype == dtype


@pytest.mark.parametrize(
    ("lines", "short", "long", "comments"),
    [
        (["1,2,3"] * 3, (), (), ()),
        (["1,2,3", "1,2", "1,2,3,4"], (4,), (5,), ()),  # as many separators as there should be
        (["1,2", "1,2,3,4", "1,2,3"], (3,), (4,), ()),
        (["1,2,3", "#1,2,3", "4,5,6"], (), (), (4,)),
        (["#1,2,3", "4,5,6"], (), (), (3,)),
        (["1,#2,3", "4,5/6,6%"], (), (), ()),
        (["1,2,3", "", "4,5,6"], (), (), ()),
    ],
)
def test_lines_that_are_not_as_the_header_says_are_found(lines, short, long, comments):
    data = "\n".join(["a,b,c", "0,0,0", *lines]).encode()
    rows = find_rows(data, find_layout(data, where=""))
    assert (rows.faults.short, rows.faults.long, rows.faults.comments) == (short, long, comments)
    kept = [k for k, text in enumerate(lines, start=3) if text and k not in (*long, *comments)]
    assert rows.lines.tolist() == [2, *kept]
