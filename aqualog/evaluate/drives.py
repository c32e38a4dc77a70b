"""Labelled drives, from logs or made in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from aqualog.align.load import load_signals, read_options
from aqualog.align.mapping import SignalMap
from aqualog.core.errors import SignalError
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.detector import JointCusumParams
from aqualog.evaluate.labels import TRUTH_STEMS, Label, Labels, Span, after, spans_of, truth_labels, until
from aqualog.evaluate.logged import Heard, LoggedRival, heard_in
from aqualog.io.open_log import DriveLog
from aqualog.io.reader import ReadOptions

__all__ = ["Drive", "LogSource", "Source", "labels_in"]

_TRUTH = (*(f"{stem}_{w}" for stem in TRUTH_STEMS for w in WHEELS), "true_v_x")


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive with its labels.

    `groups` is its configuration: key -> value as text; `joint` the settings of joint detector 2. `heard`: what rivals
    in the log say, by name.
    """

    name: str
    signals: Signals
    vehicle: Vehicle
    labels: Labels
    groups: Mapping[str, str] = field(default_factory=dict)
    joint: JointCusumParams = field(default_factory=JointCusumParams)
    heard: Mapping[str, Heard] = field(default_factory=dict)

    def load(self) -> Drive:
        """Return itself: a drive in memory is a source of drives too."""
        return self


class Source(Protocol):
    """Source of a drive; it may be loaded more than once."""

    @property
    def name(self) -> str:
        """Name of the drive."""

    @property
    def groups(self) -> Mapping[str, str]:
        """Its configuration."""

    def load(self) -> Drive:
        """The drive; raises AqualogError or OSError."""


@dataclass(frozen=True, slots=True)
class LogSource:
    """A drive in files. Labels: those given, else the log's simulated truth, else `on_water`, else the lane's times."""

    name: str
    paths: tuple[Path, ...]
    vehicle: Vehicle
    signal_map: SignalMap = field(default_factory=SignalMap)
    dbc: tuple[Path, ...] = ()
    labels: tuple[Label, ...] | None = None
    lanes: tuple[Span, ...] = ()
    groups: Mapping[str, str] = field(default_factory=dict)
    joint: JointCusumParams = field(default_factory=JointCusumParams)
    rivals: tuple[LoggedRival, ...] = ()

    def load(self) -> Drive:
        """Read the drive.

        Raises
        ------
        LogError, SignalError, ConfigError
            Also if the drive has no labels of any kind.
        """
        signals = load_signals(self.paths, vehicle=self.vehicle, signal_map=self.signal_map, dbc=self.dbc)
        signals = _told(signals, self.labels or ())
        options = read_options(self.signal_map, self.dbc)
        heard = heard_in(self.paths, options, self.signal_map, signals, self.rivals)
        return Drive(self.name, signals, self.vehicle, self._labels(signals), self.groups, self.joint, heard)

    def _labels(self, signals: Signals) -> Labels:
        if self.labels is not None:
            inside = until(self.labels, signals.frame.height * signals.dt)
            return Labels(inside, frozenset(("full", "partial", "water")), "labels file")
        found = _truth_of(self.paths, read_options(self.signal_map, self.dbc), signals) or labels_in(signals)
        if found is not None:
            return found
        if self.lanes:
            wet = tuple(Label(a, b, "water") for a, b in self.lanes)
            return Labels(wet, frozenset(("water",)), "times of the lane")
        raise SignalError(
            "no label says when there was water",
            where=self.name,
            expected="simulated truth, on_water, lane_start_s and lane_end_s in the campaign, or a labels file",
            hint="--labels FILE; one with a heading and no line says that the road was dry",
        )


def _told(signals: Signals, labels: Sequence[Label]) -> Signals:
    """Return the drive, with a note on labels that do not end before it does."""
    end = signals.frame.height * signals.dt
    late = dict.fromkeys(x.start_s for x in after(labels, end))
    cut = dict.fromkeys(x.end_s for x in labels if x.start_s < end < x.end_s - signals.dt)
    notes = [f"the label from {t:g} s begins after the log, which ends at {end:g} s; left out" for t in late]
    notes += [f"the label to {t:g} s is cut where the log ends, at {end:g} s" for t in cut]
    if not notes:
        return signals
    quality = signals.quality
    return replace(signals, quality=replace(quality, notes=(*quality.notes, *notes)))


def labels_in(signals: Signals) -> Labels | None:
    """Return labels from the columns of a drive: the simulated truth, else `on_water`, else None."""
    names = (*_TRUTH, "on_water", "v_x")
    columns = {n: signals.array(n) for n in names if n in signals.frame.columns}
    t = signals.array("t")
    labels = truth_labels(t, columns)
    if labels is not None or "on_water" not in columns:
        return labels
    wet = spans_of(t, np.nan_to_num(columns["on_water"]) > 0.5)
    return Labels(tuple(Label(a, b, "water") for a, b in wet), frozenset(("water",)), "on_water")


def _truth_of(paths: Sequence[Path], options: ReadOptions, signals: Signals) -> Labels | None:
    """Return labels from the truth channels of simulated logs, on the clock of the truth itself."""
    with DriveLog(paths, options) as log:
        found = {c.name: c for c in log.channels() if c.name in _TRUTH}
        if not any(n.startswith("true_contact") for n in found):
            return None
        channels = log.read(found.values())
    columns = {n: channels[c.file, c.path] for n, c in found.items()}
    contact = next(c for n, c in columns.items() if n.startswith("true_contact"))
    # a log without absolute time begins with its truth, which no sensor delays
    start_ns = signals.start_ns if contact.absolute and signals.start_ns is not None else int(contact.t_ns[0])
    t: FloatArray = (contact.t_ns - start_ns).astype(np.float64) * 1e-9
    values: dict[str, FloatArray] = {n: c.values for n, c in columns.items() if c.values.size == t.size}
    if "on_water" in signals.frame.columns:
        wet = np.asarray(np.nan_to_num(signals.array("on_water")), dtype=np.float64)
        values["on_water"] = np.asarray(np.interp(t, signals.array("t"), wet), dtype=np.float64)
    return truth_labels(t, values)
