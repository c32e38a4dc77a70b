"""Figure 2.25: both joint detectors below the full aquaplaning speed, criterion by criterion."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.thresholds import DEFAULT
from aqualog.figures.drive import DriveRun
from aqualog.figures.record import Axis, Figure, Finding, Panel, Table, judged, seconds
from aqualog.figures.scene_panels import bit_panel, feature_lines, panel, speed_panel
from aqualog.figures.scene_study import MANY, SOME, SceneRun, in_runs, runs, spread, stretches
from aqualog.report.theme import INK, MUTED, THRESHOLD, WHEEL_COLOURS

__all__ = ["make", "panels"]

NUMBER = "2.25"
_COLOURS = (*WHEEL_COLOURS.values(), "#E69F00")
_WORDS = {1: "large spin-down", 2: "minor spin-down", 3: "spin-up", 4: "slip-slope drop", 5: "resistance"}
_DIP, _STOP = -0.015, -0.5  # [-] slip of a minor spin-down, and of a wheel that has lost the road
_REAR = 1.5  # times the dry slip that the rear wheel has on the lane
_SOON = 0.5  # [s] criterion 2
_SLOPE_S, _RESISTANCE_S = 2.0, 3.0  # [s] "after approximately 1.5 s" and "2.5 s after", half a second more each
_KEPT = 0.8  # of the time that the text has a bit active
_ACTIVE_2 = (0.5, 3.5)  # [s] after the entry: 24.5 to 27.5 s
_RISE = 0.5  # of its threshold that the sum must reach when it "increases"
_CROSS_S = 2.0  # [s] by then the sum has crossed: 25.8 s


class Times(NamedTuple):
    """When each criterion is met first after the entry, and the sum; NaN where never. [s]"""

    one: float
    two: float
    four: float
    five: float
    rise: float
    cross: float


def _bit(r: DriveRun, k: int) -> BoolArray:
    return np.asarray(r.feature(f"criterion_{k}") > 0.5)


def _times(r: SceneRun) -> Times:
    total, threshold = r.statistic("joint_cusum")
    one, two, four, five = (r.after_entry(_bit(r, k)) for k in (1, 2, 4, 5))
    rise = r.after_entry(np.nan_to_num(total) > _RISE * threshold)
    return Times(one, two, four, five, rise, r.after_entry(r.active("joint_cusum")))


def _rear_rises(r: SceneRun) -> bool:
    slip = r.signal("true_slip_rr")
    dry, wet = np.nanmedian(slip[r.within(10.0, r.entry)]), np.nanmedian(slip[r.on_lane()])
    return bool(wet > _REAR * dry)


def _is_minor(r: SceneRun) -> bool:
    slip = r.signal("true_slip_fr")
    return len(stretches(r, (slip < _DIP) & r.on_lane())) > 1 and bool(np.nanmin(slip[r.on_lane()]) > _STOP)


def _kept(r: SceneRun, k: int, start: float, end: float) -> float:
    """Share of a time after the entry in which a criterion is met. [-]"""
    span = r.within(r.entry + start, r.entry + end)
    return float(np.mean(_bit(r, k)[span])) if span.any() else 0.0


def _loss(r: SceneRun, wheel: str) -> FloatArray:
    """Lost share of the dry slip slope where it is judged, NaN elsewhere, array (n,). [-]"""
    track = next(t for t in r.result.tracks if t.detector == "slip_slope_drop" and t.wheel == wheel)
    return track.statistic


def _resistance(r: SceneRun) -> float:
    """Median resistance measure on the lane. [m/s²]"""
    return float(np.nanmedian(r.feature("delta_a_x")[r.on_lane()]))


def _share(bits: list[bool]) -> float:
    return float(np.mean(bits))


def _median(values: list[float]) -> float:
    """Median where a criterion that is never met counts as the longest; infinite if most never are."""
    return float(np.median([np.inf if np.isnan(v) else v for v in values]))


def _value(x: float) -> float | None:
    return x if np.isfinite(x) else None


_LANE = "The contact fluctuates along the lane; where it is worst is another place in every run."


def _c72(all_runs: tuple[SceneRun, ...]) -> Finding:
    rear, minor = [_rear_rises(r) for r in all_runs], [_is_minor(r) for r in all_runs]
    both = _share([a and b for a, b in zip(rear, minor, strict=True)])
    return Finding(
        "C72",
        "Constant speed below the full one, 0.8 mm: after the entry the rear slip rises significantly, while the front "
        "right wheel has a series of minor spin-downs.",
        f"median rear right slip on the lane above {_REAR:g} times the dry one, and at least two slips of the front "
        f"right wheel below {_DIP:.1%}, none below {_STOP:.0%}, in {MANY:.0%} of the runs; in part: the former",
        f"both in {in_runs(both)} runs: rear slip {in_runs(_share(rear))}, minor spin-downs {in_runs(_share(minor))}",
        judged(whole=both >= MANY, part=_share(rear) >= MANY),
        "" if both >= MANY else _LANE,
        both,
    )


def _c73(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Finding:
    two = [t.two for t in times]
    soon = _share([t <= _SOON for t in two])
    kept = [_kept(r, 2, *_ACTIVE_2) for r in all_runs]
    whole = soon >= MANY and float(np.median(kept)) >= _KEPT
    return Finding(
        "C73",
        "Criterion 2 finds it in less than 0.5 s and stays until 27.5 s.",
        f"met within {_SOON:g} s in {MANY:.0%} of the runs, and for {_KEPT:.0%} of the time from {_ACTIVE_2[0]:g} to "
        f"{_ACTIVE_2[1]:g} s after the entry (median); in part: median within {_SOON:g} s",
        f"within {_SOON:g} s in {in_runs(soon)} runs, after {spread(two)} s; met for {spread(kept)} of that time",
        judged(whole=whole, part=_median(two) <= _SOON),
        "" if whole else _LANE + " The first dips come with it.",
        _value(_median(two)),
    )  # fmt: skip


def _c74(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Finding:
    four = [t.four for t in times]
    found = _share([np.isfinite(t) for t in four])
    ends = [
        _kept(r, 4, t, r.exit - r.entry) >= _KEPT if np.isfinite(t) else False
        for r, t in zip(all_runs, four, strict=True)
    ]
    right = _share([bool((r.active("slip_slope_drop", "rr") & r.on_lane()).any()) for r in all_runs])
    judged_s = [float(np.mean(np.isfinite(_loss(r, "rr")[r.on_lane()]))) * (r.exit - r.entry) for r in all_runs]
    whole = found >= MANY and _median(four) <= _SLOPE_S and _share(ends) >= MANY and right >= MANY
    return Finding(
        "C74",
        "Criterion 4 finds the rear right slip after about 1.5 s and stays to the end.",
        f"met in {MANY:.0%} of the runs, median within {_SLOPE_S:g} s, and from then on for {_KEPT:.0%} of the lane in "
        f"{MANY:.0%}, by the rear right wheel in {MANY:.0%}; in part: met on the lane in {SOME:.0%}, whichever wheel",
        f"met in {in_runs(found)} runs, after {spread(four)} s; kept in {in_runs(_share(ends))}; by the rear right "
        f"wheel in {in_runs(right)}, whose slope could be judged for {spread(judged_s)} s on the lane",
        judged(whole=whole, part=found >= SOME),
        "" if whole else "The right slope falls at once, but is hardly ever judged: it is that of a pair of wheels, "
        "and the criterion needs calm wheels, which the front right one with its minor spin-downs is not. What is "
        "found is the left wheel's, on less water.",
        _value(_median(four)),
    )  # fmt: skip


def _c75(times: list[Times]) -> Finding:
    found = [np.isfinite(t.one) for t in times]
    later = [t.one > t.two for t in times if np.isfinite(t.one) and np.isfinite(t.two)]
    whole = _share(found) >= SOME and bool(later) and _share(later) >= MANY
    return Finding(
        "C75",
        "At 26 s even criterion 1, large spin-downs, is met.",
        f"met on the lane in {SOME:.0%} of the runs, and there later than criterion 2 in {MANY:.0%}; in part: met in "
        "one run",
        f"met in {in_runs(_share(found))} runs, after {spread([t.one for t in times])} s; later than criterion 2 in "
        f"{sum(later)} of {len(later)}",
        judged(whole=whole, part=any(found)),
        "" if whole else _LANE,
        _share(found),
    )


def _c76(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Finding:
    five = [t.five for t in times]
    order = _share([t.two < t.four < t.five for t in times])
    pairs = {"2 before 4": [t.two < t.four for t in times], "4 before 5": [t.four < t.five for t in times]}
    in_time = _median(five) <= _RESISTANCE_S
    whole = in_time and order >= MANY
    return Finding(
        "C76",
        "Criterion 5, tuned for robustness, comes 2.5 s after the entry; the order is 2, 4, 5.",
        f"median within {_RESISTANCE_S:g} s, and the order 2, 4, 5 in {MANY:.0%} of the runs; in part: one of both",
        f"criterion 5 after {spread(five)} s; order in {in_runs(order)} runs ("
        + ", ".join(f"{n} {in_runs(_share(x))}" for n, x in pairs.items()) + ")",
        judged(whole=whole, part=in_time or order >= MANY),
        "" if whole else f"The water takes {spread([_resistance(r) for r in all_runs])} m/s² (median on the lane), "
        f"which the default threshold, a sum of {DEFAULT.resistance:g} m/s beyond the drift, finds sooner than the "
        "thesis' robust tuning, which is not given.",
        _value(_median(five)),
    )  # fmt: skip


def _active_stretches(r: SceneRun) -> int:
    return len(stretches(r, r.active("joint_cusum") & r.on_lane()))


def _c77(all_runs: tuple[SceneRun, ...], times: list[Times]) -> Finding:
    in_order = _share([t.rise < t.cross for t in times])
    crosses = _share([_SOON < t.cross <= _CROSS_S for t in times])
    again = _share([_active_stretches(r) > 1 for r in all_runs])
    active = _share([np.isfinite(t.cross) for t in times])
    whole = in_order >= MANY and crosses >= MANY and again >= SOME
    return Finding(
        "C77",
        "The sum rises 0.5 s after the entry without crossing its threshold, crosses it slightly at 25 s, falls, and "
        "is active from 25.8 to 28.8 s.",
        f"beyond {_RISE:.0%} of the threshold before it is crossed, in {MANY:.0%} of the runs; crossed first between "
        f"{_SOON:g} and {_CROSS_S:g} s after the entry in {MANY:.0%}; active more than once on the lane in {SOME:.0%}; "
        f"in part: the first of these, and active on the lane in {MANY:.0%}",
        f"rise before crossing in {in_runs(in_order)} runs, crossed in that time in {in_runs(crosses)} (after "
        f"{spread([t.cross for t in times])} s, rise after {spread([t.rise for t in times])} s), more than once "
        f"in {in_runs(again)}",
        judged(whole=whole, part=in_order >= MANY and active >= MANY),
        "" if whole else "The variance term reaches its largest value within the first half second, and with the first "
        "resistance or a dip's own sum it crosses; the resistance then stays until the exit, so that it does not fall "
        "back. Scales and threshold of the thesis are not given.",
        _value(_median([t.cross for t in times])),
    )  # fmt: skip


def panels(r: DriveRun) -> tuple[Panel, ...]:
    """Speeds, bits of the criteria, and the sum with its terms."""
    total, threshold = r.statistic("joint_cusum")
    bits = {f"{k}: {_WORDS[k]}": (float(k), _bit(r, k), c) for k, c in zip(_WORDS, _COLOURS, strict=True)}
    terms = {
        n.replace("_", " "): (r.feature(f"joint_term_{n}"), c, "dot")
        for n, c in zip(
            ("spin_down", "minor_spin_down", "spin_up", "slip_slope_drop", "resistance"), _COLOURS, strict=True
        )
    }
    lines = {
        "sum": (total, INK, "solid"), **terms,
        "threshold": (np.full(r.t.size, threshold), THRESHOLD, "dash"),
    }  # fmt: skip
    below = {"warning": (np.where(r.active("joint_cusum"), -0.15, np.nan), MUTED, "solid")}
    warning = [replace(line, width=6.0) for line in feature_lines(r, below)]
    return (
        speed_panel(r),
        bit_panel(r, "Criteria of joint detector 1", "criterion", bits),
        panel(r, "Sum of joint detector 2", Axis("scaled sum"), [*feature_lines(r, lines), *warning]),
    )


def make() -> Figure:
    """Speeds, bits of the criteria and the sum of one run; C72 to C77 over all runs."""
    all_runs = runs(NUMBER)
    times = [_times(r) for r in all_runs]
    r = all_runs[0]
    table = Table(
        "First time after the entry [s]",
        ("seed", "criterion 2", "criterion 4", "criterion 1", "criterion 5", "sum rises", "sum active"),
        tuple(
            (str(x.seed), *(seconds(v) for v in (t.two, t.four, t.one, t.five, t.rise, t.cross)))
            for x, t in zip(all_runs, times, strict=True)
        ),
    )
    return Figure(
        NUMBER,
        "both joint detectors at minor aquaplaning",
        f"Rear-wheel drive, worn summer tyres, low pressure, 0.8 mm right and less left, 107 km/h, entry at "
        f"{r.entry:g} s. Criteria as they are met, whether or not the resistance gate is open. The dry slip slope is "
        f"known from an earlier dry drive; thresholds are the default ones. Drawn: seed {r.seed}; judged over seeds "
        f"{all_runs[0].seed} to {all_runs[-1].seed}, which differ in sensor noise and in how the contact fluctuates "
        f"along the lane.",
        panels(r),
        (
            _c72(all_runs), _c73(all_runs, times), _c74(all_runs, times), _c75(times), _c76(all_runs, times),
            _c77(all_runs, times),
        ),
        (table,),
    )  # fmt: skip
