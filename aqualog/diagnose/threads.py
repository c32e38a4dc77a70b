"""Two threads for all steps of a diagnosis: compiled code and transforms run beside each other."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

__all__ = ["beside"]

THREADS = 2
T = TypeVar("T")
R = TypeVar("R")
_own = threading.local()
_pools: dict[int, ThreadPoolExecutor] = {}  # by process: a fork has none of its parent's threads
_lock = threading.Lock()


def _begin() -> None:
    _own.inside = True


def beside(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Return the results of `work` for each item, in their order, from two threads that stay, one after the other
    within such a thread; each new thread would take memory that it does not give back."""
    items = list(items)
    if len(items) < 2 or getattr(_own, "inside", False):
        return [work(x) for x in items]
    with _lock:
        pool = _pools.get(os.getpid())
        if pool is None:
            pool = _pools[os.getpid()] = ThreadPoolExecutor(THREADS, "diagnose", _begin)
    return list(pool.map(work, items))
