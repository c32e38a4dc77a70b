"""Examine the files of one drive: each by itself, then the drive as `detect` would see it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from aqualog.align.freezes import StandWatch
from aqualog.align.load import load_signals, read_options
from aqualog.align.mapping import SignalMap
from aqualog.align.overview import find_mounting, overview
from aqualog.align.quantity import Quantity
from aqualog.align.timebase import without_copies
from aqualog.core.errors import AqualogError
from aqualog.core.records import FileFaults, Remark, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.registry import DETECTORS
from aqualog.detect.stream import detect_drive
from aqualog.doctor.channels import channel_findings
from aqualog.doctor.clocks import clock_findings, on_clock, speed_of
from aqualog.doctor.findings import Examination, FileState, Finding, Picture
from aqualog.doctor.pictures import pictures_of
from aqualog.io.clock_drift import drift_note
from aqualog.io.fingerprint import changed_files, state_of
from aqualog.io.open_log import open_log, read_readable, stored_in
from aqualog.io.reader import ReadOptions

__all__ = ["examine"]


def examine(
    paths: Sequence[Path], *, vehicle: Vehicle, signal_map: SignalMap, dbc: Sequence[Path] = (),
    report: Callable[[str], None] = lambda _: None,
) -> Examination:  # fmt: skip
    """Examine all content of the files of one drive.

    Parameters
    ----------
    paths : sequence of Path
        Files of one drive.
    vehicle : Vehicle
    signal_map : SignalMap
    dbc : sequence of Path
        Databases for raw CAN frames.
    report : callable
        Called with the name of each step.

    An unreadable file is a finding and no error. So is a drive without signals, and a file that changes.
    """
    before = state_of(paths)
    found = _examined(paths, vehicle, signal_map, dbc, report)
    advice = "run the command again when the file no longer changes"
    changed = [
        Finding("lost", "changed", Path(name).name, "", "changed while it was read", advice)
        for name in changed_files(paths, before)
    ]
    return replace(found, findings=(*found.findings, *changed))


def _examined(
    paths: Sequence[Path], vehicle: Vehicle, signal_map: SignalMap, dbc: Sequence[Path], report: Callable[[str], None]
) -> Examination:
    files, findings = [], []
    speeds: list[Quantity] = []
    pictures: list[Picture] = []
    for path in paths:
        report(f"reading {path.name}")
        state, own, speed, drawn = _file(path, read_options(signal_map, dbc), signal_map=signal_map, vehicle=vehicle)
        files.append(state)
        findings += own
        pictures += drawn
        speeds += [on_clock(speed, signal_map)] if speed is not None else []
    if any(f.level == "unreadable" for f in findings):
        return Examination(tuple(files), tuple(findings))
    report("looking at the drive")
    findings += clock_findings(speeds, {p.name: str(p) for p in paths}, signal_map.path, [str(d) for d in dbc])
    try:
        signals = load_signals(paths, vehicle=vehicle, signal_map=signal_map, dbc=dbc)
        result = detect_drive(signals, vehicle)
    except AqualogError as error:
        what = error.what + (f"; expected {error.expected}" if error.expected else "")
        whole = Finding("doubt", "no_signals", error.where, "", what, error.hint)
        none: tuple[tuple[str, tuple[str, ...]], ...] = tuple((d, ()) for d in DETECTORS)
        return Examination(tuple(files), (*findings, whole), (), none, tuple(pictures), signal_map.hint)
    frozen = {(o.file, o.channel) for o in signals.origins.values() if o.frozen}
    # what the drive leaves out as frozen need not be looked at
    findings = [f for f in findings if f.kind != "frozen" or (f.file, f.channel) not in frozen]
    said = {r.sentence for r in result.checks}
    notes = [n for n in (*signals.quality.notes, *result.notes) if n not in said]
    findings += [*_of_signals(findings, notes, frozen), *(_of_check(r, signals) for r in result.checks)]
    missing = tuple((u.detector, u.missing) for u in (*result.unavailable, *result.limited))
    lacking = {u.detector for u in result.unavailable}
    ready = tuple(d for d in DETECTORS if d not in lacking)
    return Examination(tuple(files), tuple(findings), ready, missing, tuple(pictures), signal_map.hint)


def _file(
    path: Path, options: ReadOptions, *, signal_map: SignalMap, vehicle: Vehicle
) -> tuple[FileState, list[Finding], Quantity | None, list[Picture]]:
    """Return the state of one file, its faults, the speed that it carries, and pictures of faulty channels."""
    size = sum(p.stat().st_size for p in (path.rglob("*") if path.is_dir() else [path]) if p.is_file())
    try:
        with open_log(path, options) as reader:
            channels, lost = read_readable(reader, list(reader.channels()))
            kind, faults = reader.format, reader.faults
    except AqualogError as error:
        # the line names the file itself
        what = error.what + (f"; expected {error.expected}" if error.expected else "")
        unreadable = Finding("unreadable", "unreadable", path.name, "", what, error.hint)
        return FileState(path.name, "", size), [unreadable], None, []
    channels = list(without_copies(dict(enumerate(channels)))[0].values())
    origin = min((int(c.t_ns.min()) for c in channels if c.t_ns.size), default=0)
    end = max((int(c.t_ns.max()) for c in channels if c.t_ns.size), default=0)
    found = [overview(c, origin_ns=origin) for c in channels]
    speed = speed_of(channels, signal_map=signal_map, vehicle=vehicle) if channels else None
    watch = StandWatch()  # without a speed in the file nobody knows when the car stood
    if speed is not None:
        watch.push(speed.t_ns, speed.x)
    samples = sum(c.values.size for c in channels)
    state = FileState(path.name, kind, size, len(channels), samples, 0.0, float(end - origin) * 1e-9)
    advice = "copy the file again: the copy may be damaged"
    findings = [Finding("lost", "lost_group", path.name, "", what, advice) for what in lost]
    standing = watch.finish()
    findings += [*_of_file(path.name, kind, faults), *channel_findings(found, channels, standing)]
    pictures = list(pictures_of(findings, channels, standing))
    findings += [
        Finding("doubt", "mounting", path.name, "", text.removeprefix(f"{path.name}:")) for text in find_mounting(found)
    ]
    if not channels:
        findings.append(Finding("doubt", "empty", path.name, "", "holds no channel of numbers"))
    return state, findings, speed, pictures


def _of_file(name: str, kind: str, faults: FileFaults) -> Iterator[Finding]:
    if faults.truncated:
        advice = "copy the file again; if the original is so, a logger that loses power needs a buffered supply"
        yield Finding("lost", "truncated", name, "", "is cut off or damaged: a part of it is missing", advice)
    if faults.lost_samples:
        what = f"{faults.lost_samples} {stored_in(kind)} could not be read"
        yield Finding("lost", "lost_samples", name, "", what, "copy the file again: the copy may be damaged",
                      faults.lost_samples)  # fmt: skip
    for drift in faults.drifts:
        advice = "check which of the two is right; `aqualog align` compares with another source"
        yield Finding("doubt", "drifts", name, "", drift_note(drift), advice, 1)
    if faults.unfinalised:
        what = "was not finalised by the logger; aqualog completes it while reading"
        yield Finding("mended", "unfinalised", name, "", what, "", 1)
    is_lossy = faults.truncated or faults.lost_samples > 0
    told = {drift_note(d) for d in faults.drifts}
    for note in faults.notes:
        if note.removeprefix(f"{name}: ") in told or (faults.unfinalised and "was not finalised" in note):
            continue
        yield Finding("lost" if is_lossy else "doubt", "note", name, "", note.removeprefix(f"{name}: "))


def _of_check(remark: Remark, signals: Signals) -> Finding:
    """Return what does not fit among the signals, with its file and channel where it is one signal."""
    origin = signals.origins.get(remark.signals[0]) if len(remark.signals) == 1 else None
    file, channel = ("", "") if origin is None else (origin.file, origin.channel)
    return Finding("doubt", remark.kind, file, channel, remark.what, remark.advice)


def _of_signals(
    before: Sequence[Finding], notes: Sequence[str], frozen: Collection[tuple[str, str]]
) -> Iterator[Finding]:
    """Yield notes on a drive beyond those of its files; `frozen` are file and channel of signals that stand still."""
    told = {f.what for f in before}
    for note in dict.fromkeys(notes):
        own = next(((f, c) for f, c in frozen if note.startswith(f"{f}:{c}: ") and "is frozen" in note), None)
        if own is not None:
            yield Finding("left_out", "frozen", *own, note.removeprefix(f"{own[0]}:{own[1]}: "))
        elif not any(what in note for what in told) and "time stamps:" not in note:
            yield Finding("left_out" if "left out" in note else "doubt", "signal", "", "", note)
