"""Find faults of single channels: in their time stamps and in their values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from aqualog.align.freezes import Stretch, longest_stop
from aqualog.align.overview import ChannelOverview
from aqualog.core.records import Channel, TimeFaults
from aqualog.doctor.findings import Finding, Level

__all__ = ["channel_findings"]

_HABIT = 0.01  # of the stamps doubled here and there are a logger's habit; more are samples lost to a wrong clock
_HABITUAL: dict[str, Level] = {"duplicates": "mended", "strays": "left_out"}
_TIMES: dict[str, tuple[Level, str, str]] = {
    "duplicates": (
        "lost", "time stamps doubled; the last sample of each is kept",
        "check the logger's clock, and whether a block of the file stands twice",
    ),
    "back_steps": ("mended", "time stamps out of order; samples are sorted by time", ""),
    "resets": (
        "mended", "resets of the clock; what follows is put behind what came before, the pause between is not known",
        "cut the log there if it holds two drives; beside other files what follows is out of step with them",
    ),
    "wraps": ("mended", "overflows of the time counter; undone", ""),
    "pauses": ("doubt", "pauses of the recording; nothing is judged in them", ""),
    "strays": ("lost", "time stamps from elsewhere; their samples are left out", "check the logger's clock"),
}  # fmt: skip


def channel_findings(
    found: Sequence[ChannelOverview], channels: Sequence[Channel], standing: Sequence[Stretch] = ()
) -> Iterator[Finding]:
    """Yield findings of all channels of a drive.

    Parameters
    ----------
    found : sequence of ChannelOverview
    channels : sequence of Channel
        In the same order.
    standing : sequence of Stretch
        Times at standstill: a constant value there is no sign of a dead sensor.

    Channels of one file share their clock: a fault of the stamps that several share is reported once.
    """
    told: set[tuple[str, str, int]] = set()
    for own, channel in zip(found, channels, strict=True):
        for kind in TimeFaults.KINDS:
            count = getattr(own.faults, kind)
            if count and (own.file, kind, count) not in told:
                told.add((own.file, kind, count))
                level, what, advice = _TIMES[kind]
                if count <= _HABIT * own.samples:
                    level = _HABITUAL.get(kind, level)
                fault, _, rule = what.partition("; ")
                told_as = f"{count} {fault}{own.faults.place(kind)}; {rule}"
                first_s = own.faults.first_s.get(kind)
                yield Finding(level, kind, own.file, own.path, told_as, advice, count, own.samples, first_s)
        yield from _of_values(own, channel, standing)


def _of_values(own: ChannelOverview, channel: Channel, standing: Sequence[Stretch]) -> Iterator[Finding]:
    if own.samples == 0:
        yield Finding("doubt", "empty", own.file, own.path, "has no sample")
        return
    if own.not_finite and not own.name.rpartition(".")[2].startswith("true_"):  # what the simulation knows besides
        what = f"{own.not_finite} of {own.samples} samples are no numbers (NaN, infinite, marked invalid); not used"
        yield Finding("doubt", "not_finite", own.file, own.path, what, "", own.not_finite, own.samples)
    if own.remark and own.remark not in ("constant", "no value"):
        what, _, advice = own.remark.partition(": ")
        yield Finding("doubt", "code", own.file, own.path, what, advice)
    stop = longest_stop(channel.t_ns, channel.values, standing)
    if stop is not None:
        part = f", {stop.moving_s:.0f} s of it while the car moves" if stop.length_s - stop.moving_s >= 1.0 else ""
        what = (
            f"stands at {stop.value:g} for {stop.length_s:.0f} s (from {stop.from_s:.0f} s){part}; elsewhere it "
            f"changes in {100.0 * stop.share:.0f} % of the samples"
        )
        yield Finding("doubt", "frozen", own.file, own.path, what, "check this part before you trust results from it")
