"""`aqualog cache`."""

from __future__ import annotations

import json
import os
import sys
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aqualog.cli.options import Debug, Json, Verbose

if TYPE_CHECKING:
    from aqualog.align.cache import Kept, SignalCache

__all__ = ["cache"]


def cache(
    clean: Annotated[bool, typer.Option("--clean", help="Remove what is kept.")] = False,
    as_json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> None:
    """Show or empty the folder in which aligned signals are kept.

    detect, diagnose, calibrate and slip-slope keep signals there with --cache, or always where AQUALOG_CACHE names a
    folder; the same log is then read once. A drive is found again by the content of its files, the signal map,
    databases, radii and ratios of the vehicle, the rate, and aqualog's own reading code. AQUALOG_CACHE_MB is the most
    that is kept (2000); what was not asked for longest goes first. -v lists the drives.

    \b
    Examples:
      aqualog detect drive.mf4 --vehicle car.toml --cache
      aqualog cache
      aqualog cache --clean
      AQUALOG_CACHE=/data/cache aqualog diagnose drive.mf4 --vehicle car.toml
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        _cache(clean=clean, as_json=as_json, verbose=verbose)


def _cache(*, clean: bool, as_json: bool, verbose: bool) -> None:
    from aqualog import __version__
    from aqualog.align.cache import SignalCache, cache_folder, cache_limit
    from aqualog.errors import ConfigError

    try:
        place = SignalCache(cache_folder(), limit=cache_limit())
    except RuntimeError as error:
        raise ConfigError("there is no home folder", expected="a folder in AQUALOG_CACHE") from error
    entries = place.kept()
    removed = place.clean() if clean else None
    if not as_json:
        text = _text(place, entries, verbose=verbose) if removed is None else _removed(place, *removed)
        sys.stdout.write(text)
        return
    document = {
        "schema_version": 1,
        "tool_version": __version__,
        "folder": str(place.folder),
        "is_default": _is_default(),
        "limit_bytes": place.limit,
        "drives": [_document(e) for e in entries],
        "bytes": sum(e.size for e in entries),
        "usable": sum(e.fits for e in entries),
        "removed": removed[0] if removed is not None else 0,
    }
    sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")


def _is_default() -> bool:
    return bool(os.environ.get("AQUALOG_CACHE"))


def _document(entry: Kept) -> dict[str, Any]:
    used = datetime.fromtimestamp(entry.used, UTC).isoformat(timespec="seconds")
    return {"files": entry.files, "bytes": entry.size, "last_used": used, "usable": entry.fits}


def _text(place: SignalCache, entries: list[Kept], *, verbose: bool) -> str:
    from aqualog.cli.console import clean
    from aqualog.report.text import table

    when = "always (AQUALOG_CACHE is set)" if _is_default() else "with --cache"
    size = sum(e.size for e in entries) / 1e6
    lines = [
        f"signals are kept in {place.folder}, {when}",
        f"{_drives(len(entries))}, {size:.0f} of {place.limit / 1e6:.0f} MB; {sum(e.fits for e in entries)} of this "
        "version, which a command can take",
    ]
    if verbose and entries:
        rows = [
            (", ".join(e.files) or "?", f"{e.size / 1e6:.1f}", str(_document(e)["last_used"]), "" if e.fits else "old")
            for e in reversed(entries)
        ]
        lines += ["", table(("drive", "MB", "last used", ""), rows)]
    return clean("\n".join(lines)) + "\n"


def _removed(place: SignalCache, drives: int, size: int) -> str:
    return f"{_drives(drives)} removed, {size / 1e6:.0f} MB, from {place.folder}\n"


def _drives(count: int) -> str:
    return f"{count} drive{'' if count == 1 else 's'}"
