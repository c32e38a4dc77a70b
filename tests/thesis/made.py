"""Figures made once for all tests of the thesis."""

from functools import lru_cache

from aqualog.thesis.catalogue import WITHOUT
from aqualog.thesis.record import Figure
from aqualog.thesis.run import make


@lru_cache
def made(number: str) -> Figure:
    return make(number)


def all_made():
    return [made(n) for n in WITHOUT]


def check(number, claim):
    return next(c for c in made(number).checks if c.name == claim)
