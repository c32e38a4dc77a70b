"""Columns of the tables that aqualog writes."""

from __future__ import annotations

from dataclasses import dataclass

from aqualog.book.documents.fields import FAULT_COUNTS, Field, count, flag, number, text
from aqualog.config.campaign import RUN_KEYS

__all__ = ["TABLES", "Table"]


@dataclass(frozen=True, slots=True)
class Table:
    """A table: its file, who writes it, and its columns. `WHEEL` in a name stands for each wheel."""

    name: str
    source: str
    summary: str
    columns: tuple[Field, ...]


def _ends(low: str, high: str, unit: str, least: str, greatest: str = "upper end") -> tuple[Field, Field]:
    return number(low, unit, least), number(high, unit, greatest)


_RUNS = Table(
    "runs.parquet",
    "`aqualog batch` into the store",
    "A row per run of the campaign.",
    (
        count("run", "index from 0, in the order of the campaign file"),
        text("name", "log, or logs with ; between them"),
        text("key", "name of its files in the store"),
        text("state", "done, failed or to do"),
        text("reason", "why it failed"),
        text("vehicle", "vehicle file"),
        *(text(n, "key of the run") for n in ("tyre", "wear", "manoeuvre")),
        *(number(k.name, k.unit, "key of the run") for k in RUN_KEYS.values() if k.unit),
        text("x_...", "keys of your own"),
        count("start_ns", "absolute time of the first sample since 1970", "ns"),
        number("duration_s", "s", "length"),
        number("distance_m", "m", "way"),
        *_ends("v_min_kmh", "v_max_kmh", "km/h", "least speed", "greatest speed"),
        number("sample_rate_hz", "Hz", "rate of the common time grid"),
        text("slip_against", "what the slip is measured against"),
        text("traction", "source of the traction"),
        text("verdict", "aquaplaning, none or cannot_be_judged"),
        text("missing", "what the joint detectors lack"),
        count("episodes", "episodes of aquaplaning; null where they cannot be judged"),
        count("full_episodes", "those of them with full aquaplaning"),
        count("events_DETECTOR", "events of each detector; null where it could not run"),
        text("unavailable", "detectors that could not run"),
        flag("truncated", "whether a file is cut off or damaged: a part is missing"),
        count("dropped_samples", "samples that were left out"),
        count("time_jumps", "jumps of the time"),
        count("lost_in_files", "samples that the reader lost"),
        *FAULT_COUNTS,
        text("notes", "sentences on the log"),
    ),
)
_EVENTS = Table(
    "events.parquet",
    "`aqualog batch` into the store",
    "A row per event of all runs.",
    (
        count("run", "index of the run"),
        text("name", "log"),
        text("key", "name of its files in the store"),
        text("detector", "detector"),
        text("wheel", "wheel; null where it does not apply"),
        text("side", "side; null where it does not apply"),
        *_ends("start_s", "end_s", "s", "begin, from the log's first sample", "end"),
        text("severity", "partial or full"),
        number("peak", "unit of the statistic", "greatest value of the statistic"),
        number("threshold", "unit of the statistic", "its threshold"),
        number("v_x", "m/s", "speed at the begin"),
        number("slip_min", "-", "least slip"),
        text("decided_by", "detectors that decided, of a joint one"),
    ),
)
_EPISODES = Table(
    "episodes.parquet",
    "`aqualog batch` into the store",
    "A row per episode of all runs: detections that belong together.",
    (
        count("run", "index of the run"),
        text("name", "log"),
        text("key", "name of its files in the store"),
        text("kind", "aquaplaning, suspected, other_surface, wheel_lock or single_detector"),
        *_ends("start_s", "end_s", "s", "estimate of the begin, from the log's first sample", "estimate of the end"),
        text("wheels", "wheels that lost speed or grip, the worst first"),
        text("axle", "axle of all of these wheels; null where both"),
        text("side", "side of all of these wheels; null where both"),
        text("severity", "partial or full"),
        number("v_x_kmh", "km/h", "mean speed"),
        text("decided_by", "detectors that decided"),
        number("delta_a_x_max", "m/s^2", "greatest resistance measure (2.9)"),
        number("slip_min", "-", "least slip"),
        number("slip_max", "-", "greatest slip"),
        number("distance_m", "m", "way"),
        count("events", "detections"),
    ),
)
_SAMPLES = Table(
    "samples/KEY.parquet",
    "`aqualog batch` into the store",
    "Ten samples a second of one drive: what the regressions need.",
    (
        number("t", "s", "middle of the step, from the log's first sample"),
        number("v_x", "m/s", "speed"),
        number("a_x", "m/s^2", "acceleration from the speed"),
        number("a_over_v", "1/s", "acceleration over speed"),
        number("delta_a_x", "m/s^2", "resistance measure (2.9), mean over the step, with no offset taken off"),
        number("on_water", "-", "label of the log"),
        *_ends("water_depth_left", "water_depth_right", "m", "measured depth", "measured depth"),
        number("slip_WHEEL", "-", "slip (3.13)"),
        number("slip_min_WHEEL", "-", "least deviation of the wheel from the car"),
        number("slip_max_WHEEL", "-", "greatest deviation"),
        number("mu_WHEEL", "-", "traction coefficient"),
        flag("spin_WHEEL", "whether a spin-down or spin-up is going on"),
        flag("minor_WHEEL", "whether a minor spin-down is going on"),
        number("v_full", "m/s", "speed of full aquaplaning that the margin expects"),
        *_ends("v_full_low", "v_full_high", "m/s", "low end of its 90 % interval", "high end of its 90 % interval"),
        count("reason", "0: the sample counts for the regression; else why it does not"),
    ),
)
_SIGNALS = Table(
    "signals.parquet",
    "`aqualog detect -o DIR`; `--write FILE` has the same and all features as channels",
    "Signals, statistics, detection bits and the distance to full aquaplaning of one drive on the common time grid.",
    (
        number("t", "s", "time from the log's first sample"),
        number("SIGNAL", "SI", "every signal of the drive, see the page of signals"),
        number(
            "aquaplaning_margin",
            "m/s",
            "distance to full aquaplaning; with `_low`, `_high` its 90 % interval, "
            "with `_q25`, `_q75` its 50 % interval",
        ),
        number("DETECTOR_PLACE", "unit of the statistic", "statistic of a detector at a wheel or side"),
        number("DETECTOR_PLACE_bit", "-", "1 while the detector is active, else 0"),
    ),
)
_SLOPES = Table(
    "slip_slope.csv",
    "`aqualog slip-slope -o DIR`",
    "A line per place over the whole drive, and one per part of it.",
    (
        text("place", "side or axle"),
        *_ends("start_s", "end_s", "s", "begin", "end"),
        number("used_s", "s", "time used"),
        count("samples", "samples"),
        number("slope", "-", "slip slope C_s / F_z"),
        *_ends("slope_low", "slope_high", "-", "lower end of the 95 % interval"),
        number("offset", "-", "offset of the slip"),
        *_ends("offset_low", "offset_high", "-", "lower end of the 95 % interval"),
        text("reason", "why there is no slope"),
    ),
)
_CLAIMS = Table(
    "claims.csv",
    "`aqualog reproduce -o DIR`",
    "A line per check of a claim.",
    (
        text("claim", "C1 to C118"),
        text("where", "place in the thesis"),
        text("kind", "what kind of claim"),
        text("statement", "what the thesis says"),
        text("verdict", "verdict of the claim"),
        text("part", "part of the claim"),
        text("criterion", "what must come out"),
        text("found", "what came out"),
        number("value", "unit", "the same as a number"),
        *_ends("low", "high", "unit", "lower end of the interval"),
        text("unit", "unit"),
        text("check_verdict", "verdict of the check"),
        text("reason", "why it differs"),
        text("source", "drives and seeds, or the figure"),
    ),
)
_PLACE = (text("KEY", "grouping keys of `--by`"), text("place", "wheel or side; of the resistance empty"))
_BIN = (
    *_ends("v_low_kmh", "v_high_kmh", "km/h", "lower end of the bin of speed"),
    number("v_mean_kmh", "km/h", "mean speed"),
)
_REGRESSION = (
    *_ends("ci95_low", "ci95_high", "", "lower end of the 95 % interval"),
    count("runs", "runs"),
    count("samples", "samples of 0.1 s"),
    flag("reliable", "see the document of the command"),
    number("expected", "", "what the model gives"),
    number("dry", "", "the same off the water"),
    *_ends("dry_ci95_low", "dry_ci95_high", "", "lower end of its interval"),
    text("reason", "why there is no value"),
)
_REPORT = "`aqualog report -o DIR`"
_REPORT_SLOPE = Table(
    "data/slip_slope.csv",
    _REPORT,
    "Slip slope over speed, as on the page.",
    (*_PLACE, *_BIN, number("slope", "-", "slip slope"), *_REGRESSION),
)
_REPORT_RESISTANCE = Table(
    "data/resistance.csv",
    _REPORT,
    "Resistance over speed, as on the page.",
    (*_PLACE, *_BIN, number("delta_a_x", "m/s^2", "mean resistance measure"), *_REGRESSION),
)
_REPORT_SPEED = Table(
    "data/full_aquaplaning.csv",
    _REPORT,
    "Speeds of full aquaplaning, as on the page.",
    (
        *_PLACE,
        text("way", "how it was found"),
        number("v_kmh", "km/h", "speed"),
        *_ends("ci95_low_kmh", "ci95_high_kmh", "km/h", "lower end of the 95 % interval"),
        text("rests_on", "what it rests on"),
        text("reason", "why there is no value"),
    ),
)
_REPORT_RUNS = Table(
    "data/runs.csv",
    _REPORT,
    "All runs, as on the page.",
    (
        count("run", "number from 1"),
        text("log", "log"),
        text("page", "page of the run"),
        text("state", "done, failed or to do"),
        text("reason", "why it failed"),
        text("vehicle", "vehicle file"),
        text("KEY", "every key that the runs have"),
        number("duration_s", "s", "length"),
        number("lane_v_kmh", "km/h", "mean speed on the water"),
        number("lane_s", "s", "time on the water"),
        number("dry_km", "km", "way off the water"),
        text("verdict", "aquaplaning, none or cannot_be_judged"),
        text("missing", "what the joint detectors lack"),
        count("episodes", "episodes of aquaplaning"),
        count("events_DETECTOR", "events of each detector"),
    ),
)

TABLES = (
    _SIGNALS, _SLOPES, _RUNS, _EVENTS, _EPISODES, _SAMPLES, _REPORT_RUNS, _REPORT_SLOPE, _REPORT_RESISTANCE,
    _REPORT_SPEED, _CLAIMS,
)  # fmt: skip
