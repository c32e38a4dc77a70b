"""Fields of documents as data, with those that several documents have: reference and JSON Schema come from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from aqualog.core.judgement import EPISODE_KINDS, VERDICTS
from aqualog.core.notation import WHEELS
from aqualog.detect.registry import DETECTORS

__all__ = [
    "BIN", "CHECKS", "DRIVE_CHECKS", "EVENT", "EVIDENCE", "FAULTS", "FAULT_COUNTS", "HEAD", "JUDGEMENT", "LACKING",
    "PLACE_KEYS", "TERMS", "Document", "Field", "Kind", "anything", "by_name", "count", "flag", "interval", "mapping",
    "maybe", "number", "obj", "open_ci", "or_null", "paths", "rows", "schema", "several", "text", "with_ci",
]  # fmt: skip

Kind = Literal["number", "whole number", "text", "true or false", "interval", "object", "list", "by name", "any"]

_JSON = {"number": "number", "whole number": "integer", "text": "string", "true or false": "boolean"}
DRAFT = "https://json-schema.org/draft/2020-12/schema"


@dataclass(frozen=True, slots=True)
class Field:
    """One field.

    `can_be_null`: null says that the value is not available or does not apply; `is_always`: it stands in every
    document of the kind; `values` are all texts that occur. `fields` are those of an object, of each row of a list, or
    of each entry by name; `item` is what a list or a table by name holds, where that is no object. `keys` are patterns
    of keys that are the user's own, with values of any plain kind.
    """

    name: str
    kind: Kind
    meaning: str
    unit: str = ""
    can_be_null: bool = False
    is_always: bool = True
    values: tuple[str, ...] = ()
    fields: tuple[Field, ...] = ()
    item: Field | None = None
    keys: tuple[str, ...] = ()

    @property
    def type(self) -> str:
        """The kind in words."""
        if self.kind == "list" and self.item is not None:
            return f"list of {self.item.type}"
        if self.kind == "by name" and self.item is not None:
            return f"{self.item.type} by name"
        return {"list": "list of objects", "by name": "object by name", "interval": "[low, high]"}.get(
            self.kind, self.kind
        )


@dataclass(frozen=True, slots=True)
class Document:
    """A JSON document: which command prints it (or which file holds it), and its fields."""

    name: str
    source: str
    summary: str
    fields: tuple[Field, ...]
    files: tuple[str, ...] = ()

    @property
    def heading(self) -> str:
        """The source without the option, which all of them have."""
        return self.source.removesuffix(" --json")


def number(name: str, unit: str, meaning: str, *, null: bool = False) -> Field:
    """A number; integers are numbers too."""
    return Field(name, "number", meaning, unit, null)


def count(name: str, meaning: str, unit: str = "", *, null: bool = False) -> Field:
    """A whole number."""
    return Field(name, "whole number", meaning, unit, null)


def text(name: str, meaning: str, values: Sequence[str] = (), *, null: bool = False) -> Field:
    """A text, one of `values` if they are given."""
    return Field(name, "text", meaning, can_be_null=null, values=tuple(values))


def flag(name: str, meaning: str) -> Field:
    """True or false."""
    return Field(name, "true or false", meaning)


def interval(name: str, unit: str, meaning: str, *, null: bool = False) -> Field:
    """Two numbers, each null where that end is open; `null`: the whole may be null."""
    return Field(name, "interval", meaning, unit, null)


def with_ci(name: str, unit: str, meaning: str) -> tuple[Field, Field]:
    """A number, null where it is not available, and its interval `NAME_ci95`."""
    return number(name, unit, meaning, null=True), interval(f"{name}_ci95", unit, "95 % interval")


def open_ci(name: str, unit: str, meaning: str) -> tuple[Field, Field]:
    """As `with_ci`, where the interval may be null too."""
    ci = interval(f"{name}_ci95", unit, "95 % interval; null without one", null=True)
    return number(name, unit, meaning, null=True), ci


def obj(name: str, meaning: str, fields: Sequence[Field], *, null: bool = False, keys: Sequence[str] = ()) -> Field:
    """An object with these fields."""
    return Field(name, "object", meaning, can_be_null=null, fields=tuple(fields), keys=tuple(keys))


def rows(name: str, meaning: str, fields: Sequence[Field], *, null: bool = False, keys: Sequence[str] = ()) -> Field:
    """A list of objects."""
    return Field(name, "list", meaning, can_be_null=null, fields=tuple(fields), keys=tuple(keys))


def several(name: str, meaning: str, item: Field | None = None, *, null: bool = False) -> Field:
    """A list of plain values, of texts unless `item` is given."""
    return Field(name, "list", meaning, item.unit if item else "", null, item=item or text("", ""))


def by_name(name: str, meaning: str, fields: Sequence[Field]) -> Field:
    """Objects by a name that is data."""
    return Field(name, "by name", meaning, fields=tuple(fields))


def mapping(name: str, meaning: str, item: Field, *, null: bool = False) -> Field:
    """Plain values by a name that is data."""
    return Field(name, "by name", meaning, item.unit, null, item=item)


def anything(name: str, meaning: str) -> Field:
    """A value of any kind."""
    return Field(name, "any", meaning)


def maybe(*fields: Field) -> tuple[Field, ...]:
    """The same fields, which need not be there."""
    return tuple(replace(f, is_always=False) for f in fields)


def or_null(*fields: Field) -> tuple[Field, ...]:
    """The same fields, each of which may be null."""
    return tuple(replace(f, can_be_null=True) for f in fields)


HEAD = (
    count("schema_version", "version of the document's form; it grows only when a field changes its meaning or goes"),
    text("tool_version", "version of aqualog"),
)
"""The first fields of every document."""


def paths(fields: Sequence[Field], before: str = "") -> Iterator[tuple[str, Field]]:
    """Every field with its path: `events[].wheel`, `signals.NAME.unit`."""
    for field in fields:
        path = f"{before}{field.name}"
        yield path, field
        inner: Field | None = field
        while inner is not None:
            path += {"list": "[].", "by name": ".NAME."}.get(inner.kind, ".")
            yield from paths(inner.fields, path)
            path, inner = path.removesuffix("."), inner.item


def schema(document: Document) -> dict[str, Any]:
    """The JSON Schema, in which a field that is not in the table is an error."""
    return {"$schema": DRAFT, "title": document.source, "description": document.summary, **_object(document.fields, ())}


def _object(fields: Sequence[Field], keys: Sequence[str]) -> dict[str, Any]:
    made: dict[str, Any] = {
        "type": "object",
        "properties": {
            f.name: {**_plain(f), "description": f.meaning, **({"unit": f.unit} if f.unit else {})} for f in fields
        },
        "required": [f.name for f in fields if f.is_always],
        "additionalProperties": False,
    }
    if keys:
        made["patternProperties"] = {k: {"type": ["string", "number", "null"]} for k in keys}
    return made


def _plain(field: Field) -> dict[str, Any]:
    made = _kind(field)
    if field.can_be_null and "type" in made:
        made["type"] = [made["type"], "null"]
        if "enum" in made:
            made["enum"] = [*made["enum"], None]
    return made


def _kind(field: Field) -> dict[str, Any]:
    if field.kind in _JSON:
        return {"type": _JSON[field.kind], **({"enum": list(field.values)} if field.values else {})}
    if field.kind == "interval":
        return {"type": "array", "items": {"type": ["number", "null"]}, "minItems": 2, "maxItems": 2}
    if field.kind == "object":
        return _object(field.fields, field.keys)
    if field.kind == "any":
        return {}
    held = _plain(field.item) if field.item is not None else _object(field.fields, field.keys)
    if field.kind == "list":
        return {"type": "array", "items": held}
    return {"type": "object", "additionalProperties": held}


_WHEEL = text("wheel", "wheel; null where the event belongs to the car or a side", WHEELS, null=True)
_SIDE = text("side", "side; null where it does not apply", ("left", "right", "axle"), null=True)

_EVIDENCE = (
    *or_null(
        number("v_x", "m/s", "speed at the begin"),
        number("v_x_min", "m/s", "least speed"),
        number("v_x_max", "m/s", "greatest speed"),
        number("slip_min", "-", "least slip of the wheel; of the joint detector over all wheels"),
        number("slip_max", "-", "greatest slip; of the slip-slope drop the greatest amount"),
        number("a_w_delta_min", "m/s^2", "least acceleration of the wheel against the car (2.3)"),
        number("a_w_delta_max", "m/s^2", "greatest acceleration of the wheel against the car"),
        number("variance_max", "(m/s^2)^2", "greatest variance of that difference"),
        number("mu", "-", "traction coefficient of the wheel at the begin"),
        number("mu_min", "-", "least traction coefficient"),
        number("mu_lost", "-", "share of the event with a traction coefficient below 0.02"),
        number("delta_a_x_max", "m/s^2", "greatest resistance measure while not braking (2.9)"),
        number("margin_min", "m/s", "least distance to full aquaplaning"),
        number("contact_min", "-", "least contact share of the front axle that is expected"),
        number("force_residual_min", "N", "least residual of the tie-rod force"),
        number("force_residual_max", "N", "greatest residual of the tie-rod force"),
        number("torque_residual_min", "N*m", "least residual of the steering torque"),
        number("torque_residual_max", "N*m", "greatest residual of the steering torque"),
        number("slope_min", "-", "least slip slope"),
        number("slope_ref", "-", "dry slip slope that it is compared with"),
        number("term_spin_up", "-", "greatest term of the sum (2.11), 0 to 1: spin-up"),
        number("term_spin_down", "-", "the same: spin-down"),
        number("term_resistance", "-", "the same: resistance"),
        number("term_minor_spin_down", "-", "the same: variance of minor spin-downs"),
        number("term_slip_slope_drop", "-", "the same: lost slip slope"),
    ),
    flag("braking", "whether the wheel was braked at any time of the event"),
    flag("braking_at_start", "whether it was braked at the begin"),
    flag("from_steering_torque", "whether the steering torque stood in for tie rods"),
    flag("criterion_1", "whether criterion 1, spin-down, was met at any time"),
    flag("criterion_2", "the same: minor spin-down"),
    flag("criterion_3", "the same: spin-up"),
    flag("criterion_4", "the same: slip-slope drop"),
    flag("criterion_5", "the same: resistance alone"),
    flag("full", "whether a wheel went as far as full aquaplaning"),
    several("decided_by", "detectors that decided when the warning began"),
)

_CHECK = (
    text(
        "kind",
        "what is in doubt",
        ("sign", "exchange", "offset", "scale", "channel", "delay", "torque", "drivetrain", "resistance"),
    ),
    several("signals", "signals, or keys of the vehicle file"),
    text("what", "what does not fit"),
    text("advice", "what to do"),
    several("lines", "lines for [signals] of the map; empty where no line helps"),
    *with_ci("value", "SI unit of the signal", "what was measured"),
)
_CHECKED = "what does not fit among the signals, and what to change; the notes say the same"
CHECKS = rows("checks", _CHECKED, _CHECK)
DRIVE_CHECKS = rows("checks", _CHECKED, (
    text("drive", "name of the drive"),
    several("logs", "drives that have it; of a campaign each remark is there once, with all its logs"),
    *_CHECK,
))  # fmt: skip

JUDGEMENT = (
    text("verdict", "whether there was aquaplaning; only the joint detectors decide", tuple(VERDICTS)),
    several("missing", "what the joint detectors lack where the verdict is `cannot_be_judged`, else empty"),
    several("ran", "detectors that ran"),
    number("judged_s", "s", "time in which the joint detectors had all of their signals"),
    rows("episodes", "detections that belong together, by begin", (
        text("kind", "; ".join(f"{kind}: {means}" for kind, means in EPISODE_KINDS.items()), tuple(EPISODE_KINDS)),
        number("start_s", "s", "estimate of the begin, from the log's first sample"),
        number("end_s", "s", "estimate of the end"),
        several("wheels", "wheels that lost speed or grip, the worst first", text("", "", WHEELS)),
        text("axle", "axle of all of these wheels; null where both", ("f", "r"), null=True),
        text("side", "side of all of these wheels; null where both", ("left", "right"), null=True),
        text("severity", "partial or full", ("partial", "full")),
        number("v_x_kmh", "km/h", "mean speed", null=True),
        number("v_full_kmh", "km/h", "speed at which the first wheel was lost; null where none was", null=True),
        several("decided_by", "detectors that decided"),
        number("delta_a_x_max", "m/s^2", "greatest resistance measure (2.9)", null=True),
        number("slip_min", "-", "least slip", null=True),
        number("slip_max", "-", "greatest slip", null=True),
        number("distance_m", "m", "way", null=True),
        several("events", "places of its detections in `events`, from 0", count("", "")),
    )),
)  # fmt: skip
"""Fields of the verdict on a drive."""

EVENT = (
    text("detector", "which detector", DETECTORS),
    _WHEEL,
    _SIDE,
    number("start_s", "s", "begin, from the log's first sample"),
    number("end_s", "s", "end"),
    text("severity", "full: a wheel has lost a quarter of its speed, or a spinning one transmits less than 0.02",
         ("partial", "full")),
    number("peak", "unit of the statistic", "greatest value of the detector's statistic", null=True),
    number("threshold", "unit of the statistic", "threshold of that statistic"),
)  # fmt: skip
EVIDENCE = maybe(*_EVIDENCE)
"""What an event of any detector may have as evidence."""

LACKING = (
    text("detector", "which detector", DETECTORS),
    several("missing", "signals that it lacks, or `vehicle.KEY`, or a rate"),
)

TERMS = (
    text("effect", "effect, see the page of effects"),
    text("where", "its place; null for the whole car", null=True),
    mapping("parameters", "values, SI", number("", "SI", "", null=True)),
    *maybe(several("knots", "points of a function", several("", "", number("", "SI", "", null=True)))),
)
"""Terms of a model."""

FAULT_COUNTS = (
    count("duplicates", "samples with the time stamp of another one"),
    count("back_steps", "time stamps that go back a little; sorted"),
    count("resets", "clocks that begin anew; what follows goes on 1 s later"),
    count("wraps", "counters that wrap; unwrapped"),
    count("pauses", "pauses of the logger; they stay gaps"),
    count("drifts", "clocks in one file that run apart"),
    count("strays", "samples with a time stamp from elsewhere; left out"),
)
FAULTS = (*FAULT_COUNTS, mapping("first_s", "place of the first fault of each kind, from the source's first sample",
                                 number("", "s", "", null=True)))  # fmt: skip

PLACE_KEYS = (
    "^(tyre|wear|manoeuvre|vehicle|tread_depth_mm|pressure_(front|rear)_bar|water_depth(_left)?_mm"
    "|load_(front|rear)_kg|lane_(start|end)_s)$",
    "^x_",
)
"""Grouping keys of a row: keys of the campaign's runs."""

BIN = (
    text("road", "wet or dry; both where they are taken together", ("wet", "dry", "both")),
    number("v_low_kmh", "km/h", "lower end of the bin of speed", null=True),
    number("v_high_kmh", "km/h", "upper end", null=True),
    number("v_mean_kmh", "km/h", "mean speed of the samples", null=True),
    count("runs", "runs in the row: the unit of the interval"),
    count("samples", "samples of 0.1 s"),
)
