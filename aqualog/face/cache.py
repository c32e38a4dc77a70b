"""`aq.cache`: the folder in which aligned signals are kept."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.result import Result, Writers, bars, document_head

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.cache import Kept, SignalCache

__all__ = ["KeptSignals", "NoCacheFolderError", "cache", "cache_of_user"]


class NoCacheFolderError(ConfigError):
    """There is no folder in which signals could be kept."""


@dataclass(frozen=True, eq=False, repr=False)
class KeptSignals(Result):
    """What is kept; `removed` is the number of drives and bytes that were removed, None if nothing was asked to go."""

    place: SignalCache
    entries: tuple[Kept, ...]
    removed: tuple[int, int] | None = None

    @property
    def document(self) -> dict[str, Any]:
        return {
            **document_head(),
            "folder": str(self.place.folder),
            "is_default": _is_default(),
            "limit_bytes": self.place.limit,
            "drives": [_entry(e) for e in self.entries],
            "bytes": sum(e.size for e in self.entries),
            "usable": sum(e.fits for e in self.entries),
            "removed": self.removed[0] if self.removed is not None else 0,
        }

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`drives`."""
        import polars as pl

        return {"drives": pl.DataFrame([{**_entry(e), "files": "; ".join(e.files)} for e in self.entries])}

    def text(self, *, verbose: bool = False) -> str:
        """Return where signals are kept, how many and how large; `verbose`: which."""
        from aqualog.report.text import table

        if self.removed is not None:
            drives, size = self.removed
            return f"{_drives(drives)} removed, {size / 1e6:.0f} MB, from {self.place.folder}\n"
        when = "always (AQUALOG_CACHE is set)" if _is_default() else "with --cache"
        size_mb = sum(e.size for e in self.entries) / 1e6
        usable = sum(e.fits for e in self.entries)
        lines = [
            f"signals are kept in {self.place.folder}, {when}",
            f"{_drives(len(self.entries))}, {size_mb:.0f} of {self.place.limit / 1e6:.0f} MB; {usable} of this "
            "version, which a command can take",
        ]
        if verbose and self.entries:
            rows = [
                (", ".join(e.files) or "?", f"{e.size / 1e6:.1f}", str(_entry(e)["last_used"]), "" if e.fits else "old")
                for e in reversed(self.entries)
            ]
            lines += ["", table(("drive", "MB", "last used", ""), rows)]
        return "\n".join(lines) + "\n"

    def headline(self) -> str:
        return self.text().rstrip("\n")

    def plot(self) -> go.Figure:
        """Return the size of each drive."""
        names = [", ".join(e.files) or "?" for e in self.entries]
        return bars(str(self.place.folder), names, [e.size / 1e6 for e in self.entries], "size [MB]")

    def files(self) -> Writers:
        """Return `cache.json`."""
        return {"cache.json": self._json_file()}


def cache(*, clean: bool = False) -> KeptSignals:
    """Show or empty the folder in which aligned signals are kept.

    Parameters
    ----------
    clean : bool
        Remove all that is kept.

    Raises
    ------
    ConfigError
        If there is no home folder and AQUALOG_CACHE names none.
    """
    place = cache_of_user()
    entries = tuple(place.kept())
    return KeptSignals(place, entries, place.clean() if clean else None)


def cache_of_user(tell: Callable[[str], None] = lambda _: None) -> SignalCache:
    """Return the cache in AQUALOG_CACHE, else in the user's cache folder; `tell` hears what is not kept, and why.

    Raises
    ------
    NoCacheFolderError
        If there is no home folder and AQUALOG_CACHE names none.
    """
    from aqualog.align.cache import SignalCache, cache_folder, cache_limit

    try:
        folder = cache_folder()
    except RuntimeError as error:
        raise NoCacheFolderError("there is no home folder", expected="a folder in AQUALOG_CACHE") from error
    return SignalCache(folder, limit=cache_limit(), tell=tell)


def _is_default() -> bool:
    return bool(os.environ.get("AQUALOG_CACHE"))


def _entry(entry: Kept) -> dict[str, Any]:
    used = datetime.fromtimestamp(entry.used, UTC).isoformat(timespec="seconds")
    return {"files": entry.files, "bytes": entry.size, "last_used": used, "usable": entry.fits}


def _drives(count: int) -> str:
    return f"{count} drive{'' if count == 1 else 's'}"
