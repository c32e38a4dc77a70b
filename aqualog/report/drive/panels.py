"""The panels of a drive's page, from the top: what each draws, as data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from aqualog.core.notation import SIDES, SYMBOLS, WHEELS
from aqualog.core.records import DriveResult, FloatArray, Signals, Track
from aqualog.report.drive.stack import VEHICLE, Lane, Line, Row, rows_figure
from aqualog.report.figures import PALETTE
from aqualog.report.reduce import Spans, spans_of
from aqualog.report.theme import INK, MUTED, WATER, WHEEL_COLOURS, detector_colour, wheel_colour
from aqualog.report.values import place, pretty_unit
from aqualog.report.wording import caption, detector_name

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

__all__ = ["drive_rows", "signals_figure"]

_MOST_BARS = 20_000  # per lane, and shades of the water; beyond, those that nearly touch are joined
_STEERING = "#7F6BB3"
_DEPTHS = {
    "water_depth": ("lane", WATER),
    "water_depth_left": ("left track", WHEEL_COLOURS["fl"]),
    "water_depth_right": ("right track", WHEEL_COLOURS["fr"]),
}


def drive_rows(result: DriveResult) -> list[Row]:
    """The panels of a drive, from the top; a panel without a line or lane is left out."""
    return [row for row in _rows(result) if row.lines or row.lanes]


def _feature(frame: pl.DataFrame, name: str) -> FloatArray | None:
    """A column as floats; None where it is absent or has no value at all."""
    import polars as pl

    if name not in frame.columns:
        return None
    values: FloatArray = frame[name].cast(pl.Float64).to_numpy()
    return values if np.isfinite(values).any() else None


def _rows(r: DriveResult) -> Iterator[Row]:
    yield _speeds(r)
    yield _lanes(r)
    yield _margin(r)
    yield Row(
        "Speed difference", "wheel minus vehicle; below zero the wheel spins down", "km/h",
        _wheel_lines(r, "v_w_delta", ("m/s", "km/h")), include=(-1.0, 1.0), height=150,  # Eq. (2.4)
    )  # fmt: skip
    yield Row(
        "Acceleration difference", "wheel minus vehicle; a healthy wheel stays near zero", "m/s²",
        _wheel_lines(r, "a_w_delta"), include=(-2.0, 2.0), height=150,  # Eq. (2.3)
    )  # fmt: skip
    yield from (
        _statistic(d, [t for t in r.tracks if t.detector == d]) for d in dict.fromkeys(t.detector for t in r.tracks)
    )
    yield _slip_slope(r)
    yield _resistance(r)
    yield _tie_rods(r)
    yield from _as_logged(r)
    columns = [(label, colour, _feature(r.signals.frame, s)) for s, (label, colour) in _DEPTHS.items()]
    depths = tuple(Line(label, VEHICLE, colour, v, units=("m", "mm")) for label, colour, v in columns if v is not None)
    yield Row("Water depth", "as logged", "mm", depths, include=(0.0,), height=100)


def _as_logged(r: DriveResult) -> Iterator[Row]:
    """The raw signals that the detectors work on."""

    def lines(units: tuple[str, str], **labels: tuple[str, str]) -> tuple[Line, ...]:
        found = [(label, colour, _feature(r.signals.frame, s)) for s, (label, colour) in labels.items()]
        return tuple(Line(label, VEHICLE, colour, v, units=units) for label, colour, v in found if v is not None)

    torques = [(w, _feature(r.signals.frame, f"torque_{w}")) for w in WHEELS]
    yield Row(
        "Wheel torque", "as logged: drive minus brake", "N·m",
        tuple(Line(w.upper(), w, wheel_colour(w), v) for w, v in torques if v is not None), include=(-50.0, 50.0),
        decimals=0,
    )  # fmt: skip
    yield Row(
        "Acceleration", "as logged: a_x forward, a_y to the left (blue)", "m/s²",
        lines(("-", "-"), a_x=("a_x", INK), a_y=("a_y", PALETTE[0])), include=(-1.0, 1.0),
    )  # fmt: skip
    yield Row(
        "Yaw rate", "as logged: left turn positive", "°/s", lines(("rad/s", "°/s"), yaw_rate=("yaw rate", INK)),
        include=(-2.0, 2.0), height=100,
    )  # fmt: skip
    yield Row(
        "Steering angle", "at the road wheels, left positive", "°",
        lines(("rad", "deg"), steer_angle=("steering angle", _STEERING)), include=(-1.0, 1.0), height=100,
    )  # fmt: skip
    yield Row(
        "Brake pressure", "as logged", "bar", lines(("Pa", "bar"), brake_pressure=("brake pressure", PALETTE[1])),
        include=(0.0, 1.0), height=100,
    )  # fmt: skip


def _wheel_lines(r: DriveResult, stem: str, units: tuple[str, str] = ("-", "-")) -> tuple[Line, ...]:
    """The lines of the wheels that have this feature; `units` are the feature's and the axis's."""
    columns = [(w, _feature(r.features, f"{stem}_{w}")) for w in WHEELS]
    return tuple(Line(w.upper(), w, wheel_colour(w), v, units=units) for w, v in columns if v is not None)


def _speeds(r: DriveResult) -> Row:
    """Speed of the vehicle and of the four wheels on its centre line."""
    units = ("m/s", "km/h")
    reference, estimate = _feature(r.signals.frame, "v_x"), _feature(r.features, "v_x_hat")
    below = () if reference is None else (Line("v_x reference", VEHICLE, MUTED, reference, 1.0, units),)
    above = () if estimate is None else (Line("v_x", VEHICLE, INK, estimate, 1.8, units),)
    return Row(
        "Speed", "wheels on the vehicle's centre line; a wheel that leaves the black line slips", "km/h",
        (*below, *_wheel_lines(r, "v_w", units), *above), least_span=4.0, shades=_watered(r), height=210,
    )  # fmt: skip


def _watered(r: DriveResult) -> Spans | None:
    """Where the label says that the car is on the watered lane; None without a label."""
    if "on_water" not in r.signals.frame.columns:
        return None
    return spans_of(np.nan_to_num(r.signals.array("on_water")) > 0.5, at_most=_MOST_BARS)


def _lanes(r: DriveResult) -> Row:
    """Times at which each detector reports aquaplaning, by wheel or side."""
    found, water = [_lane(t) for t in r.tracks], _watered(r)
    if water is not None:
        found.append(Lane("On water (label)", VEHICLE, WATER, water))
    about = "bars: the detector reports; an empty lane was judged, without event"
    return Row("Detections", about, "", lanes=tuple(found), height=18 * len(found) + 8)


def _lane(track: Track) -> Lane:
    label = f"{detector_name(track.detector)} {place(track.wheel, track.side)}".rstrip()
    if not np.isfinite(track.statistic).any():
        label += " (not judged)"  # its signals are there but carry no usable value
    spans = spans_of(track.active, at_most=_MOST_BARS)
    return Lane(label, track.wheel or VEHICLE, detector_colour(track.detector, track.wheel), spans)


def _statistic(detector: str, tracks: Sequence[Track]) -> Row:
    """The statistic of one detector against its threshold."""
    lines = tuple(
        Line(
            place(t.wheel, t.side) or "vehicle", t.wheel or VEHICLE, detector_colour(detector, t.wheel),
            np.asarray(t.statistic, dtype=np.float64),
        )
        for t in tracks if np.isfinite(t.statistic).any()
    )  # fmt: skip
    thresholds = tuple(sorted({t.threshold for t in tracks if np.isfinite(t.threshold)}))
    unit = pretty_unit(tracks[0].unit)
    return Row(detector_name(detector), caption(detector), unit, lines, thresholds=thresholds, include=(0.0,))


def _margin(r: DriveResult) -> Row:
    """How many km/h are left to full aquaplaning, as a band."""
    ends = (
        ("95 %", "high", MUTED, 0.9), ("75 %", "q75", WATER, 1.0), ("median", "", INK, 1.8),
        ("25 %", "q25", WATER, 1.0), ("5 %", "low", MUTED, 0.9),
    )  # fmt: skip
    columns = [(*e, _feature(r.features, f"aquaplaning_margin_{e[1]}" if e[1] else "aquaplaning_margin")) for e in ends]
    lines = tuple(
        Line(label, VEHICLE, colour, v, width, ("m/s", "km/h")) for label, _, colour, width, v in columns
        if v is not None
    )  # fmt: skip
    about = "what is left, with 50 and 90 % intervals; below zero it floats"
    return Row("Distance to full aquaplaning", about, "km/h", lines, include=(0.0, 30.0), height=150, decimals=0)


def _slip_slope(r: DriveResult) -> Row:
    """Slip slope C_s / F_z per side beside the dry slope (thesis chapter 3, criterion 4)."""
    lines = []
    wheels = {t.side: t.wheel for t in r.tracks if t.detector == "slip_slope_drop"}
    for side, pair in SIDES.items():
        slope, dry = (_feature(r.features, f"slip_slope_{of}{side}") for of in ("", "ref_"))
        if slope is None:
            continue
        wheel = wheels.get(side)
        # an all-wheel drive has a slope per side, drawn in the colour of its front wheel
        group, colour, name = wheel or VEHICLE, wheel_colour(wheel or pair[0]), place(wheel, side) or side
        lines.append(Line(name, group, colour, slope))
        if dry is not None:
            lines.append(Line(f"{name}, dry", group, MUTED, dry, width=0.9))
    return Row("Slip slope", "traction per slip; dry value in grey", "", tuple(lines), include=(0.0, 40.0))


def _resistance(r: DriveResult) -> Row:
    """Nominal minus measured acceleration, Eq. (2.9) of the thesis."""
    values, offset = _feature(r.features, "delta_a_x"), _feature(r.features, "delta_a_x_offset")
    about = "nominal minus measured acceleration; water lifts it"
    lines = [] if values is None else [Line("delta_a_x", VEHICLE, detector_colour("resistance", None), values)]
    if lines and offset is not None:
        lines.append(Line("dry offset", VEHICLE, MUTED, offset, width=0.9))
        about += "; its offset on dry road in grey"
    return Row("Resistance measure", about, "m/s²", tuple(lines), include=(-0.2, 0.2))


def _tie_rods(r: DriveResult) -> Row:
    """Tie-rod forces, or the steering torque, beside the expectation for a dry road (thesis section 2.4)."""
    about, lines = "measured; dry model in grey", list[Line]()
    for wheel in ("fl", "fr"):
        measured, model = (_feature(r.features, f"tie_rod_{of}_{wheel}") for of in ("meas", "hat"))
        if measured is not None and model is not None:
            lines.append(Line(wheel.upper(), wheel, wheel_colour(wheel), measured))
            lines.append(Line(f"{wheel.upper()}, model", wheel, MUTED, model, width=0.9))
    if lines:
        return Row("Tie-rod forces", about, "N", tuple(lines), include=(-200.0, 200.0), decimals=0)
    measured, model = (_feature(r.features, f"steering_{of}") for of in ("meas", "hat"))
    if measured is not None and model is not None:
        lines.append(Line("measured", VEHICLE, _STEERING, measured))
        lines.append(Line("model", VEHICLE, MUTED, model, width=0.9))
    return Row("Steering torque", about, "N·m", tuple(lines), include=(-1.0, 1.0))


def signals_figure(signals: Signals, title: str) -> go.Figure:
    """The signals of a drive over time; those of one stem and unit share a panel."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in signals.symbols:
        if np.isfinite(signals.array(name)).any():
            stem = name[:-3] if name[-2:] in WHEELS and name[-3] == "_" else name
            groups.setdefault((stem, SYMBOLS[name].unit), []).append(name)
    rows = [
        # the meaning of a signal, or the names where several share the panel
        Row(
            stem, SYMBOLS[names[0]].meaning if len(names) == 1 else ", ".join(names), pretty_unit(unit),
            tuple(_signal(signals, n, i) for i, n in enumerate(names)),
        )
        for (stem, unit), names in groups.items()
    ]  # fmt: skip
    made = rows_figure(rows, signals.frame.height, signals.dt)
    made.update_layout(meta={"title": title})
    return made


def _signal(signals: Signals, name: str, i: int) -> Line:
    wheel = name[-2:] if name[-2:] in WHEELS else None
    colour = wheel_colour(wheel) if wheel else PALETTE[i % len(PALETTE)]
    return Line(name, wheel or VEHICLE, colour, signals.array(name))
