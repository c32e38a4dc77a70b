"""Figures made once for all tests of the thesis, by whichever worker comes first."""

from functools import lru_cache

from aqualog.thesis.catalogue import WITHOUT
from aqualog.thesis.record import Figure
from aqualog.thesis.run import make
from tests.shared import is_second_worker, once


@lru_cache
def made(number: str) -> Figure:
    return once(f"figure_{number}", lambda: make(number))


def all_made():
    for number in reversed(WITHOUT) if is_second_worker() else WITHOUT:
        made(number)
    return [made(n) for n in WITHOUT]


def check(number, claim):
    return next(c for c in made(number).checks if c.name == claim)
