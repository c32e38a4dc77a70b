"""The page of `diagnose`: one file that needs no network, made from the JSON document and residual samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from aqualog.diagnose.records import ResidualView
from aqualog.report.diagnosis_figures import plots
from aqualog.report.diagnosis_numbers import interval_text, measured, percent, unit_text
from aqualog.report.diagnosis_views import view_data
from aqualog.report.diagnosis_words import by_sharpness, channel_title, effect_title, sentences, verdict_title
from aqualog.report.offline import TEMPLATES, content_policy, environment, json_island, plotly_js
from aqualog.report.wording import number

__all__ = ["render_diagnosis_page", "write_diagnosis_page"]

_LOOKS = {"no_effect": "", "named": "told", "compound": "told", "cannot_tell": "partial", "unexplained": "partial"}
_DECADES = (-1.0, 2.0)  # range of the bars: limit over smallest size worth naming


def write_diagnosis_page(document: Mapping[str, Any], views: Sequence[ResidualView], path: Path, title: str) -> None:
    """Write the page to exactly this path; arguments as `render_diagnosis_page`."""
    path.write_bytes(render_diagnosis_page(document, views, title).encode("utf-8", "replace"))


def render_diagnosis_page(document: Mapping[str, Any], views: Sequence[ResidualView], title: str) -> str:
    """The page as HTML; the same text for the same document and views.

    Parameters
    ----------
    document : mapping
        As `diagnosis_document` makes it, or as it was read back from JSON.
    views : sequence of ResidualView
        Residuals for the pictures before and after.
    title : str
        Names the drives; may hold anything, it is escaped.
    """
    figures = plots(document)
    drawn = view_data(views, [x for c in document["causes"] for x in c["explains"]])
    scripts = {"plotly": plotly_js(), "views": _text("diagnosis.js"), "page": _text("figures.js")}
    verdict = document["verdict"]
    limits, elsewhere = by_sharpness(document)
    return environment(TEMPLATES).get_template("diagnosis.html.j2").render(
        title=title,
        version=document["tool_version"],
        policy=content_policy(scripts.values()),
        # Markup only for the package's own files, plotly.js and what json_island has escaped
        css=Markup(_text("page.css") + _text("slope.css") + _text("diagnosis.css")),
        scripts={name: Markup(text) for name, text in scripts.items()},
        data=json_island(figures),
        views=json_island(drawn),
        plots=list(figures),
        remainders=[name for name in figures if name.startswith("remainder-")],
        has_views=bool(views),
        verdict=verdict_title(verdict),
        look=_LOOKS.get(verdict, "open"),
        is_undecided=verdict == "cannot_tell",
        said=sentences(document),
        level=percent(document["criteria"]["interval"]),
        told_apart=percent(document["criteria"]["told_apart"]),
        power=number(document["criteria"]["power"]),
        facts=_facts(document),
        causes=_cause_rows(document["causes"]),
        manoeuvre=document["next_manoeuvre"],
        separates=_separates(document["next_manoeuvre"]),
        limits=_limit_rows(limits),
        limits_elsewhere=_limit_rows(elsewhere),
        untested=[(effect_title(k), why) for k, why in document["untested"].items()],
        extended_model=document["extended_model"],
    )  # fmt: skip


def _text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


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


def _cause_rows(causes: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Effect, parameter, value, interval, unit, channels; a cause's name stands in its first row only."""
    rows = []
    for c in causes:
        explains = ", ".join(channel_title(x) for x in c["explains"])
        for i, (name, p) in enumerate(c["parameters"].items()):
            own = (effect_title(c["key"]), explains) if i == 0 else ("", "")
            rows.append([own[0], name.replace("_", " "), *interval_text(p), unit_text(p["unit"]), own[1]])
        if not c["parameters"]:
            rows.append([effect_title(c["key"]), "", "", "", "", explains])
    return rows


def _separates(m: Mapping[str, Any] | None) -> list[str]:
    return [" / ".join(effect_title(k) for k in pair) for pair in m["separates"]] if m is not None else []


def _limit_rows(limits: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [
        {
            "name": effect_title(x["key"]),
            "size": measured(x["size"], x["unit"]) if x["size"] is not None else "not detectable at any size",
            "smallest": measured(x["smallest_worth_naming"], x["unit"]),
            "width": _width(x["ratio"]) if x["size"] is not None else None,
            "is_sharp": x["ratio"] is not None and x["ratio"] <= 1.0,
        }
        for x in limits
    ]


def _width(ratio: float | None) -> str | None:
    if ratio is None or ratio <= 0.0:
        return None
    low, high = _DECADES
    return f"{100.0 * min(1.0, max(0.01, (math.log10(ratio) - low) / (high - low))):.1f}"
