"""A tyre test while it is driven: a line for each run, what is still missing, and a page that renews itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aqualog.campaign.bins import Group
from aqualog.campaign.definition import Run
from aqualog.core.units import displayed_text
from aqualog.report.campaign.labels import group_text
from aqualog.report.page import report_page
from aqualog.report.sections import Figures, Headline, Lines, Report, Section
from aqualog.report.trade.sections import run_name, trade_report
from aqualog.report.values import counted
from aqualog.trade.entry import UNPLANNED, Entry
from aqualog.trade.evaluation import SetRow, TradeTest
from aqualog.trade.watching import Watched

__all__ = ["MARK", "damaged", "problems", "remarks", "run_lines", "set_sentence", "status", "watch_page"]

MARK = "a test while it is driven"
"""Stands in every page of a watch, so that a later one may take its place."""
_UNITS = {"straight": ("km/h", 1), "braking": ("", 3)}
_LEFT_OUT = ("limits-section", "unchecked", "failed")


def run_lines(watched: Watched, before: Watched | None = None) -> list[str]:
    """A line for each run of the new drive: its value, valid or why not, and the state of its set.

    A line, too, for each earlier run of which the set now says otherwise than `before`.
    """
    name = watched.new
    own = [e for e in watched.test.entries if e.log == name]
    lines = [f"{name}: {_value(e, watched.test)}; {_of_set(e, watched)}" for e in own]
    if name and not own and name not in watched.failed:
        lines.append(f"{name}: no run in it")
    was_valid = {(e.log, e.number): e.valid for e in before.test.entries} if before else {}
    for e in watched.test.entries:
        if e.log != name and was_valid.get((e.log, e.number), e.valid) != e.valid:
            lines.append(f"{run_name(e)}: now {_value(e, watched.test)}; {_of_set(e, watched)}")
    return [displayed_text(x) for x in lines]


def _value(e: Entry, test: TradeTest) -> str:
    unit, decimals = _UNITS.get(test.options.kind, ("", 1))
    shown = "" if e.value != e.value else f"{'> ' if e.is_censored else ''}{e.value:.{decimals}f} {unit}".strip()
    judged = "valid" if e.valid else f"not valid: {'; '.join(e.reasons)}"
    return f"{shown}, {judged}" if shown else judged


def _of_set(e: Entry, watched: Watched) -> str:
    row = next(s for s in watched.test.sets if s.group == e.group)
    return f"{group_text(row.group)}: {set_sentence(row, watched)}"


def set_sentence(row: SetRow, watched: Watched) -> str:
    """`valid: 4 of 6; CV 1.8 %; still missing: 2 planned runs`."""
    summary, curve, options = row.summary, row.curve, watched.test.options
    valid = summary.valid if summary is not None else curve.valid if curve is not None else 0
    parts = [f"valid: {valid} of {len(row.members)}"]
    if summary is not None and summary.cv == summary.cv:
        parts.append(f"CV {100.0 * summary.cv:.1f} %")
    limits = options.limits
    least = {"straight": limits.set.runs, "braking": limits.braking.runs, "curve": limits.curve.passes}[options.kind]
    planned = sum(_group(r, row.group) == row.group for r in watched.missing)
    missing = [counted(planned, "planned run")] if planned else []
    if valid + planned < least and row.group != UNPLANNED:
        missing.append(f"{int(least) - valid - planned} more valid ({least:g} are needed)")
    return "; ".join([*parts, *([f"still missing: {' and '.join(missing)}"] if missing else [])])


def _group(run: Run, like: Group) -> Group:
    return tuple((k, run.vehicle.stem if k == "vehicle" else run.values.get(k)) for k, _ in like)


def problems(watched: Watched) -> list[str]:
    """What needs somebody: damaged logs, copies, logs that no run names, a folder that is away."""
    return [*remarks(watched), *(f"{name}: {reason}" for name, reason in damaged(watched).items())]


def damaged(watched: Watched) -> dict[str, str]:
    """Why logs gave nothing, by name. Errors name the whole path; here the folder is known."""
    return {name: displayed_text(r.partition(f"{name}: ")[2] or r) for name, r in watched.failed.items()}


def remarks(watched: Watched) -> list[str]:
    """The other problems."""
    lines = [f"the folder is away: {watched.look.away}"] if watched.look.away else []
    lines += [f"{name}: the same log as {other}, counts once" for name, other in watched.same.items()]
    if watched.unplanned:
        lines.append(f"in no run of the campaign: {_named(watched.unplanned)}")
    return [displayed_text(x) for x in lines]


def status(watched: Watched) -> str:
    """All sets in one line."""
    test = watched.test
    sets = [f"{group_text(s.group)}: {set_sentence(s, watched)}" for s in test.sets]
    growing = f"being copied: {_named([p.name for p in watched.look.growing])}" if watched.look.growing else ""
    coming = f"still missing: {counted(len(watched.missing), 'planned run')}" if watched.missing else ""
    return displayed_text(" | ".join(x for x in (*sets, coming, growing) if x) or "no run yet")


def _named(names: Sequence[str], most: int = 5) -> str:
    more = f", and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def watch_page(watched: Watched, *, title: str, clock: str, refresh_s: float) -> str:
    """The page: sets, problems and runs, without figures; with `refresh_s` [s] the browser asks for it again and again.

    `clock` is the time of day as it is shown.
    """
    test, whole = watched.test, trade_report(watched.test)
    missing = [f"{group_text(g)}: {counted(n, 'run')}" for g, n in _planned(watched).items()]
    head = f"{counted(len(test.entries), 'run')}, {test.valid} valid" if test.entries else "No run yet"
    own = [
        Section("", [
            Headline(head, [(group_text(s.group), set_sentence(s, watched)) for s in test.sets], f"at {clock}"),
        ], "verdict", look="verdict open"),
        Section("Problems", [Lines(problems(watched), most=20)], "problems-section", look="problems"),
        Section("Being copied", [Lines([str(p.name) for p in watched.look.growing], most=5)], "growing"),
        Section("Still missing of the campaign", [Lines(missing, most=20)], "missing"),
    ]  # fmt: skip
    rest = [
        replace(s, parts=[p for p in s.parts if not isinstance(p, Figures)])
        for s in whole.sections
        if s.id not in ("verdict", *_LEFT_OUT)
    ]
    report = Report(whole.kind, MARK, [*own, *rest], whole.facts, {}, whole.footer, scripts=())
    return report_page(report, title=title, refresh_s=refresh_s)


def _planned(watched: Watched) -> dict[Group, int]:
    keys = watched.test.options.keys
    found: dict[Group, int] = {}
    for run in watched.missing:
        group = _group(run, tuple((k, None) for k in keys))
        found[group] = found.get(group, 0) + 1
    return found
