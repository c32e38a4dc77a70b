"""Commands on the tests of the tyre trade."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.face.trade import TyreTest

__all__ = ["braking", "curve", "straight", "test_app", "watch"]

test_app = typer.Typer(
    help="Tyre tests as the trade publishes them: straight and curved aquaplaning, wet braking.", no_args_is_help=True,
    rich_markup_mode=None,
)  # fmt: skip
_NOUNS = {"straight": "run", "curve": "pass", "braking": "stop"}
_OUT = "out:test page:test limits jobs dbc data force"


@test_app.callback()
def _test() -> None:
    """Tyre tests as the trade publishes them: straight and curved aquaplaning, wet braking."""


@test_app.command(no_args_is_help=True)
@command(f"logs:campaign by:sets control index vehicle:of_logs signals {_OUT}")
def straight(
    run: Run, by: str, control: str, index: float, out: Path | None, page: Path | None, limits: Path | None
) -> Output:
    """Straight aquaplaning: the speed at which the wet driven wheel turns 15 % faster than the dry one.

    One side of the car runs in water, the other one is dry, with full throttle in a fixed gear. Each run is valid, or
    says why not. A run that does not reach 15 % counts as above the highest speed at which that could have lasted. Each
    set has mean, interval and CV; with --control the index of the others, from which the control's drift by run order
    is taken out. Beside 15 % stand other signs of lost contact: 5 %, first minor spin-down, drop of the slip slope.

    \b
    Examples:
      aqualog test straight runs/*.mf4 --signals map.toml --vehicle car.toml -o straight
      aqualog test straight campaign.toml --by tyre,pressure --control SRTT --index 100 --csv straight.csv
      aqualog test straight campaign.toml --limits limits.toml --json | jq '.sets[] | [.tyre, .mean_kmh, .index]'
    """
    return _test_of(run, "straight", (out, page), by=by, control=control, index=index, limits=limits)


@test_app.command(no_args_is_help=True)
@command(f"logs:campaign radius result by:sets control index vehicle:of_logs signals {_OUT}")
def curve(
    run: Run, radius: float | None, result: str, by: str, control: str, index: float, out: Path | None,
    page: Path | None, limits: Path | None,
) -> Output:  # fmt: skip
    """Curved aquaplaning: the lateral acceleration that is left in a trough of water on a circle, over the entry speed.

    Constant steering, several passes at each speed, 5 km/h faster each time, until the least lateral acceleration is 0.
    Each set has the speeds of the greatest, the half and no lateral acceleration, and one number with its interval.
    --control compares it: mean of the least acceleration (min), of the mean one (mean), or the area under it (area).

    \b
    Examples:
      aqualog test curve campaign.toml --radius 100
      aqualog test curve campaign.toml --radius 100 --result area --control SRTT -o curve
      aqualog test curve passes/*.mf4 --vehicle car.toml --signals map.toml --json
    """
    given: dict[str, Any] = {"radius": radius, "result": result}
    return _test_of(run, "curve", (out, page), by=by, control=control, index=index, limits=limits, **given)


@test_app.command(no_args_is_help=True)
@command(f"logs:campaign v_from v_to coefficients by:sets control index vehicle:of_logs signals {_OUT}")
def braking(
    run: Run, v_from: float, v_to: float, coefficients: Path | None, by: str, control: str, index: float,
    out: Path | None, page: Path | None, limits: Path | None,
) -> Output:  # fmt: skip
    """Wet braking: the braking force coefficient (v1² - v2²) / (2 d g) of each stop between two speeds.

    The way is the integral of the speed. Temperature and macrotexture stand beside it where the log or the campaign has
    them (x_temperature_c, x_texture_mm). A set needs six valid stops and a CV of at most 4 %. With --control the index,
    and with --coefficients the wet grip index by the numbers of your own copy of the regulation.

    \b
    Examples:
      aqualog test braking campaign.toml --from 80 --to 20
      aqualog test braking campaign.toml --control SRTT --coefficients r117.toml --csv braking.csv
      aqualog test braking stops/*.mf4 --vehicle car.toml --signals map.toml -o braking
    """
    given: dict[str, Any] = {"v_from": v_from, "v_to": v_to, "coefficients": coefficients}
    return _test_of(run, "braking", (out, page), by=by, control=control, index=index, limits=limits, **given)


def _test_of(run: Run, kind: str, targets: tuple[Path | None, Path | None], **options: Any) -> Output:
    """Evaluate a test; nothing is written where no run counts."""
    from aqualog.face.arguments import refuse_existing
    from aqualog.face.trade import tyre_test

    out, page = targets
    campaign = run.campaign()
    names = (f"{kind}.json", f"{kind}_sets.csv", f"{kind}_runs.csv", f"{kind}.html")
    planned = [*([out / n for n in names] if out is not None else []), *([page] if page is not None else [])]
    beside = [p for p in (options.get("limits"), options.get("coefficients")) if p is not None]
    refuse_existing(planned, force=run.force, sources=[*campaign.sources, *beside])
    with run.hearing() as hear:
        found = tyre_test(campaign, kind, jobs=run.jobs, progress=hear, **options)
    written = [] if out is None or not found.test.entries else [str(p) for p in found.save(out, force=True)]
    if page is not None and found.test.entries:
        written.append(str(found.write_page(page, force=True)))
    return _ended(run, kind, found, [f"written: {', '.join(written)}"] if written else [])


def _ended(run: Run, kind: str, found: TyreTest, notes: list[str]) -> Output:
    """Return the output of a test that has ended: nothing is usable where no run counts."""
    from aqualog.core.errors import ExitCode

    if not found.test.valid:
        reasons = [r for e in found.test.entries for r in e.reasons] or list(found.test.failed.values())
        run.console.error(f"no {_NOUNS[kind]} of a {kind} test counts ({reasons[0] if reasons else 'no log'})")
        return Output(found, notes, code=int(ExitCode.NOTHING_USABLE))
    return Output(found, notes)


@command("folder:watched campaign:watched kind by:sets limits out:watch once every data")
def watch(
    run: Run, folder: Path, campaign: Path | None, kind: str, by: str, limits: Path | None, out: Path | None,
    once: bool, every: float,
) -> Output:  # fmt: skip
    """Measure the runs of a tyre test as their logs arrive in a folder: a line and a page that renews itself.

    A log is measured when it has not changed for two seconds, once, whatever it is called. Its line says value, valid
    or why not, and of its set the valid runs, the CV and what is still missing. Damaged logs are named, and measured
    when they are copied again. The folder may be away for a while, and the campaign file may change. Ctrl-C ends it,
    prints the sets, and leaves the page.

    \b
    Examples:
      aqualog watch /net/track/monday --campaign campaign.toml --test straight
      aqualog watch runs --campaign campaign.toml --test braking -o monday.html --every 5
      aqualog watch runs --campaign campaign.toml --once --json
    """
    import sys

    from aqualog.cli.console import clean_line
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.watch import watch

    if campaign is None:
        raise ConfigError("no --campaign", expected="a campaign file: car, signals, and the runs to come")
    page = campaign.with_suffix(".watch.html") if out is None else out
    stream = sys.stderr if run.json else sys.stdout

    def say(line: str) -> None:
        stream.write(f"{clean_line(line)}\n")
        stream.flush()

    with run.hearing() as hear:
        found = watch(
            folder, campaign, kind, by=by, limits=limits, page=page, once=once, every_s=every, say=say, progress=hear
        )
    notes = [f"the page is {found.page}"] if found.page is not None else []
    if not once:
        return Output(found, notes, code=int(ExitCode.INTERRUPTED))
    return _ended(run, kind, found, notes)
