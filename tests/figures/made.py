"""Figures made once for all tests of this folder."""

from functools import lru_cache

from aqualog.figures import catalogue
from aqualog.figures.record import Figure


@lru_cache
def made(number: str) -> Figure:
    return catalogue.make(number)


def all_made():
    return [made(n) for n in catalogue.WITHOUT]


def finding(number, claim):
    return next(c for c in made(number).findings if c.claim == claim)
