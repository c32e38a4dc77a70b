"""Checks that a worker of a cluster has the same code, logs and store as the machine that gives it work."""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from aqualog import __version__
from aqualog.campaign.jobs import code_stamp
from aqualog.campaign.place import is_url
from aqualog.campaign.store import place_of
from aqualog.core.errors import AqualogError, ConfigError
from aqualog.io.atomic_write import write_text

__all__ = ["Asked", "Stamp", "asked_of", "own_stamp", "unlike"]

Stamp = tuple[str, str]
"""Version and hash of the source code behind a result."""


class Asked(NamedTuple):
    """Requirements on a worker: this code, these files with their sizes [byte], and these places behind URLs, each with
    a mark in it.
    """

    stamp: Stamp
    files: tuple[tuple[Path, int], ...]
    places: tuple[tuple[str, str], ...] = ()


def own_stamp() -> Stamp:
    """Stamp of this process."""
    return __version__, code_stamp()


@contextmanager
def asked_of(tasks: Mapping[Any, tuple[Any, ...]]) -> Iterator[Asked]:
    """Requirements for these tasks: a few of their files, and marks in their folders while the work lasts.

    Every machine may have a folder of the same name; only a shared folder has the mark.
    """
    some = list(tasks.values())
    some = [some[i] for i in sorted({0, len(some) // 2, len(some) - 1})] if some else []
    paths = list(dict.fromkeys(p for task in some for p in _paths(task)))
    marks = [p / _mark() for p in paths if p.is_dir()]
    urls = dict.fromkeys(v for task in some for v in task if isinstance(v, str) and is_url(v))
    places: list[tuple[str, str]] = []
    try:
        for url in urls:
            name = _mark()
            with suppress(OSError, AqualogError):  # the batch's own results show it
                place_of(url).write(name, b"seen\n")
                places.append((url, name))
        for mark in marks:
            with suppress(OSError):  # a read-only source folder; a folder that must be written raises its own error
                write_text(mark, "seen\n")
        files = [p for p in (*paths, *marks) if p.is_file()]
        yield Asked(own_stamp(), tuple((p, p.stat().st_size) for p in files), tuple(places))
    finally:
        for url, name in places:
            with suppress(OSError, AqualogError):
                place_of(url).remove(name)
        for mark in marks:
            with suppress(OSError):
                mark.unlink(missing_ok=True)


def _mark() -> str:
    return f".seen-{secrets.token_hex(4)}.json.tmp"


def _paths(values: Iterable[Any]) -> Iterator[Path]:
    for value in values:
        if isinstance(value, Path):
            yield value
        elif isinstance(value, tuple):
            yield from (v for v in value if isinstance(v, Path))


_fit: set[Asked] = set()  # requirements that this process was found to meet


def unlike(asked: Asked) -> ConfigError | None:
    """On a worker: the missing requirement, if any; checked once per process, since workers may join at any time."""
    if asked in _fit:
        return None
    own = own_stamp()
    if own != asked.stamp:
        return ConfigError(
            f"runs another aqualog ({own[0]}, there {asked.stamp[0]})",
            expected="the same code everywhere, or results would differ",
        )
    missing = _missing(asked.files)
    if missing:
        return ConfigError(
            f"does not see {missing}", expected="logs and store under the same paths on every machine",
            hint="a disk that all share; for results also --store with a URL",
        )  # fmt: skip
    for url, name in asked.places:
        lack = _out_of_reach(url, name)
        if lack:
            return ConfigError(
                f"cannot use the store {place_of(url).name} ({lack})", expected="what this machine can",
                hint="keys and packages of the store's protocol in the environment of every worker",
            )  # fmt: skip
    _fit.add(asked)
    return None


def _out_of_reach(url: str, name: str) -> str:
    """Reason why results cannot be written there, also if it is not the place with the mark."""
    try:
        place = place_of(url)
        if not place.has(name):
            return "it is another one here"
        own = _mark()
        place.write(own, b"seen\n")
        place.remove(own)
    except (OSError, AqualogError) as error:
        return (error.what if isinstance(error, AqualogError) else error.strerror) or type(error).__name__
    return ""


def _missing(files: Sequence[tuple[Path, int]]) -> str:
    for path, size in files:
        try:
            there = path.stat().st_size
        except OSError:
            # a mark stands for its folder
            return str(path.parent if path.name.startswith(".seen-") else path)
        if there != size:
            return f"{path} as it is here ({there} byte, not {size})"
    return ""
