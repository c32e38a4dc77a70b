"""The checks of one drive, all alike for every command: piece by piece, or of signals as a whole."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from aqualog.checks.delays import delay_doubts
from aqualog.checks.doubts import Doubt, remarks_of
from aqualog.checks.drive import drive_doubts
from aqualog.checks.signs import sign_doubts
from aqualog.checks.slip import in_turn, is_of_wheels
from aqualog.checks.speeds import scale_doubts
from aqualog.checks.standstill import offset_doubts
from aqualog.checks.turning import turning_scale_doubts
from aqualog.checks.windows import EXTRA, Gather, Windows
from aqualog.core.records import FloatArray, Origin, Remark, Signals
from aqualog.core.vehicle import Vehicle

__all__ = ["Checks", "look"]

IMPOSSIBLE = 0.2  # share of a signal's samples from which its unit or channel is wrong, and not a sample now and then
_SCALED = ("yaw_rate", "a_y")
_JUDGED = (14.0, -1.0)  # [m/s], [m/s^2] above which the measure of the resistance means something


class Checks:
    """Gather a drive piece by piece, and say at its end what does not fit. `available`: its symbols; `dt` [s]."""

    def __init__(self, available: Collection[str], vehicle: Vehicle, dt: float) -> None:
        self._gather = Gather([*available, EXTRA], vehicle, dt)

    def push(self, columns: Mapping[str, FloatArray], features: Mapping[str, FloatArray] | None = None) -> None:
        """Take the signals of the next piece, arrays (n,), and where there are some its features."""
        f = features or {}
        if EXTRA in f:
            with np.errstate(invalid="ignore"):
                judged = (f["v_x_hat"] > _JUDGED[0]) & (f["a_kin_slow"] > _JUDGED[1])
            extra = np.where(judged, f[EXTRA], np.nan)
        else:
            extra = np.full(next(iter(columns.values())).size, np.nan)
        self._gather.push({**columns, EXTRA: extra})

    def remarks(self, origins: Mapping[str, Origin]) -> tuple[Remark, ...]:
        """Return what does not fit; empty if all fits or too little moved. `origins` name the lines of the map."""
        return remarks_of([*_impossible(origins.values()), *_doubts(self._gather.windows())], origins)


def look(signals: Signals, vehicle: Vehicle) -> tuple[Remark, ...]:
    """Return what does not fit among the signals of a drive, as `Checks` does."""
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    if not present:
        return ()
    checks = Checks(present, vehicle, signals.dt)
    checks.push({s: signals.array(s) for s in present})
    return checks.remarks(signals.origins)


def _impossible(origins: Iterable[Origin]) -> Iterator[Doubt]:
    """Yield signals much of which no car can have: what is left of them is not right either."""
    for origin in origins:
        share = origin.out_of_range / max(origin.samples, 1)
        if share > IMPOSSIBLE:
            what = f"{100.0 * share:.0f} % of the samples of {origin.symbol} are beyond what a car can have"
            yield Doubt("channel", (origin.symbol,), what, "check its unit and its channel", value=share)


def _doubts(windows: Windows) -> list[Doubt]:
    scales = [*scale_doubts(windows)]
    are_speeds_right = all(d.signals == ("a_x",) and d.ways for d in scales)
    scales += turning_scale_doubts(windows, are_speeds_right=are_speeds_right)
    # what hangs on a wrong scale or channel is no fault of its own: signs are judged with the scale put right
    factors = {s: c.factor for d in scales if len(d.ways) == 1 for s, c in d.ways[0].items() if s in _SCALED}
    scaled = replace(windows, columns={n: x * factors.get(n, 1.0) for n, x in windows.columns.items()})
    signs = [*sign_doubts(scaled)]
    offsets = [*offset_doubts(windows)]
    absurd = {d.signals for d in offsets if d.kind == "channel"} - {d.signals for d in scales}
    signs = [d for d in signs if d.signals not in absurd]
    wrong = {s for d in (*scales, *signs) if d.kind in ("scale", "channel") for s in d.signals}
    rest = windows.without(wrong & {"a_x"} and {"a_x", EXTRA})
    found = [*signs, *(d for d in offsets if not wrong & {*d.signals}), *scales, *drive_doubts(rest)]
    found += [d for d in delay_doubts(windows) if not wrong & {*d.signals}]
    # one exchange of wheels at a time: lines for two of them would not fit each other
    wheels = sorted((d for d in found if is_of_wheels(d)), key=in_turn)
    return [d for d in found if d not in wheels[1:]]
