"""Sentences of a campaign's diagnosis; each follows from its figures."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.diagnose.records import Alternative, Cause, Estimate, Remainder, Verdict

__all__ = ["cause_sentence", "verdict_sentence"]

_PLACES = {
    None: "all wheels", "f": "the front wheels", "r": "the rear wheels", "left": "the left track",
    "right": "the right track",
}  # fmt: skip
_NAMES = {
    "track_clearing": "film in the front wheels' track", "contact_loss": "lost contact on water",
    "water_drag": "drag of the water", "uneven_water": "water of the track", "load_sensitivity": "slip slope over load",
    "slip_stiffness": "slip slope",
}  # fmt: skip


def cause_sentence(effect: str, where: str | None, values: Sequence[tuple[str, Estimate]]) -> str:
    """An effect with its sizes and intervals."""
    place = _PLACES.get(where, str(where))
    first = values[0][1]
    span = f"(95 %: {first.low:.2f} ... {first.high:.2f})"
    if effect == "track_clearing":
        mm = f"{1e3 * first.value:+.2f} mm (95 %: {1e3 * first.low:+.2f} ... {1e3 * first.high:+.2f} mm)"
        return f"The film that the front wheels leave to the rear ones differs by {mm} from the tyre model's."
    if effect == "contact_loss":
        return f"The water lifts {first.value:.2f} times as much of the contact of {place} {span} as in the model."
    if effect == "water_drag":
        return f"Film and bow wave drag {first.value:.2f} times as much on {place} {span} as in the model."
    if effect == "uneven_water":
        more = values[1][1]
        return (
            f"{place[0].upper()}{place[1:]} has {first.value:.2f} times the depth of the table of runs {span}, and "
            f"its irregularity is larger by {more.value:.2f} of the depth (95 %: {more.low:.2f} ... {more.high:.2f})."
        )
    if effect == "load_sensitivity":
        return f"The load sensitivity of the slip slope differs by {first.value:+.2f} from the tyre model's {span}."
    return f"The slip slope of {place} is {first.value:.2f} times the vehicle file's {span}."


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
        told = ", ".join(_NAMES.get(e, e) for e in sorted(places))
        text += f" The affected wheels are less certain ({told})."
    return text
