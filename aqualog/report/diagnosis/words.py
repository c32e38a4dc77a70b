"""The sentences of a diagnosis, made from its JSON document alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from typing import Any

from aqualog.diagnose.shapes import MECHANISMS
from aqualog.diagnose.unknown_term import COORDINATES
from aqualog.diagnose.words import CERTAIN
from aqualog.report.values import interval_text, percent, pretty_unit, short, upper_first
from aqualog.report.wording import detector_name

__all__ = [
    "by_change", "by_sharpness", "cause_title", "chance", "channel_title", "coordinate_title", "effect_title",
    "mechanism_title", "sentences", "untested_by_reason", "verdict_title",
]  # fmt: skip

WORSE = 0.01  # rise of a channel's error that is reported
FAR_OFF = 0.5  # [m/s^2] error of an acceleration that is said though nothing explains it: five offsets (V, ESC)
_VERDICTS = {
    "no_effect": "No effect is missing",
    "named": "One cause",
    "compound": "Several causes at once",
    "cannot_tell": "Causes that this log cannot distinguish",
    "unexplained": "An effect that no known cause explains",
    "not_testable": "This log cannot be tested",
}
_CHANNELS = {
    "force_balance": "force balance",
    "kinematic": "accelerometer against the change of speed",
    "axle_slip": "slip, axle against axle",
    "side_slip_f": "front wheels, left against right",
    "side_slip_r": "rear wheels, left against right",
    "lateral": "lateral acceleration",
}
_PLACES = {"f": "front", "r": "rear"}
_OF_BUSES = ("clock_skew",)  # one signal stands for its bus, whether or not the log has that one
_BUSES = {"torque_fl": "wheel torque"}
_WHEELS = ("fl", "fr", "rl", "rr")
_MOST_CONFUSED = 12


def verdict_title(document: Mapping[str, Any]) -> str:
    """The verdict in words, those of the sentence below: what is certain is no cause that cannot be distinguished."""
    verdict: str = document["verdict"]
    if verdict == "cannot_tell" and str(document["sentence"]).startswith(CERTAIN):
        return "Some causes are certain, others are open"
    if verdict == "cannot_tell" and len(document["causes"]) == 1:
        return "A cause that is not certain"
    return _VERDICTS.get(verdict, verdict.replace("_", " "))


def channel_title(channel: str) -> str:
    """`slip_fl` -> `slip FL`."""
    stem, _, end = channel.rpartition("_")
    stem = "wheel speed" if stem == "omega" else stem
    if channel in _CHANNELS:
        return _CHANNELS[channel]
    return f"{stem.replace('_', ' ')} {end.upper()}" if end in _WHEELS else channel.replace("_", " ")


def effect_title(key: str) -> str:
    """`tyre_radius@fl` -> `tyre radius, FL`; a signal keeps its name. Of several keys each is named."""
    if " + " in key:
        return " with ".join(map(effect_title, key.split(" + ")))
    effect, _, where = key.partition("@")
    place = where.upper() if where in _WHEELS else _PLACES.get(where, where)
    if effect in _OF_BUSES:
        place = _BUSES.get(where, place)
    return effect.replace("_", " ") + (f", {place}" if place else "")


def cause_title(cause: Mapping[str, Any]) -> str:
    """`payload mass in d2.mf4`: the effect, and of several drives those that alone have it."""
    return effect_title(cause["key"]) + (f" in {', '.join(cause['drives'])}" if cause.get("drives") else "")


def coordinate_title(name: str) -> str:
    """`v_x` -> `speed`."""
    return COORDINATES[name].title if name in COORDINATES else name.replace("_", " ")


def sentences(document: Mapping[str, Any]) -> dict[str, list[str]]:
    """All sentences of the page by section.

    `caution` holds what to know before the verdict, or nothing. `headline` holds one; `test`, `score`, `channels`
    (error of each, the most changed first), `gain_notes`, `consequences`, `manoeuvre`, `causes` (without the
    headline), `agreement`, `alternatives`, `relations` (groups of effects that look alike), `relation_sizes` (each
    with its sizes), `confused`, `unexplained`, `untested`, `notes` hold any number. `causes_relations` and
    `causes_confused` hold those that involve one of the causes.
    """
    causes = {c["key"] for c in document["causes"]}
    confused = _confused(document)
    gain = document["gain"] or {"notes": [], "consequences": []}
    channels, worse = _channels(document)
    return {
        "caution": [document["caution"]] if document.get("caution") else [],
        "headline": [_headline(document)],
        "test": _test(document["significance"]),
        "causes": [c["sentence"] for c in document["causes"] if not document["sentence"].endswith(c["sentence"])],
        "alternatives": [_alternative(a) for a in document["alternative_sets"]],
        "relations": _alike(document["isolability"], causes),
        "relation_sizes": _relations(sorted(document["isolability"], key=lambda c: not _parties(c) & causes)),
        "causes_relations": _alike([c for c in document["isolability"] if _parties(c) & causes], causes),
        "confused": [_confusion(c) for c in confused][:_MOST_CONFUSED],
        "causes_confused": [_confusion(c) for c in confused if _parties(c) & causes][:_MOST_CONFUSED],
        "score": _score(document["gain"]) + worse,
        "channels": channels,
        "gain_notes": list(gain["notes"]),
        "consequences": [_consequence(c) for c in gain["consequences"]],
        "manoeuvre": _manoeuvre(document["next_manoeuvre"]),
        "agreement": [_agreement(a) for a in document["agreement"]],
        "unexplained": [_unexplained(r) for r in document["unexplained"]],
        "untested": [f"{upper_first(why)}: {', '.join(x)}." for why, x in untested_by_reason(document).items()],
        "notes": [n for n in document["notes"] if n != document.get("caution")],
    }


def by_sharpness(document: Mapping[str, Any]) -> tuple[list[Mapping[str, Any]], list[Mapping[str, Any]]]:
    """Limits in order: smallest relative to the size worth naming first, undetectable effects last.

    Returns
    -------
    tuple
        One of each effect, for the whole car or else its sharpest place; and those of the other places.
    """

    def sharpness(x: Mapping[str, Any]) -> tuple[bool, float, str]:
        return x["size"] is None, math.inf if x["ratio"] is None else x["ratio"], x["key"]

    ordered = sorted(document["limits"], key=sharpness)
    first: dict[str, Mapping[str, Any]] = {}
    for x in ordered:
        if x["effect"] not in first or x["where"] is None:
            first[x["effect"]] = x
    chosen = sorted(first.values(), key=sharpness)
    keys = {x["key"] for x in chosen}
    return chosen, [x for x in ordered if x["key"] not in keys]


def _test(s: Mapping[str, Any] | None) -> list[str]:
    if s is None:
        return []
    p, surrogates = s["p_value"], s["surrogates"]
    beyond = s["statistic"] is not None and s["threshold"] is not None and s["statistic"] > s["threshold"]
    said = [
        f"Known effects explain {'more' if beyond else 'no more'} than noise: largest test value "
        f"{short(s['statistic'])}, threshold {short(s['threshold'])}, p {'< 1e-12' if p <= 1e-12 else f'= {short(p)}'}."
    ]
    asked = f"False alarm level {short(s['level'])}"
    if s["achieved_level"] is None:
        return [*said, f"{asked}; the achieved level was not measured."]
    of = f" in {surrogates} simulations with noise only" if surrogates else ", without simulated noise"
    return [*said, f"{asked}, achieved {short(s['achieved_level'])}{of}."]


def _alternative(a: Mapping[str, Any]) -> str:
    names = " with ".join(map(cause_title, a["causes"]))
    values = "; ".join(
        f"{name.replace('_', ' ')} {value} ({interval}) {pretty_unit(p['unit'])}".rstrip(" –")
        for c in a["causes"]
        for name, p in c["parameters"].items()
        for value, interval in [interval_text(p)]
        if value
    )
    # a set is no more probable than the least probable of its causes
    known = [c["probability"] for c in a["causes"] if c.get("probability") is not None]
    how = f", probability {'at most ' if len(a['causes']) > 1 else ''}{chance(min(known))}" if known else ""
    if not known and a["evidence_ratio"] is not None:
        how = f", {short(a['evidence_ratio'])} times less likely"
    return f"{names}{f': {values}' if values else ''}{how}"


def _agreement(a: Mapping[str, Any]) -> str:
    """Whether the drives agree on a value, and whether the other drives' value improves the prediction of each."""
    values = "; ".join(
        f"{d['drive']} {value} ({interval})" for d in a["drives"] for value, interval in [interval_text(d)] if value
    )
    worse = [d["drive"] for d in a["drives"] if d["log_score_gain"] is not None and d["log_score_gain"] <= 0.0]
    how = "the drives agree" if a["holds"] else "the drives differ" if not worse else "not confirmed by every drive"
    told = f" (p {short(a['p_value'])})" if a["p_value"] is not None else ""
    left = f"; {', '.join(worse)} is not predicted better with the value of the others" if worse else ""
    unit = pretty_unit(a["drives"][0]["unit"])
    name = a["parameter"].replace("_", " ") + (f" [{unit}]" if unit not in ("", "–", "-") else "")
    return f"{effect_title(a['key'])}, {name}: {how}{told}: {values}{left}"


def _parties(c: Mapping[str, Any]) -> set[str]:
    return {c["effect"], *c["rivals"]}


def _relations(confusions: Iterable[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(c["relation"] for c in confusions if c["relation"]))


def _alike(confusions: Sequence[Mapping[str, Any]], causes: Set[str]) -> list[str]:
    """One sentence for each group of effects that look exactly alike, those with a cause first."""
    groups: list[set[str]] = []
    like: dict[tuple[str, ...], list[str]] = {}
    for c in confusions:
        if not c["relation"]:
            continue
        if len(c["rivals"]) > 1:
            like.setdefault(tuple(c["rivals"]), []).append(c["effect"])
            continue
        own = _parties(c)
        groups = [g for g in groups if not g & own] + [own.union(*(g for g in groups if g & own))]
    said = []
    for group in groups:
        names = "; ".join(map(effect_title, sorted(group)))
        said.append((not group & causes, f"{upper_first(names)} look exactly alike."))
    for rivals, effects in like.items():
        names, verb = "; ".join(map(effect_title, effects)), "looks" if len(effects) == 1 else "each look"
        sentence = f"{upper_first(names)} {verb} exactly like {' with '.join(map(effect_title, rivals))}."
        said.append((not {*rivals, *effects} & causes, sentence))
    return [sentence for _, sentence in sorted(said, key=lambda x: x[0])]


def _confused(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    limit = document["criteria"]["told_apart"]
    some = [c for c in document["isolability"] if c["p_correct"] is not None and c["p_correct"] < limit]
    own = {c["key"] for c in document["causes"]}
    some.sort(key=lambda c: (not own & _parties(c), c["p_correct"], c["effect"], c["rivals"]))
    once: dict[frozenset[str], Mapping[str, Any]] = {}
    for c in some:
        once.setdefault(frozenset(_parties(c)), c)
    return [c for c in once.values() if not c["relation"]]


def _confusion(c: Mapping[str, Any]) -> str:
    rivals = " with ".join(effect_title(r) for r in c["rivals"])
    return f"{effect_title(c['effect'])} from {rivals}: the right name in {percent(c['p_correct'])}"


def by_change(document: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Channels of the gain, those first whose error changes most."""
    channels = (document["gain"] or {"channel": {}})["channel"]
    return sorted(channels.items(), key=lambda item: -abs(item[1]["rmse_change"] or 0.0))


def _score(g: Mapping[str, Any] | None) -> list[str]:
    if g is None:
        return []
    if g["in_sample"]:
        score, (low, high) = g["in_sample_log_score_gain"], g["in_sample_ci95"]
        where = "On the diagnosed drives (no held-out data)"
    else:
        score, (low, high) = g["heldout_log_score_gain"], g["ci95"]
        where = f"On held-out drives ({', '.join(g['heldout'])})" if g["heldout"] else "On held-out parts"
    if score is None:
        return []
    interval = f" (95 %: {short(low)} … {short(high)})" if low is not None and high is not None else ""
    unit = pretty_unit(g["unit"])
    if high is not None and high < 0.0:
        return [f"{where} the log score falls by {short(-score)} {unit}{interval}: the model predicts worse."]
    if low is not None and low <= 0.0:
        return [f"{where} the log score changes by {short(score)} {unit}{interval}: no measurable gain."]
    change = "rises" if score >= 0.0 else "falls"
    promised = (
        f"; {short(p)} are expected of right causes of these sizes" if (p := g["promised_log_score_gain"]) else ""
    )
    return [f"{where} the log score {change} by {short(abs(score))} {unit}{interval}{promised}."]


def _channels(document: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """The error of each channel before and after; sentences on those that grow, which the list may hide, and on an
    acceleration that stays far off: causes may be sure beside it, and leave it."""
    told, grown, left = [], [], []
    for name, c in by_change(document):
        parts = []
        for kind, error, short_error in (
            ("rmse", "error one sample ahead", "for the next sample"),
            ("free", "error in free simulation", "in free simulation"),
        ):
            before, after, change = c[f"{kind}_before"], c[f"{kind}_after"], c[f"{kind}_change"]
            if (change or 0.0) > WORSE:
                grown.append(f"{channel_title(name)} +{percent(change)} {short_error}")
            if before is None or after is None:
                continue
            if kind == "rmse" and c["unit"] == "m/s^2" and after > FAR_OFF:
                left.append(f"{channel_title(name)} stays {short(after)} m/s² off")
            sign = "" if not change else "+" if change > 0 else "−"
            by = "" if change is None else f" ({sign}{percent(abs(change))})"
            parts.append(f"{error} {short(before)} → {short(after)} {pretty_unit(c['unit'])}".rstrip(" –") + by)
        told += [f"{upper_first(channel_title(name))}: {', '.join(parts)}."] if parts else []
    worse = [f"Larger error with the extended model: {'; '.join(grown)}."] if grown else []
    return told, [*worse, *([f"Not explained: the {'; the '.join(left)}, for the next sample."] if left else [])]


def _consequence(c: Mapping[str, Any]) -> str:
    parts = [f"false alarms {c['false_alarms_before']} → {c['false_alarms_after']} in {short(c['distance_km'])} km"]
    if c["per_100km_before"] is not None:
        parts[0] += f" ({short(c['per_100km_before'])} → {short(c['per_100km_after'])} per 100 km)"
    if c["passes"]:
        parts.append(f"detected {c['found_before']} → {c['found_after']} of {c['passes']} passes")
    if c["latency_before_s"] is not None and c["latency_after_s"] is not None:
        parts.append(f"latency {short(c['latency_before_s'])} → {short(c['latency_after_s'])} s")
    return f"{detector_name(c['detector'])}: {', '.join(parts)}."


def _manoeuvre(m: Mapping[str, Any] | None) -> list[str]:
    if m is None:
        return []
    return [m["sentence"] or f"{upper_first(m['name'].replace('_', ' '))}."]


def mechanism_title(r: Mapping[str, Any]) -> str:
    """What a remainder acts through, or its channel."""
    titles = {m.name: m.title for m in MECHANISMS}
    return titles.get(r.get("mechanism") or "", channel_title(r["channel"]))


def untested_by_reason(document: Mapping[str, Any]) -> dict[str, list[str]]:
    """Titles of the effects that are not tested, by the reason."""
    out: dict[str, list[str]] = {}
    for key, why in document["untested"].items():
        out.setdefault(why, []).append(effect_title(key))
    return out


def chance(probability: float | None) -> str:
    """`97 %`; never all or nothing; empty if it is not known."""
    if probability is None:
        return ""
    return (
        "over 99 %" if probability >= 0.995 else "below 1 %" if probability < 0.01 else f"{100.0 * probability:.0f} %"
    )


def _headline(document: Mapping[str, Any]) -> str:
    """The verdict's sentence with the probability of each cause, and of the first unknown form."""
    said: str = document["sentence"] or f"{verdict_title(document)}."
    forms = document["unexplained"][:1] if document["verdict"] == "unexplained" else []
    known = {cause_title(c): chance(c.get("probability")) for c in document["causes"]}
    if forms:
        known = {"the unknown form": chance(forms[0].get("probability"))} | known
    known = {name: p for name, p in known.items() if p}
    if not known:
        return said
    if len(set(known.values())) == 1:
        how = f"probability {next(iter(known.values()))}{' each' if len(known) > 1 else ''}"
    else:
        how = f"probability of {', of '.join(f'{name} {p}' for name, p in known.items())}"
    return f"{said.rstrip('.')}; {how}."


def _unexplained(r: Mapping[str, Any]) -> str:
    if r.get("mechanism"):
        return str(r["sentence"])
    coordinates = " and ".join(coordinate_title(x) for x in r["depends_on"])
    said = r["sentence"] or f"{upper_first(channel_title(r['channel']))} depends on {coordinates}."
    parts = [f"{percent(r['share'])} of the variance"] if r["share"] is not None else []
    parts += [f"p = {short(r['p_value'])}"] if r["p_value"] is not None else []
    parts += [f"{', '.join(coordinate_title(x) for x in r['proxies'])} explains it as well"] if r["proxies"] else []
    if r["nearest"]:
        alike = f" (similarity {short(r['cosine'])})" if r["cosine"] is not None else ""
        parts.append(f"nearest known effect {effect_title(r['nearest'])}{alike}")
    return f"{said} {upper_first('; '.join(parts))}." if parts else said
