"""Compilation of recursions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

__all__ = ["compiled"]


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a recursion; the machine code is kept for the next process where there is a place for it.

    A read-only installation without a home folder has no such place; there it is compiled in each process. No fast
    maths: results must not depend on how a drive is cut.
    """
    try:
        return njit(cache=True)(function)
    except RuntimeError:
        return njit(function)
