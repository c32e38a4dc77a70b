"""A whole test: all runs in order, sets by configuration, each with its mean and its index against the control tyre."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aqualog.campaign.bins import Group, group_of
from aqualog.campaign.definition import Campaign
from aqualog.core.errors import ConfigError
from aqualog.core.intervals import Interval, student_quantile
from aqualog.trade.braking import Stop
from aqualog.trade.control import Block, Control, Drift, Estimate, Index, blocks_of, index_of
from aqualog.trade.curve import CurvePass
from aqualog.trade.curve_set import CurveResult, CurveSet, common_speeds, curve_set
from aqualog.trade.entry import UNPLANNED, Entry, Kind, Record
from aqualog.trade.grip import Coefficients, wet_grip_index
from aqualog.trade.limits import Limits
from aqualog.trade.logs import Measured
from aqualog.trade.sets import Summary, expected_in_set, summarised
from aqualog.trade.speeds import DELAY_OPEN, NO_V_X, RADIUS_OF_SET, RADIUS_OPEN, RATIO_OF_SET
from aqualog.trade.straight import StraightRun

__all__ = ["ControlRow", "Options", "SetRow", "TradeTest", "check_control", "entries_of", "evaluated"]

_Made = Callable[[Sequence[Sequence[int]]], tuple[list[Block], bool]]
"""What makes the control's sets of runs in a row: blocks, and whether they share one spread."""


@dataclass(frozen=True, slots=True)
class Options:
    """How a test is evaluated: keys of a set, control tyre (empty: none), index of the control, what is compared of a
    curve, and coefficients of the wet grip index.
    """

    kind: Kind
    limits: Limits
    keys: tuple[str, ...] = ()
    control: str = ""
    index: float = 100.0
    result: CurveResult = "mean"
    coefficients: Coefficients | None = None


@dataclass(frozen=True, slots=True)
class SetRow:
    """One set: its runs by place in `TradeTest.entries`, and what they say: a curve in `curve`, else in `summary`."""

    group: Group
    members: tuple[int, ...]
    is_control: bool
    summary: Summary | None = None
    curve: CurveSet | None = None
    index: Index | None = None
    index_note: str = ""
    temperature: float = math.nan  # [degC] mean of the valid stops
    grip_index: float = math.nan

    @property
    def estimate(self) -> Estimate:
        """The set's value with its variance."""
        if self.curve is not None:
            return self.curve.estimate
        assert self.summary is not None
        return _estimate(self.summary)


@dataclass(frozen=True, slots=True)
class ControlRow:
    """The control tyre as sets are compared with it: `rest` is the configuration beside the tyre that its runs share
    with theirs, empty where all of its runs count.
    """

    rest: Group
    control: Control
    drift: Drift | None


@dataclass(frozen=True, slots=True)
class TradeTest:
    """The result of a test. `failed`: why logs gave nothing, by name; `between`: common speeds of a curve [m/s]."""

    options: Options
    entries: tuple[Entry, ...]
    sets: tuple[SetRow, ...]
    controls: tuple[ControlRow, ...] = ()
    failed: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    between: tuple[float, float] = (math.nan, math.nan)

    @property
    def valid(self) -> int:
        """Runs that count."""
        return sum(e.valid for e in self.entries)


def check_control(campaign: Campaign, control: str) -> None:
    """Refuse a control that no run was driven on.

    Raises
    ------
    ConfigError
    """
    tyres = list(dict.fromkeys(str(r.values["tyre"]) for r in campaign.runs if "tyre" in r.values))
    if control and control not in tyres:
        known = ", ".join(tyres[:10]) or "none: the runs name no tyre"
        raise ConfigError(f'no run has the control tyre "{control[:60]}"', expected=f"one of the tyres: {known}")


def entries_of(
    campaign: Campaign, names: Sequence[str], measured: Mapping[int, Measured | str], keys: Sequence[str]
) -> tuple[Entry, ...]:
    """Return all runs, passes or stops in the order in which they were driven.

    That is by their absolute times, else by the campaign's order: where a log has no time, or two logs have the same,
    as those of a logger whose clock is not set.
    """
    found = [
        (i, number, record, m)
        for i, m in sorted(measured.items()) if isinstance(m, Measured)
        for number, record in enumerate(m.found, 1)
    ]  # fmt: skip
    times = [m.start_ns * 1e-9 + _begin(record) for _, _, record, m in found if m.start_ns is not None]
    starts = {campaign.runs[i].logs: m.start_ns for i, _, _, m in found}
    if len(times) == len(set(times)) == len(found) and len(set(starts.values())) == len(starts):
        found = [found[k] for k in sorted(range(len(found)), key=lambda k: times[k])]
    entries = []
    for order, (i, number, record, m) in enumerate(found):
        run, onset = campaign.runs[i], m.onset[number - 1] if m.onset else None
        tyre = str(run.values.get("tyre", ""))
        entries.append(Entry(names[i], number, float(order), group_of(run, keys), tyre, record, onset))
    return tuple(entries)


def _begin(record: Record) -> float:
    """Return when a record begins, from its log's first sample [s]; 0 where it has no place."""
    begin = record.start_s if isinstance(record, Stop) else record.lane[0] if record.lane else 0.0
    return begin if math.isfinite(begin) else 0.0


def evaluated(entries: Sequence[Entry], options: Options, failed: Mapping[str, str] | None = None) -> TradeTest:
    """Put runs into sets and judge them.

    Parameters
    ----------
    entries : sequence of Entry
        In the order in which they were driven.
    failed : mapping, optional
        Reasons of logs that gave nothing, by name.
    """
    groups: dict[Group, list[int]] = {}
    for i, e in enumerate(entries):
        groups.setdefault(e.group, []).append(i)
    judged = list(entries)
    for members in groups.values():
        _take_ratio_of_set(judged, members)
        _judge_by_set(judged, members, options.limits)
    test = TradeTest(options, tuple(judged), (), failed=dict(failed or {}))
    if options.kind == "curve":
        return _of_curves(test, groups)
    rows = [
        SetRow(g, tuple(m), _is_control(judged, m, options), _summary([judged[i] for i in m], options))
        for g, m in groups.items()
    ]
    return _indexed(test, rows, lambda blocks: _scalar_blocks(judged, blocks, options))


def _is_control(entries: Sequence[Entry], members: Sequence[int], options: Options) -> bool:
    return bool(options.control) and all(entries[i].tyre == options.control for i in members)


def _take_ratio_of_set(entries: list[Entry], members: Sequence[int]) -> None:
    """Give in place the free wheel's speed, at its ratio to v_x in their set, to runs that lack v_x or its delay.

    The set's other runs show that ratio without their delays. A bound by a late v_x is too low, so it holds. A run
    without v_x does not count if others have it and none shows the ratio; a set without any v_x has one radius.
    """
    runs = {i: f for i in members if isinstance(f := entries[i].found, StraightRun)}
    seen = [f for f in runs.values() if math.isfinite(f.speeds_other.get("v_15", math.nan))]
    for i, f in runs.items():
        lacks = NO_V_X.format(f.reference) in f.notes
        free = f.reference if lacks else f.other
        sure = [g.speeds["v_15"] / g.speeds_other["v_15"] for g in seen if math.isfinite(g.late) and g.other == free]
        if lacks and not sure and any(g.reference == "v_x" for g in runs.values()):
            entries[i] = replace(entries[i], found=replace(f, reasons=(*f.reasons, RADIUS_OPEN.format(free))))
        if not sure or not (lacks or (DELAY_OPEN in f.notes and f in seen)):
            continue
        ratio = float(np.median(sure))
        old, new = (NO_V_X, RADIUS_OF_SET) if lacks else (DELAY_OPEN, RATIO_OF_SET)
        notes = tuple(new.format(free) if n == old.format(free) else n for n in f.notes)
        speeds = {n: v * ratio for n, v in (f.speeds if lacks else f.speeds_other).items()}
        others, by, other = ({}, free, "") if lacks else (f.speeds, f.other, f.reference)
        bound = f.v_bound * (ratio if lacks else 1.0)
        own = replace(
            f, speeds=speeds, speeds_other=others, reference=by, other=other, notes=notes, v_bound=bound
        )  # fmt: skip
        entries[i] = replace(entries[i], found=own)


def _judge_by_set(entries: list[Entry], members: Sequence[int], limits: Limits) -> None:
    """Note in place which runs of a set have an acceleration, and which stops a coefficient, of their own."""
    found = [entries[i].found for i in members]
    values = [
        math.nan if not f.valid or isinstance(f, CurvePass) else f.bfc if isinstance(f, Stop) else f.a_x for f in found
    ]
    speeds = [f.v for f in found if isinstance(f, StraightRun)]
    wet = [f.wet for f in found if isinstance(f, StraightRun)]
    share = limits.straight.a_x_share if speeds else limits.braking.bfc_share
    expected = expected_in_set(values, speeds or None, wet or None)
    for i, value, own in zip(members, values, expected, strict=True):
        if not abs(value - own) > share * abs(own):
            continue
        far = f"more than {100 * share:g} % from the"
        stop = f"the coefficient is {value:.2f}, {far} set's median of {own:.2f}: did ABS control the brake?"
        run = f"the acceleration before {limits.straight.level} is {value:.2f} m/s², "
        run += f"{far} {own:.2f} m/s² of its set at this speed"
        entries[i] = replace(entries[i], of_set=(run if speeds else stop,))


def _summary(entries: Sequence[Entry], options: Options) -> Summary:
    limits = options.limits.set
    if options.kind == "braking":
        limits = replace(limits, cv=options.limits.braking.cv, runs=options.limits.braking.runs)
    good = [e for e in entries if e.valid]
    values = [e.value for e in good if not e.is_censored]
    return summarised(values, [e.value for e in good if e.is_censored], len(entries), limits)


def _estimate(summary: Summary) -> Estimate:
    """Return a set's mean with the variance that its interval stands for."""
    low, high = summary.ci
    if not math.isfinite(high - low):
        return Estimate(summary.mean, math.nan, 0.0)
    t = student_quantile(0.975, float(summary.dof))
    return Estimate(summary.mean, (0.5 * (high - low) / t) ** 2, float(summary.dof))


def _scalar_blocks(
    entries: Sequence[Entry], blocks: Sequence[Sequence[int]], options: Options
) -> tuple[list[Block], bool]:
    """Return the control's sets in a row, all with the spread of a run that they have in common."""
    found = [(b, _summary([entries[i] for i in b], options)) for b in blocks]
    known = [(b, s) for b, s in found if math.isfinite(s.mean)]
    dof = sum(s.dof for _, s in known)
    squares = sum(s.dof * s.sd**2 for _, s in known if s.dof)
    variance = squares / dof if dof else math.nan
    return [
        Block(
            float(np.mean([entries[i].order for i in b if entries[i].valid])),
            Estimate(s.mean, variance / s.valid, float(dof)), s.valid,
        )
        for b, s in known
    ], True  # fmt: skip


def _of_curves(test: TradeTest, groups: Mapping[Group, Sequence[int]]) -> TradeTest:
    options, limits = test.options, test.options.limits.curve

    def passes(members: Sequence[int]) -> list[CurvePass]:
        return [f for i in members if isinstance(f := test.entries[i].found, CurvePass)]

    own = [e.tyre == options.control and bool(options.control) for e in test.entries]
    in_a_row = blocks_of([e.order for e in test.entries], own)
    planned = [m for g, m in groups.items() if g != UNPLANNED]
    between = common_speeds([passes(m) for m in [*planned, *in_a_row]], limits)

    def summary(members: Sequence[int], over: Interval = between) -> CurveSet:
        logs = [test.entries[i].log for i in members if isinstance(test.entries[i].found, CurvePass)]
        return curve_set(passes(members), limits, result=options.result, between=over, logs=logs)

    rows = []
    for g, m in groups.items():
        over = common_speeds([passes(m)], limits) if g == UNPLANNED else between
        rows.append(SetRow(g, tuple(m), _is_control(test.entries, m, options), curve=summary(m, over)))

    def made(blocks: Sequence[Sequence[int]]) -> tuple[list[Block], bool]:
        sets = [(b, summary(b)) for b in blocks]
        return [
            Block(float(np.mean([test.entries[i].order for i in b if test.entries[i].valid])), s.estimate, s.valid)
            for b, s in sets if math.isfinite(s.result)
        ], False  # fmt: skip

    return _indexed(replace(test, between=between), rows, made)


def _indexed(test: TradeTest, rows: Sequence[SetRow], made: _Made) -> TradeTest:
    """Return the test with its sets, and their indices where there is a control."""
    options, entries = test.options, test.entries
    if not options.control:
        return replace(test, sets=tuple(rows))
    of_control = [e.tyre == options.control for e in entries]
    orders = [e.order for e in entries]
    found: dict[Group, ControlRow | None] = {}
    driven = {_rest(e.group) for e, own in zip(entries, of_control, strict=True) if own}
    every = driven.pop() if len(driven) == 1 else ()
    indexed = []
    for row in rows:
        rest = _rest(row.group)
        same = [own and _rest(e.group) == rest for own, e in zip(of_control, entries, strict=True)]
        own, key = (same, rest) if any(same) else (of_control, every)
        if key not in found:
            found[key] = _control_row(key, made(blocks_of(orders, own)), options)
        indexed.append(row if row.is_control else _with_index(row, found[key], entries, options, is_same=any(same)))
    controls = tuple(c for c in found.values() if c is not None)
    notes = [] if controls else [f"no valid run of the control {options.control}: no index"]
    if any(len(c.control.blocks) == 1 for c in controls):
        notes.append(f"{options.control} was driven once: its drift is not known, and the index holds it constant")
    drifts = [c.drift.change for c in controls if c.drift is not None]
    if drifts:
        most = 100.0 * max(drifts, key=abs)
        notes.append(f"the values of the sets hold the control's drift ({most:+.1f} %), the index does not")
    return replace(test, sets=tuple(indexed), controls=controls, notes=tuple(notes))


def _rest(group: Group) -> Group:
    return tuple(item for item in group if item[0] != "tyre")


def _control_row(rest: Group, made: tuple[list[Block], bool], options: Options) -> ControlRow | None:
    blocks, is_pooled = made
    if not blocks:
        return None
    control = Control(options.control, tuple(blocks), is_pooled=is_pooled)
    return ControlRow(rest, control, control.drift())


def _with_index(
    row: SetRow, control: ControlRow | None, entries: Sequence[Entry], options: Options, *, is_same: bool
) -> SetRow:
    if control is None:
        return replace(row, index_note=f"no valid run of {options.control}")
    orders = [entries[i].order for i in row.members if entries[i].valid]
    if not orders or not math.isfinite(row.estimate.value):
        return replace(row, index_note="no mean, so no index")
    own = sum(entries[i].tyre == options.control for i in row.members)
    if own:  # one would be compared with the other as if the runs that both share were independent
        held = f"{own} of {len(row.members)} runs are on {options.control} itself"
        return replace(row, index_note=f"{held}: no index. Try: sets by tyre")
    blocks = control.control.blocks
    notes = [] if is_same else [f"{options.control} was driven in another configuration"]
    if len(blocks) > 1 and (min(orders) < blocks[0].order or max(orders) > blocks[-1].order):
        notes.append(f"runs before the first or after the last set of {options.control}: compared with the nearest one")
    index = index_of(row.estimate, orders, control.control, of=options.index)
    return _with_grip(replace(row, index=index, index_note="; ".join(notes)), entries, options)


def _with_grip(row: SetRow, entries: Sequence[Entry], options: Options) -> SetRow:
    """Return a set of stops with its wet grip index, where coefficients and temperatures are known."""
    if options.coefficients is None or row.index is None or row.summary is None:
        return row
    known = [f.temperature for i in row.members if entries[i].valid and isinstance(f := entries[i].found, Stop)]
    if not known or not all(math.isfinite(t) for t in known):
        note = "no temperature of each stop, so no wet grip index"
        return replace(row, index_note="; ".join(filter(None, [row.index_note, note])))
    mean = sum(known) / len(known)
    found = wet_grip_index(row.summary.mean, row.index.control, mean, options.coefficients)
    return replace(row, temperature=mean, grip_index=found)
