"""A validation for a reader: the JSON document, sections of text and page, and its sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan
from typing import Any

from aqualog import __version__
from aqualog.report.sections import Code, Figures, Headline, Line, Lines, Para, Report, Section, Table
from aqualog.report.validation_figures import validation_figures
from aqualog.report.values import KMH, counted, fields_of, number, percent, plain, pretty_unit, short
from aqualog.validate.records import ABSCISSAE, SIGNALS, Limit, Plot, Spread, Validity, Worst
from aqualog.validate.spread import LEAST_DRIVES

__all__ = ["METHODS", "validation_document", "validation_report"]

METHODS = {"boundary": "ISO 19364", "18571": "ISO/TS 18571"}
_OTHER = "By the method of {}, on another test"
_WHERE_FROM = (
    "The standards validate a simulation on tests of their own: a steady circle, a sine with dwell, a crash. None is "
    "longitudinal, none wet. The tolerances are {}, none of a standard's."
)
_NO_SPREAD = Spread(nan, None, nan, nan, nan)
_FEWER = (
    "Fewer repetitions make wider boundaries, within which a simulation lies more easily: where drives alone differ, t "
    "is 4.3 with three drives, 2.6 with six and 2.0 with many. The method asks for three at the least."
)
_RATING = "A rating stands beside the boundaries. It says how alike two curves are, and names no cause."


def validation_document(
    found: Validity, *, method: str, vehicle: str, logs: Sequence[str], notes: Sequence[str],
    why: Mapping[str, Any] | None,
) -> dict[str, Any]:  # fmt: skip
    """The JSON document of `validate`. `why` is the document of a diagnosis, if one was made. NaN becomes null."""
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "vehicle": vehicle,
        "logs": list(logs),
        "drives": [
            {"name": t.name, "duration_s": plain(t.duration_s), "judged_s": plain(float(t.judged.sum()) * t.step)}
            for t in found.traces
        ],
        "method": method,
        "sentence": _sentence(found, method, vehicle),
        "within_share": plain(found.share),
        "rating": plain(found.total),
        "duration_s": plain(found.duration_s),
        "judged_s": plain(found.seconds),
        "agreed_share": found.plan.agreed,
        "worst": _worst(found.worst),
        "limits": [
            {"condition": x.condition, "valid": x.is_valid, "not_above_kmh": plain(KMH * x.above),
             "driven_kmh": plain([KMH * x.low, KMH * x.high]), **fields_of(x, within_share="share", judged_s="seconds")}
            for x in found.limits
        ],
        "plots": [
            {"y": j.plot.y, "x": j.plot.x, "unit": SIGNALS[j.plot.y].unit, "x_unit": ABSCISSAE[j.plot.x].unit,
             **fields_of(j, "points", "within", within_share="share", judged_s="seconds"),
             **fields_of(j.plot.tolerance, "x_offset", "x_gain", "y_offset", "y_gain"),
             "tolerance_from": _source(found, j.plot), "worst": _worst(j.worst),
             **fields_of(found.spread.get(j.plot.y, _NO_SPREAD), *_NO_SPREAD._fields[1:])}
            for j in found.judged
        ],
        "ratings": [
            fields_of(
                r, "signal", "corridor", "phase", "magnitude", "slope", "delay_s", rating="total", judged_s="seconds"
            )
            for r in found.rated
        ],
        "diagnosis": None if why is None else {
            **{k: why[k] for k in ("verdict", "sentence", "caution")},
            "causes": [{k: c[k] for k in ("effect", "where", "key", "sentence", "probability")} for c in why["causes"]],
            "next": (why["next_manoeuvre"] or {"sentence": None})["sentence"],
        },
        "notes": list(notes),
    }  # fmt: skip


def _worst(w: Worst | None) -> dict[str, Any] | None:
    if w is None:
        return None
    return {**fields_of(w, "drive", "signal", "by", "start_s", "end_s"), "unit": SIGNALS[w.signal].unit}


def _source(found: Validity, plot: Plot) -> str:
    if plot.y in found.spread:
        return "repetitions"
    return "file" if plot.y in found.plan.given else "built in"


# --- sentences -------------------------------------------------------------------------------------------------------


def _sentence(found: Validity, method: str, vehicle: str) -> str:
    head = f"{_OTHER.format(METHODS[method])}: the simulation of {vehicle} is"
    bad = [_limit_text(x) for x in found.limits if not x.is_valid]
    verdict = " and ".join(bad) or "valid at all speeds driven"
    if method == "boundary":
        said = [f"{head} {verdict}", f"It is within the boundaries {percent(found.share)} of the time"]
        said[-1] += f" ({percent(found.plan.agreed)} asked for)"
        if found.worst is not None:
            said.append(f"Farthest beyond: {_worst_text(found.worst, many=len(found.traces) > 1)}")
    elif found.rated:
        least = min(found.rated, key=lambda r: r.total)
        said = [f"{head} rated {found.total:.2f} over {counted(len(found.rated), 'signal')}"]
        said[-1] += f", lowest {least.signal} with {least.total:.2f}" if len(found.rated) > 1 else ""
        said.append(f"By the boundaries of {METHODS['boundary']} it is {verdict}")
    else:
        said = [f"{head} not rated, because no signal moved enough"]
    return ". ".join((*said, *_basis(found))) + "."


def _basis(found: Validity) -> list[str]:
    """What the tolerances stand on, where it is not the repetitions that the method asks for."""
    if found.spread:
        return []
    drives = len(found.traces)
    own = "the plan's" if found.plan.given else "built in"
    if drives >= LEAST_DRIVES:
        return [f"The tolerances are {own}, since the drives do not repeat each other (length, speed over time)"]
    asked = f"{counted(drives, 'drive')} of the {LEAST_DRIVES} that the method asks for"
    return [f"The tolerances are {own}: {asked}, no basis for a release"]


def _worst_text(w: Worst, *, many: bool) -> str:
    where = f" of {w.drive}" if many else ""
    unit = pretty_unit(SIGNALS[w.signal].unit)
    return f"{w.signal} by {short(abs(w.by), 2)} {unit} at {w.start_s:.1f}-{w.end_s:.1f} s{where}"


def _limit_text(x: Limit) -> str:
    on = "on dry road" if x.condition == "dry" else x.condition
    low, high, above = (KMH * v for v in (x.low, x.high, x.above))
    if above == low:
        return f"not valid {on} ({low:.0f} to {high:.0f} km/h)"
    return f"not valid above {above:.0f} km/h {on}"


# --- sections --------------------------------------------------------------------------------------------------------

_NO_CAUSE = "The diagnosis finds no cause: no single effect of the library explains what lies beyond the boundaries."
_PLOTS = ("Signal", "Over", ("Within the boundaries", "within"), "Farthest beyond", "Tolerance", "From")
_RATINGS = (
    "Signal", "Rating", "Corridor", "Phase", "Magnitude", "Slope", ("Simulation late [s]", "late [s]"), "Time [s]",
)  # fmt: skip
_LIMITS = ("Condition", ("Driven [km/h]", "km/h"), "Valid", ("Within the boundaries", "within"), "Time [s]")


def validation_report(found: Validity, document: Mapping[str, Any]) -> Report:
    """The sentence, why, then plots, limits and ratings."""
    d, plots = document, validation_figures(found)
    over_time = [n for n in plots if n.startswith("time-")]
    crossed = [n for n in plots if n not in over_time]
    sources = {r["tolerance_from"] for r in d["plots"]}
    told = " and ".join(_SOURCES[s] for s in _SOURCES if s in sources)
    ratings = Section("Ratings by the method of ISO/TS 18571", [
        Table(_RATINGS, [
            (r.signal, *(number(x, 2) for x in (r.total, r.corridor, r.phase, r.magnitude, r.slope, r.delay_s)),
             f"{r.seconds:.0f}") for r in found.rated
        ], "ratings"),
        Para(_RATING, where="everywhere"),
    ], "ratings-section")  # fmt: skip
    repeated = (Lines(_repeated(d)), Para(_FEWER, where="everywhere")) if found.spread else ()
    boundaries = Section("Boundaries by the method of ISO 19364", [
        Table(_PLOTS, [_plot_row(found, r) for r in d["plots"]], "plots", (0, 1, 3, 4, 5)),
        *repeated,
        Figures(over_time),
    ], "plots-section")  # fmt: skip
    first = (boundaries, ratings) if d["method"] == "boundary" else (ratings, boundaries)
    sections = [
        Section("", [Headline(d["sentence"], [], "validity")], "verdict", look="verdict open"),
        *_why(d),
        Section("Where it is valid", [
            Table(_LIMITS, [_limit_row(x) for x in found.limits], "limits", (0, 2)),
        ], "limits-section"),
        *first,
        Section("Cross plots", [Figures(crossed)], "cross-section",
                "means over bins of all drives; lines: top and bottom", fold="over what each signal depends on"),
        Section("Notes", [Lines(d["notes"], most=1000)], "notes", look="problems", where="page"),
        Section("", [Para(_WHERE_FROM.format(told), where="text")]),
    ]  # fmt: skip
    return Report(
        "validity", "the simulation against measured drives", sections, _facts(d), plots, _WHERE_FROM.format(told)
    )


_SOURCES = {
    "repetitions": "the spread of the repeated drives",
    "file": "those of the boundaries file",
    "built in": "aqualog's own",
}


def _why(d: Mapping[str, Any]) -> list[Section]:
    why = d["diagnosis"]
    if why is None:
        return [Section("Why", [
            Lines(["Not asked: --no-why leaves the diagnosis out. This asks, with the same --signals and --dbc:"]),
            Code(f"aqualog diagnose {' '.join(d['logs'][:3])} --vehicle CAR.toml"),
        ], "why-section", where="page")]  # fmt: skip
    causes = [c["sentence"] for c in why["causes"]]
    # the sentence of a single cause is in the verdict
    is_silent = why["verdict"] == "no_effect" and not all(x["valid"] for x in d["limits"])
    said = _NO_CAUSE if is_silent else why["sentence"]
    lines = [said, *(c for c in causes if c not in said), why["next"] or ""]
    return [Section("Why: the verdict of diagnose", [Lines([x for x in (why["caution"], *lines) if x])], "why-section")]


def _plot_row(found: Validity, r: Mapping[str, Any]) -> tuple[str, ...]:
    unit = pretty_unit(r["unit"])
    worst = ""
    if r["worst"] is not None:
        w = r["worst"]
        own = f" of {w['drive']}" if len(found.traces) > 1 else ""
        worst = f"{short(w['by'], 2)} {unit} at {w['start_s']:.1f}-{w['end_s']:.1f} s{own}"
    share = percent(r["within_share"]) if r["x"] == "t" else f"{r['within']} of {counted(r['points'], 'bin')}"
    gain = f" + {percent(r['y_gain'])}" if r["y_gain"] else ""
    return r["y"], r["x"], share, worst, f"{short(r['y_offset'], 2)} {unit}{gain}", r["tolerance_from"]


def _repeated(d: Mapping[str, Any]) -> list[Line]:
    """Return what the tolerance of each signal is made of, where repeated drives give it."""
    rows = {r["y"]: r for r in d["plots"] if r["repeated_drives"]}
    return [
        (y, f"{short(r['y_offset'], 2)} {pretty_unit(r['unit'])} = t √(s_b² + s_n²): t {r['t_factor']:.2f}, scatter "
            f"between {r['repeated_drives']} drives s_b {short(r['scatter'], 2)}, noise s_n {short(r['noise'], 2)}")
        for y, r in rows.items()
    ]  # fmt: skip


def _limit_row(x: Limit) -> tuple[str, ...]:
    valid = "at all speeds" if x.is_valid else _limit_text(x)
    share = percent(x.share) + ("" if x.is_valid or x.above == x.low else " above it")
    return x.condition, f"{KMH * x.low:.0f} to {KMH * x.high:.0f}", valid, share, f"{x.seconds:.0f}"


def _facts(d: Mapping[str, Any]) -> list[tuple[str, str]]:
    names = [x["name"] for x in d["drives"]]
    named = ", ".join(names) if len(names) <= 3 else f"{names[0]} … {names[-1]} ({len(names)})"
    judged = f"{d['judged_s']:.0f} of {d['duration_s']:.0f} s"
    return [("vehicle", d["vehicle"]), ("drive" if len(names) == 1 else "drives", named), ("judged", judged)]
