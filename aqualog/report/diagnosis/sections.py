"""The sections of a diagnosis, from its JSON document and residual samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog.core.records import Remark
from aqualog.diagnose.records import ResidualView
from aqualog.model.effects import EFFECTS
from aqualog.report.diagnosis.figures import plots
from aqualog.report.diagnosis.views import view_data
from aqualog.report.diagnosis.words import (
    by_change,
    by_sharpness,
    cause_title,
    chance,
    channel_title,
    effect_title,
    sentences,
    untested_by_reason,
    verdict_title,
)  # fmt: skip
from aqualog.report.inputs import input_sections
from aqualog.report.sections import Bar, Bars, Beside, Figures, Headline, Lines, Para, Report, Residuals, Section, Table
from aqualog.report.values import interval_text, measured, number, percent, pretty_unit

__all__ = ["diagnosis_report"]

_LOOKS = {"no_effect": "", "named": "told", "compound": "told", "cannot_tell": "partial", "unexplained": "partial"}
_DECADES = (-1.0, 2.0)  # range of the bars: limit over smallest size worth naming
_FOUND_HERE = ("torque", "resistance", "offset", "delay")  # kinds of remarks whose causes a diagnosis finds better
_BEFOREHAND = "from how the log was driven alone, with each effect at its reference size"
_MOST_LIMITS, _MOST_CONFUSED, _MOST_CHANNELS = 6, 5, 3  # in the terminal


def diagnosis_report(
    document: Mapping[str, Any], views: Sequence[ResidualView] = (), checks: Sequence[Remark] = ()
) -> Report:
    """What to know before the verdict, the verdict, then its basis.

    Parameters
    ----------
    document : mapping
        As `diagnosis_document` makes it, or as it was read back from JSON.
    views : sequence of ResidualView
        Residuals for the figures before and after.
    checks : sequence of Remark
        What does not fit among the signals, once.
    """
    d, said = document, sentences(document)
    figures = plots(d)
    most = [name for name, _ in by_change(d)]
    explained = {x for c in d["causes"] for x in c["explains"]}
    explained = explained or {r["channel"] for r in d["unexplained"]}
    is_road = bool(d["causes"]) and "grade_rms" in (d["causes"][0]["parameters"] or {})
    causes = sorted(explained, key=lambda x: (most.index(x) if x in most else len(most), x))
    answers = [
        ("Test", said["test"]),
        ("Gain", said["score"]),
        ("Next", said["manoeuvre"] if d["verdict"] != "cannot_tell" else []),  # there it has a section
    ]
    head = Headline(said["headline"][0], [(k, x[0]) for k, x in answers if x], verdict_title(d))
    level = percent(d["criteria"]["interval"])
    settle = Section("What would settle it" if d["verdict"] == "cannot_tell" else "Next drive", [
        Lines(said["manoeuvre"]),
        Para(f"Distinguishes: {'; '.join(_separates(d))}" if _separates(d) else ""),
    ], "next", look="next")  # fmt: skip
    residuals = Section(
        "Measured minus simulated, before and after", [Residuals()] if views else [], "views-section",
        "dots: samples; line: median; band: middle 68 % of a bin", where="page",
    )  # fmt: skip
    unknown = Section("Not explained", [
        Lines(said["unexplained"]), Figures([x for x in figures if x.startswith("remainder-")]),
    ], "unexplained-section")  # fmt: skip
    sections = [
        *input_sections([c for c in checks if c.kind not in _FOUND_HERE]),
        Section("", [Lines(said["caution"])], "caution", look="problems"),
        Section("", [head], "verdict", look=f"verdict {_LOOKS.get(d['verdict'], 'open')}"),
        *([settle] if d["verdict"] == "cannot_tell" else []),
        *_on_causes(d, said, level),
        *([] if d["verdict"] == "cannot_tell" else [settle]),
        *((residuals, unknown) if d["verdict"] != "unexplained" else (unknown, residuals)),
        *_on_gain(said, figures),
        *_on_limits(d),
        *_on_isolability(d, said, figures),
        Section("Not tested", [
            Table(("Why", "Effects"), [(why, ", ".join(x)) for why, x in untested_by_reason(d).items()],
                  "untested", (0, 1)),
        ], "untested-section", where="page"),
        Section("Notes", [Lines(said["notes"], most=1000)], "notes", look="problems", where="page"),
        Section("Test", [Lines(said["test"])], where="text"),
    ]  # fmt: skip
    footer = " ".join([*said["test"][1:], f"Intervals {level}."])
    return Report(
        "diagnosis", "what the simulation gets wrong", sections, _facts(d), figures, footer,
        {"view-data": view_data(views, causes, "position" if is_road else "")}, ("diagnosis.js", "figures.js"),
    )  # fmt: skip


def _on_causes(d: Mapping[str, Any], said: Mapping[str, list[str]], level: str) -> list[Section]:
    title = "Possible causes" if d["verdict"] == "cannot_tell" else "Causes" if d["causes"] else "Closest known effects"
    header = ("Effect", "Probability", "Parameter", "Value", f"{level} interval", "Unit", "Explains")
    same = said["causes_relations"]
    return [
        Section(title, [
            Table(header, _cause_rows(d["causes"]), "causes", (0, 2, 5, 6)),
            Lines(said["causes"] if d["causes"] else (), where="page"),
            Beside([
                Section("Drive by drive", [Lines(said["agreement"] if d["causes"] else (), "agreement")]),
                Section("Other explanations that fit as well", [Lines(said["alternatives"], "alternatives")]),
                Section("Looks exactly the same", [Lines(same, "causes-relations", 6)], where="page"),
                Section("This log cannot distinguish",
                        [Lines(same + said["causes_confused"], most_text=_MOST_CONFUSED)], where="text"),
            ]),
            Para(f"Extended model: {d['extended_model']}" if d["extended_model"] else ""),
        ], "causes-section"),
    ]  # fmt: skip


def _on_gain(said: Mapping[str, list[str]], figures: Mapping[str, Any]) -> list[Section]:
    hint = (
        "log score: a gain of 1 makes the measurement 2.7 times as probable as without the causes; "
        "errors: root mean square, for the next sample or in a simulation that runs on by itself"
    )
    gain = said["score"] + said["channels"] + said["gain_notes"]
    return [
        Section("Gain of the extended model", [
            Lines(gain, "gain", 12, len(said["score"]) + _MOST_CHANNELS),
            Beside([
                Section("For the detectors, on simulated drives", [Lines(said["consequences"], "consequences")]),
                Section("", [Figures([x for x in ("gain-bars",) if x in figures])]),
            ]),
        ], "gain-section", hint),
    ]  # fmt: skip


def _on_limits(d: Mapping[str, Any]) -> list[Section]:
    hint = (
        f"smallest size found with a probability of {number(d['criteria']['power'])}; the line marks the smallest size "
        "worth naming; bars are logarithmic"
    )
    limits, elsewhere = ([_bar(x) for x in some] for some in by_sharpness(d))
    most = 24 if d["verdict"] == "no_effect" else _MOST_LIMITS  # without an effect the limits are the result
    return [
        Section("Smallest effects that would have been detected", [Bars(limits, elsewhere, "at other places", most)],
                "limits-section", hint),
    ]  # fmt: skip


def _on_isolability(d: Mapping[str, Any], said: Mapping[str, list[str]], figures: Mapping[str, Any]) -> list[Section]:
    sure = percent(d["criteria"]["told_apart"])
    return [
        Section("Effects that this log can distinguish", [
            Beside([
                Section("Looks exactly the same", [
                    Lines(said["relations"], "relations"),
                    Lines(said["relation_sizes"], most=0, fold="sizes that look the same"),
                ]),
                Section(f"Right name in less than {sure} of cases", [Lines(said["confused"], "confused")]),
            ]),
        ], "isolability-section", _BEFOREHAND, where="page", fold="which effects look alike on this log"),
        Section("Pairs of effects", [Figures([x for x in ("isolability",) if x in figures])], "pairs-section",
                _BEFOREHAND, where="page", fold="how often each pair of effects would get the right name"),
    ]  # fmt: skip


def _facts(d: Mapping[str, Any]) -> list[tuple[str, str]]:
    drives = d["drives"]
    named = ", ".join(drives) if len(drives) <= 3 else f"{drives[0]} … {drives[-1]} ({len(drives)})"
    facts = [("vehicle", d["vehicle"])] if d["vehicle"] else []
    facts += [("drive" if len(drives) == 1 else "drives", named)] if drives else []
    facts.append(("used", f"{_minutes(d['used_s'])} of {_minutes(d['duration_s'])} min"))
    facts += [("channels", ", ".join(channel_title(c) for c in d["channels"]))] if d["channels"] else []
    return facts


def _minutes(seconds: float | None) -> str:
    return number(math.nan if seconds is None else seconds / 60.0, 1)


def _cause_rows(causes: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Effect, probability, parameter, value, interval, unit, channels; a cause's name stands in its first row only."""
    rows: list[tuple[str, ...]] = []
    for c in causes:
        explains = ", ".join(channel_title(x) for x in c["explains"])
        for i, (name, p) in enumerate(c["parameters"].items()):
            own = (cause_title(c), chance(c.get("probability")), explains) if i == 0 else ("", "", "")
            rows.append((*own[:2], name.replace("_", " "), *interval_text(p), pretty_unit(p["unit"]), own[2]))
        if not c["parameters"]:
            rows.append((cause_title(c), chance(c.get("probability")), "", "", "", "", explains))
    return rows


def _separates(d: Mapping[str, Any]) -> list[str]:
    m = d["next_manoeuvre"]
    return [] if m is None else [" / ".join(effect_title(k) for k in pair) for pair in m["separates"]]


def _bar(x: Mapping[str, Any]) -> Bar:
    """A limit; the bar shows it over the smallest size worth naming."""
    is_sharp = x["ratio"] is not None and x["ratio"] <= 1.0
    title = f"worth naming from {_size(x, x['smallest_worth_naming'])}"
    if x["size"] is None:
        return Bar(effect_title(x["key"]), "not detectable at any size", "", is_sharp, title)
    return Bar(effect_title(x["key"]), _size(x, x["size"]), _width(x["ratio"]), is_sharp, title)


def _size(x: Mapping[str, Any], size: float) -> str:
    """A limit with its unit; gains and shares in per cent."""
    is_share = x["effect"] in EFFECTS and EFFECTS[x["effect"]].parameters[0].is_share
    return measured(100.0 * size, "%") if is_share else measured(size, x["unit"])


def _width(ratio: float | None) -> str:
    if ratio is None or ratio <= 0.0:
        return ""
    low, high = _DECADES
    return f"{100.0 * min(1.0, max(0.01, (math.log10(ratio) - low) / (high - low))):.1f}"
