"""Compare the clocks of several files of one drive by the speed that they carry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from aqualog.align.clean import corrected
from aqualog.align.clock import estimate_clock
from aqualog.align.mapping import SignalMap, align_command
from aqualog.align.quantity import Quantity, find_quantity
from aqualog.core.errors import FitError, SignalError
from aqualog.core.records import Channel
from aqualog.core.vehicle import Vehicle
from aqualog.doctor.findings import Finding

__all__ = ["clock_findings", "on_clock", "speed_of"]

_LEAST_SHIFT_S = 0.01  # a sample time of 100 Hz
_SENSOR_S = 0.3  # delay of a GNSS speed without a fault of its clock
_MAX_OFFSET_S = 10.0


def speed_of(channels: Sequence[Channel], *, signal_map: SignalMap, vehicle: Vehicle) -> Quantity | None:
    """The speed in the channels of one file, by its own clock; None if it carries none."""
    try:
        found = find_quantity(channels, quantity="speed", signal_map=signal_map, vehicle=vehicle)
    except SignalError:
        return None
    return found if found.t_ns.size else None


def on_clock(speed: Quantity, signal_map: SignalMap) -> Quantity:
    """A speed on the clock that the map gives its file."""
    return replace(speed, t_ns=corrected(speed.t_ns, signal_map, speed.file))


def clock_findings(
    speeds: Sequence[Quantity], paths: Mapping[str, str], map_path: str, dbc: Sequence[str] = ()
) -> Iterator[Finding]:
    """Yield findings for each file whose clock runs at another rate than the first one's, or differs by an offset.

    Parameters
    ----------
    speeds : sequence of Quantity
    paths : mapping file name -> path
    map_path : str
        Signal map of the drive; empty without one.
    dbc : sequence of str
        Databases that the logs were read with.

    Clocks are not compared where the match of the speeds is weak or their common time short.
    """
    for source in speeds[1:]:
        reference = speeds[0]
        apart = source.t_ns[0] > reference.t_ns[-1] or reference.t_ns[0] > source.t_ns[-1]
        began = float(source.t_ns[0] - reference.t_ns[0]) * 1e-9
        try:
            fit = estimate_clock(
                reference.t_ns, reference.x, source.t_ns, source.x, max_offset_s=_MAX_OFFSET_S,
                start_offset_s=began if apart else 0.0,
            )  # fmt: skip
        except FitError:
            continue
        logs = [paths.get(s.file, s.file) for s in (reference, source)]
        advice = align_command(logs, map_path, dbc)
        shift = fit.drift_ppm * 1e-6 * fit.overlap_s
        if fit.drift_significant and abs(shift) > _LEAST_SHIFT_S:
            low, high = fit.drift_ppm_ci95
            what = (
                f"its clock drifts by {fit.drift_ppm:+.0f} ppm (95 % {low:+.0f} to {high:+.0f}) against "
                f"{reference.file}, {shift:+.3f} s over {fit.overlap_s:.0f} s, by the speed in both"
            )
            yield Finding("doubt", "drifts", source.file, source.label, what, advice, 1)
        low, high = fit.offset_ci95
        if not apart and low * high > 0.0 and min(abs(low), abs(high)) > _SENSOR_S:
            side = "after" if fit.offset_s > 0.0 else "before"
            what = (
                f"its speed comes {abs(fit.offset_s):.2f} s {side} the same in {reference.file} "
                f"(95 % {low:+.2f} to {high:+.2f} s), by the speed in both"
            )
            yield Finding("doubt", "offset", source.file, source.label, what, advice, 1)
