"""`aq.watch`: a tyre test while it is driven."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import AqualogError, ConfigError
from aqualog.face.arguments import file_of, number_of, refuse_existing, write_whole
from aqualog.face.campaign_inputs import CampaignInputs, split
from aqualog.face.drive import sources_of
from aqualog.face.listener import Listener, Progress, listener
from aqualog.face.result import PathLike, page_file
from aqualog.face.trade import TyreTest, kind_of
from aqualog.io.fingerprint import Seen, state_of

if TYPE_CHECKING:
    from aqualog.trade.evaluation import Options
    from aqualog.trade.limits import Limits
    from aqualog.trade.watching import Watched, Watching

__all__ = ["watch"]

SETTLE_S = 2.0
"""A log is complete when it has not changed for so long. [s]"""
_REFRESH_S = 3  # [s] of the page in a browser
_HEARTBEAT_S = 10.0  # [s] a page that nothing new has come for still says when it was looked

Say = Callable[[str], object]


def watch(
    folder: PathLike,
    campaign: PathLike | CampaignInputs,
    kind: str = "straight",
    *,
    by: str | Sequence[str] = (),
    limits: PathLike | None = None,
    page: PathLike | None = None,
    once: bool = False,
    every_s: float = 1.0,
    say: Say = print,
    progress: Progress = None,
) -> TyreTest:
    """Measure the runs of a tyre test as their logs arrive in a folder, until Ctrl-C (KeyboardInterrupt).

    Parameters
    ----------
    folder : str or Path
        Where logs arrive, also of the network; looked at with the folders below it. It may be away for a while.
    campaign : str, Path or CampaignInputs
        Campaign file. Its runs name the logs that are to come, and it is read again when it changes.
    kind : str
        `straight`, `curve` or `braking`.
    by, limits
        As of `aq.tyre_test`.
    page : str or Path, optional
        Page (HTML) that is written anew when something has changed, whole.
    once : bool
        Measure what is there and complete, and end.
    every_s : float
        Time between two looks [s], 0.1 to 3600.
    say : callable
        Hears a line for each run.
    progress : callable, optional
        Hears of damaged logs, copies, and a folder that is away.

    Returns
    -------
    TyreTest
        As of `aq.tyre_test`, of the runs that have come.

    Raises
    ------
    ConfigError

    Examples
    --------
    >>> aq.watch("/net/track/monday", "campaign.toml", page="monday.html")
    """
    from aqualog.config.trade import load_limits
    from aqualog.trade.limits import defaults

    hear, every = listener(progress), number_of(every_s, "every_s", 0.1, 3600.0, "s")
    used = defaults() if limits is None else load_limits(file_of(limits, "limits"))
    own = campaign if isinstance(campaign, CampaignInputs) else CampaignInputs(campaign)
    place, target = file_of(folder, "folder"), None if page is None else file_of(page, "page")
    if once and not place.is_dir():
        raise ConfigError("is no folder", where=str(place), expected="a folder with logs")
    if target is not None:
        refuse_existing([target], force=_is_own(target), sources=[*own.sources], hint="another name for the page")
    session = _Session(place, own, kind_of(kind), tuple(split(by)), used, hear, say, target)
    try:
        session.step()
        while not (once and session.is_settled):
            session.write()
            time.sleep(every)
            session.step()
    except KeyboardInterrupt:
        if session.last is None:
            raise
    session.write(is_end=True)
    assert session.last is not None
    found = session.last
    return TyreTest(
        found.test, own.name, target if session.is_written else None,
        has_loss=bool(found.failed) or not (target is None or session.is_written),
        notes=tuple(f"{name}: the same log as {other}" for name, other in found.same.items()),
        sources=sources_of(own.sources, limits),
    )  # fmt: skip


class _Session:
    """A watch at work: what was said already is not said again."""

    def __init__(
        self, folder: Path, own: CampaignInputs, kind: Any, by: tuple[str, ...], limits: Limits, hear: Listener,
        say: Say, page: Path | None,
    ) -> None:  # fmt: skip
        from aqualog.trade.arrivals import Arrivals
        from aqualog.trade.logs import Request
        from aqualog.trade.watching import Watching

        self.own, self.hear, self.say, self._page = own, hear, say, page
        self._kind, self._by, self._limits = kind, by, limits
        self._files: Seen = state_of(self._campaign_files())
        self.watching: Watching = Watching(
            Arrivals(folder, SETTLE_S, self._campaign_files()), own.configured, self._options(),
            Request(kind, limits, whole_only=True),
        )  # fmt: skip
        self.last: Watched | None = None
        self.is_changed, self.is_written = True, False
        self._written_at = -_HEARTBEAT_S
        self._said: set[str] = set()

    @property
    def is_settled(self) -> bool:
        """Whether no log is left that has yet to show that it is complete."""
        return self.last is not None and not self.last.look.growing

    def step(self) -> None:
        """Look, and say what is new, until nothing more is complete."""
        self._read_campaign_again()
        while True:
            before = self.last
            self.last = self.watching.step(time.monotonic(), _do_apart)
            self._report(before, self.last)
            if not self.last.new:
                return
            self.write()

    def write(self, *, is_end: bool = False) -> None:
        """Write the page if there is something to say, or once in a while to show that somebody looks."""
        from aqualog.report.trade.watching import watch_page

        now = time.monotonic()
        is_due = self.is_changed or is_end or now - self._written_at >= _HEARTBEAT_S
        if self._page is None or self.last is None or not is_due:
            return
        page = watch_page(
            self.last, title=self.own.name, clock=time.strftime("%H:%M:%S") + (", ended" if is_end else ""),
            refresh_s=0 if is_end else _REFRESH_S,
        )  # fmt: skip
        try:
            write_whole(self._page, page_file(lambda: page))
        except AqualogError as error:  # its place may be of the network, too
            self.tell_once(error.line())
            self.is_written = False
            return
        self.is_changed, self.is_written, self._written_at = False, True, now

    def _options(self) -> Options:
        from aqualog.campaign.bins import check_plan
        from aqualog.trade.evaluation import Options

        return Options(self._kind, self._limits, check_plan(self.own.configured.campaign, list(self._by)).keys)

    def _campaign_files(self) -> list[Path]:
        campaign = self.own.configured.campaign
        return [p for p in (campaign.path, campaign.table) if p is not None]

    def _read_campaign_again(self) -> None:
        now = state_of(self._campaign_files())
        if now == self._files or not now:
            return
        self._files = now
        try:
            self.own = CampaignInputs(self.own.inputs)
            self.watching.reconfigured(self.own.configured, self._options())
        except AqualogError as error:
            self.tell_once(f"the campaign has changed and is not right, the one before goes on: {error.line()}")

    def _report(self, before: Watched | None, now: Watched) -> None:
        from aqualog.report.trade.watching import damaged, problems, remarks, run_lines, status

        for line in run_lines(now, before):
            self.say(line)
        if before is not None and before.look.away and not now.look.away:
            self.hear.note("the folder is back")
            self._said -= {x for x in self._said if x.startswith("the folder is away")}
        for name, reason in damaged(now).items():
            if (told := f"{name}: {reason}") not in self._said:
                self._said.add(told)
                self.hear.failed(name, reason)
        for line in remarks(now):
            self.tell_once(line)
        self.is_changed |= before is None or status(before) != status(now) or problems(before) != problems(now)

    def tell_once(self, line: str) -> None:
        """Note something that was not noted yet."""
        if line not in self._said:
            self._said.add(line)
            self.hear.note(line)


def _do_apart(work: Callable[..., object], *task: object) -> object:
    """Work on a log in another process: a damaged one costs itself only, and its memory comes back."""
    from aqualog.guard.reading import limits_from
    from aqualog.guard.worker import NO_LIMITS, Bounds, kept_worker

    with kept_worker(Bounds(NO_LIMITS, limits_from(os.environ))) as do:
        return do(work, *task)


def _is_own(page: Path) -> bool:
    """Whether a page is that of an earlier watch, which a new one takes the place of."""
    from aqualog.report.trade.watching import MARK

    try:
        with page.open("rb") as file:
            return MARK.encode() in file.read(200_000)
    except OSError:
        return False
