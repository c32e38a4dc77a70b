"""Figures of a diagnosis from its JSON document: gain by channel, causes distinguished, unexplained remainder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aqualog.report.diagnosis.views import AFTER, BEFORE, coordinate_axis
from aqualog.report.diagnosis.words import by_change, channel_title, effect_title, mechanism_title
from aqualog.report.figures import GOOD_TO_BAD, axis, band, bars, dots, figure, heat, line, see_through
from aqualog.report.theme import MUTED
from aqualog.report.values import measured, percent, plot_text, pretty_unit, upper_first

__all__ = ["AFTER", "BEFORE", "gain_bars", "isolability", "plots", "remainder"]

_APART = (*GOOD_TO_BAD[:2], (0.9, "#9CCBA9"), GOOD_TO_BAD[2])
_NAMES: Mapping[str, Any] = {"autorange": "reversed", "type": "category", "automargin": True}
_MOST_EFFECTS, _MOST_WITH_TEXT = 36, 24


def plots(document: Mapping[str, Any]) -> dict[str, Any]:
    """Figures by the id of their place on the page; empty figures are left out."""
    found = {"gain-bars": gain_bars(document), "isolability": isolability(document)}
    found |= {f"remainder-{i}": remainder(r, document) for i, r in enumerate(document["unexplained"])}
    return {name: figure for name, figure in found.items() if figure is not None}


def gain_bars(document: Mapping[str, Any]) -> dict[str, Any] | None:
    """Error of each channel after relative to before, for the next sample and in free simulation; None without gain."""
    rows: list[tuple[str, float, str, str]] = []
    for name, c in by_change(document):
        for kind, words in (("rmse", "next sample"), ("free", "free simulation")):
            before, after = c[f"{kind}_before"], c[f"{kind}_after"]
            if before and after is not None:
                title = f"{plot_text(channel_title(name), 40)}, {words}"
                rows.append((title, 100.0 * after / before, measured(before, c["unit"]), measured(after, c["unit"])))
    if not rows:
        return None
    names = [r[0] for r in rows]
    data = [
        bars(name, names, values, colour, text=texts, textposition="auto", insidetextanchor="start",
             hovertemplate="%{y}: %{text} (%{x:.0f} %)<extra>%{fullData.name}</extra>")
        for name, values, texts, colour in (
            ("before", [100.0] * len(rows), [r[2] for r in rows], see_through(BEFORE, 0.55)),
            ("after", [r[1] for r in rows], [r[3] for r in rows], see_through(AFTER, 0.75)),
        )
    ]  # fmt: skip
    x = axis("root mean square error [% of that before]", [0.0, 1.08 * max(100.0, *(r[1] for r in rows))])
    return figure(
        data, "", x, axis(**_NAMES), height=110 + 50 * len(rows), legend={"y": 1.0, "yanchor": "bottom"},
    )  # fmt: skip


def isolability(document: Mapping[str, Any]) -> dict[str, Any] | None:
    """P(right name) of each pair of effects, before the residual is used; None without a pair."""
    names, rows = document["isolability_pairs"]["effects"], document["isolability_pairs"]["p_correct"]
    if not names:
        return None
    causes = [c["key"] for c in document["causes"]]
    both = zip(rows, zip(*rows, strict=True), strict=True)
    worst = [min((p for p in (*row, *column) if p is not None), default=1.0) for row, column in both]
    order = sorted(range(len(names)), key=lambda i: (names[i] not in causes, worst[i], names[i]))[:_MOST_EFFECTS]
    keys = [names[i] for i in order]
    titles = [plot_text(effect_title(k), 34) for k in keys]
    values = [[rows[i][j] if i != j else None for j in order] for i in order]
    texts = [[percent(v) if v is not None else "" for v in row] for row in values]
    shown = {"texttemplate": "%{text}", "textfont": {"size": 10}} if len(keys) <= _MOST_WITH_TEXT else {}
    cells = heat(
        titles, titles, values, texts, (0.5, 1.0), _APART, **shown,
        hovertemplate="%{y} from %{x}: the right name in %{text}<extra></extra>",
        colorbar={"title": {"text": "probability of the right name", "side": "right"}, "thickness": 12,
                  "tickformat": ".0%", "outlinewidth": 0, "tickcolor": MUTED},
    )  # fmt: skip
    x = axis(tickangle=-45, type="category", automargin=True, showgrid=False)
    height = 150 + 22 * max(len(keys), 6)
    return figure([cells], "", x, axis(**_NAMES, showgrid=False), height=height, margin={"t": 30, "b": 20})


def remainder(r: Mapping[str, Any], document: Mapping[str, Any]) -> dict[str, Any] | None:
    """Unexplained part of a channel over the one or two coordinates that it depends on; None without points."""
    if not r["f"] or not r["depends_on"]:
        return None
    unit = plot_text(pretty_unit(r.get("unit") or document["channel_units"].get(r["channel"], "")))
    title = f"{plot_text(upper_first(mechanism_title(r)), 40)}, not explained{f' [{unit}]' if unit else ''}"
    columns = [
        [None if v is None else float(f"{factor * v + offset:.6g}") for v in column]
        for column, (_, factor, offset) in zip(
            zip(*r["x"], strict=True), map(coordinate_axis, r["depends_on"]), strict=False
        )
    ]
    labels = [axis(coordinate_axis(c)[0]) for c in r["depends_on"]]
    if len(columns) > 1:
        known = [i for i, f in enumerate(r["f"]) if f is not None]
        square = dots(
            "", [columns[0][i] for i in known], [columns[1][i] for i in known], [r["f"][i] for i in known], size=11,
            style={"colorscale": "RdBu", "cmid": 0.0, "symbol": "square",
                   "colorbar": {"thickness": 12, "outlinewidth": 0, "title": {"text": unit}}},
            showlegend=False, customdata=[[r["f"][i], r["low"][i], r["high"][i]] for i in known],
            hovertemplate="%{customdata[0]:.4g} (%{customdata[1]:.4g} … %{customdata[2]:.4g})<extra></extra>",
        )  # fmt: skip
        return figure([square], title, labels[0], labels[1], height=330)
    x, order = columns[0], sorted(range(len(columns[0])), key=lambda i: (columns[0][i] is None, columns[0][i]))
    known = [i for i in order if None not in (x[i], r["low"][i], r["high"][i])]
    at, low, high = ([column[i] for i in known] for column in (x, r["low"], r["high"]))
    data = [
        band("95 % band", at, low, high, AFTER, 0.18),
        line("not explained", [x[i] for i in order], [r["f"][i] for i in order], AFTER,
             hovertemplate="%{y:.4g}<extra></extra>"),
    ]  # fmt: skip
    return figure(data, title, labels[0], axis(unit), height=330)
