"""`aqualog cache`."""

from __future__ import annotations

from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["cache"]


@command("clean json verbose", has_steps=False)
def cache(
    run: Run,
    clean: Annotated[bool, typer.Option("--clean", help="Remove what is kept.")] = False,
) -> Output:
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
    from aqualog.face.cache import cache

    kept = cache(clean=clean)
    return Output(kept, text=kept.text(verbose=run.console.verbose))
