"""Take off what accelerometers and gyro show while the car stands, where the user asks for it."""

from __future__ import annotations

from dataclasses import replace

from aqualog.checks.speeds import scale_doubts
from aqualog.checks.standstill import OFFSETS, offsets
from aqualog.checks.windows import Gather
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle

__all__ = ["without_offsets"]


def without_offsets(signals: Signals, vehicle: Vehicle) -> Signals:
    """Return the signals less their offsets at standstill; a note says what was taken off, or why no value was.

    An offset that may be the slope of the road stays.
    """
    own = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    gather = Gather(own, vehicle, signals.dt)
    gather.push({s: signals.array(s) for s in own})
    windows = gather.windows()
    wrong = {s for d in scale_doubts(windows) for s in d.signals}
    found = offsets(windows)
    notes, taken = [], [o for o in found if o.counts and o.symbol not in wrong]
    for o in taken:
        kind = OFFSETS[o.symbol]
        value, low, high = (f"{x:+.{kind.digits}f}" for x in (o.value, *o.ci95))
        notes.append(f"{o.symbol}: {value} {kind.unit} is taken off, as it shows at standstill (95 % {low} to {high})")
    if not taken:
        why = "no offset is surely more than the slope of a road" if found else "the car does not stand in this drive"
        notes.append(f"offsets are not corrected: {why}")
    frame = signals.frame.with_columns(signals.frame[o.symbol] - o.value for o in taken)
    quality = replace(signals.quality, notes=(*signals.quality.notes, *notes))
    return replace(signals, frame=frame, quality=quality)
