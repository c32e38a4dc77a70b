"""Sentences of a campaign's diagnosis; each follows from its figures."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.diagnose.records import Alternative, Cause, Estimate, Remainder, Verdict
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Effect

__all__ = ["cause_sentence", "verdict_sentence"]

_PLACES = {
    None: "all wheels", "f": "the front wheels", "r": "the rear wheels", "left": "the left track",
    "right": "the right track",
}  # fmt: skip


def cause_sentence(effect: Effect, where: str | None, estimates: Sequence[Estimate]) -> str:
    """An effect with its sizes and intervals."""
    asked = effect.campaign
    assert asked is not None
    k = asked.scale
    scaled = [Estimate(k * e.value, k * e.low, k * e.high, e.unit) for e in estimates]
    place = _PLACES.get(where, str(where))
    return asked.sentence.format(*scaled, place=place, Place=place[0].upper() + place[1:])


def verdict_sentence(
    verdict: Verdict, causes: Sequence[Cause], alternatives: Sequence[Alternative], remainders: Sequence[Remainder],
    runs: int,
) -> str:  # fmt: skip
    """The verdict in one or two sentences."""
    if verdict == "not_testable":
        return "The campaign has too few runs on water and on dry road with a configuration known to the model."
    if verdict == "no_effect":
        return f"Slip slope and resistance of {runs} runs agree with the model within their scatter."
    if verdict == "unexplained":
        first = remainders[0].sentence if remainders else ""
        return f"The {runs} runs deviate from the model in a way that no known effect explains. {first}".strip()
    if verdict == "cannot_tell":
        names = "; or ".join(" with ".join(c.key for c in a.causes) for a in alternatives)
        return f"The {runs} runs deviate from the model, but cannot distinguish the causes: {names}."
    text = " ".join(c.sentence for c in causes)
    places = {c.effect for c in causes} & {
        c.effect for a in alternatives for c in a.causes if c.key not in {d.key for d in causes}
    }
    if places:
        titles = {e.name: e.campaign.title for e in EFFECTS.values() if e.campaign is not None}
        told = ", ".join(titles.get(e, e) for e in sorted(places))
        text += f" The affected wheels are less certain ({told})."
    return text
