"""The verdict and the episodes of a drive, in words and as rows of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from aqualog.core.judgement import Episode, EpisodeKind, Judgement
from aqualog.core.records import Margin
from aqualog.detect.verdict import UNFIT
from aqualog.report.sections import Cell, Line
from aqualog.report.theme import WHEEL_COLOURS
from aqualog.report.values import KMH, counted, number
from aqualog.report.wording import detector_name

__all__ = [
    "EPISODE_HEADS", "FOLDED", "KIND_NAMES", "card_lines", "episode_cells", "episode_sentence", "folded_line",
    "headline", "judged_by", "level", "lines_of", "margin_lines", "missing_words",
]  # fmt: skip

KIND_NAMES: dict[EpisodeKind, str] = {
    "aquaplaning": "aquaplaning", "suspected": "suspected", "other_surface": "other surface",
    "wheel_lock": "braking slip", "single_detector": "single detector",
}  # fmt: skip
FOLDED: tuple[EpisodeKind, ...] = ("wheel_lock", "single_detector")
"""Kinds that are no answer to the question for water; a page folds them, a terminal counts them."""

EPISODE_HEADS: Sequence[str | tuple[str, str]] = (
    "Episode", ("Start [s]", "from s"), ("End [s]", "to s"), "Where", "Severity", ("v_x [km/h]", "km/h"),
    ("Resistance [m/s²]", "m/s²"), ("Slip [%]", "slip %"), ("Distance [m]", "m"), ("Detections", ""),
    "Decided by",
)  # fmt: skip
MOST = 0.9  # of a drive: what is judged of less is said in the first sentence
_WHEELS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
# what the joint detectors lack, in a reader's words: beginning of the name -> words
_LACKS = (
    ("omega_", "wheel speeds"), ("wheel speeds", "wheel speeds at a higher rate"), ("torque", "wheel torque"),
    ("a_x", "longitudinal acceleration a_x"), ("v_x", "speed"), ("vehicle.drivetrain", "drivetrain in a vehicle file"),
    ("vehicle.mass", "mass in a vehicle file"), ("signals at", "signals at a higher rate"),
)  # fmt: skip


# --- words -----------------------------------------------------------------------------------------------------------


def missing_words(missing: Sequence[str]) -> str:
    """What is missing, each thing once: `no wheel torque, no mass in a vehicle file`."""
    words = [next((w for begin, w in _LACKS if name.startswith(begin)), name) for name in missing]
    return ", ".join(f"no {w}" for w in dict.fromkeys(words))


def level(judgement: Judgement, margin: Margin | None = None) -> str:
    """The look of the verdict: `full`, `partial` (or a warning), `none`, or `open` where it cannot be judged."""
    if judgement.verdict == "cannot_be_judged":
        return "open"
    wet = judgement.of("aquaplaning")
    is_warned = margin is not None and math.isfinite(margin.warned_s)
    return "full" if any(e.severity == "full" for e in wet) else "partial" if wet or is_warned else "none"


def headline(
    judgement: Judgement, *, doubted: bool = False, margin: Margin | None = None, duration_s: float = 0.0
) -> str:
    """The verdict in one sentence; `doubted` where inputs do not fit each other.

    Where no wheel is found afloat, a warning of the `margin` belongs to it, and how much of the drive's `duration_s`
    was judged if that is not most of it.
    """
    warned = ""
    if margin is not None and math.isfinite(margin.warned_s):
        warned = f", but a warning from {margin.warned_s:.1f} s on: at the least {_left(margin)} to full aquaplaning"
    if judgement.verdict == "cannot_be_judged":
        # a torque that does not fit misleads the margin, too
        lost = f"Aquaplaning cannot be judged: {missing_words(judgement.missing)}"
        return lost if UNFIT in judgement.missing else lost + warned
    wet = judgement.of("aquaplaning")
    full = sum(e.severity == "full" for e in wet)
    many = counted(len(wet), "episode") + (f", {full} full" if full else "")
    part = ""
    if judgement.judged_s < MOST * duration_s:
        part = f" in the {number(judgement.judged_s, 1)} of {number(duration_s, 1)} s that can be judged"
    dry = f"No aquaplaning{part}{warned}"
    found = f"Aquaplaning: {episode_sentence(wet[0]) if len(wet) == 1 else many}" if wet else dry
    return f"{found}; doubtful, check the inputs first" if doubted else found


def episode_sentence(episode: Episode) -> str:
    """`8.2–17.7 s, 101 km/h, front right, front left, partial`."""
    speed = f"{number(KMH * episode.v_x, 0)} km/h" if math.isfinite(episode.v_x) else ""
    wheels = ", ".join(_WHEELS[w] for w in episode.wheels)
    severity = episode.severity if episode.kind == "aquaplaning" else ""
    if severity == "full" and math.isfinite(episode.v_full):
        severity += f" from {number(KMH * episode.v_full, 0)} km/h on"
    told = (f"{episode.start_s:.1f}–{episode.end_s:.1f} s", speed, wheels, severity)
    return ", ".join(x for x in told if x)


def lines_of(judgement: Judgement, most: int) -> list[str]:
    """A line for each of several episodes of aquaplaning, and one that counts each other kind."""
    wet = judgement.of("aquaplaning")
    lines = [episode_sentence(e) for e in wet[:most]] if len(wet) > 1 else []
    lines += [f"and {len(wet) - most} more"] if len(wet) > most else []
    return [*lines, *(folded_line(k, judgement.of(k)) for k in KIND_NAMES if k != "aquaplaning" and judgement.of(k))]


def folded_line(kind: EpisodeKind, episodes: Sequence[Episode]) -> str:
    """`Braking slip: 41 episodes, 112 detections`; one alone is shown whole."""
    name = KIND_NAMES[kind].capitalize()
    if len(episodes) == 1:
        return f"{name}: {episode_sentence(episodes[0])}"
    return f"{name}: {len(episodes)} episodes, {counted(sum(len(e.events) for e in episodes), 'detection')}"


def margin_lines(margin: Margin | None) -> list[str]:
    """`Least distance to full aquaplaning: 14 km/h (8 … 21) at 9.1 s, first warning at 8.4 s`; none without water."""
    if margin is None:
        return []
    warned = f", first warning at {margin.warned_s:.1f} s" if math.isfinite(margin.warned_s) else ", no warning"
    return [f"Least distance to full aquaplaning: {_left(margin)} at {margin.at_s:.1f} s{warned}"]


def _left(margin: Margin) -> str:
    least, low, high = (number(KMH * x, 0) for x in (margin.least, *margin.ci90))
    return f"{least} km/h ({low} … {high})"


def card_lines(judgement: Judgement, duration_s: float, most: int = 4) -> list[Line]:
    """What stands under the headline of a page: episodes, and which detectors have judged."""
    return [*lines_of(judgement, most), judged_by(judgement, duration_s)]


def judged_by(judgement: Judgement, duration_s: float) -> tuple[str, str]:
    """Which detectors ran, and for how long the joint ones could judge, as a head and a sentence."""
    ran = ", ".join(detector_name(d) for d in judgement.ran) or "no detector"
    if judgement.verdict == "cannot_be_judged":
        return "Ran:", f"{ran}; no single detector decides by itself{_resistance(judgement)}"
    if not judgement.judged_s:  # a wheel that no engine drives has stopped without a brake
        return "Ran:", f"{ran}; a free wheel was lost without a brake, and what is less cannot be judged"
    return "Judged:", f"{number(min(judgement.judged_s, duration_s), 1)} of {number(duration_s, 1)} s, by {ran}"


def _resistance(judgement: Judgement) -> str:
    """What the resistance shows where it is all that can be said of water."""
    if "resistance" not in judgement.ran:
        return ""
    sizes = [e.delta_a_x_max for e in judgement.episodes if "resistance" in e.decided_by]
    if not sizes:
        return "; the resistance raised no alarm"
    return f"; resistance in {counted(len(sizes), 'episode')}, up to {number(max(sizes), 2)} m/s²"


def episode_cells(episode: Episode) -> list[str | Cell]:
    """Row of an episode, under `EPISODE_HEADS`."""
    first = episode.wheels[0] if episode.wheels else ""
    return [
        KIND_NAMES[episode.kind], _number(episode.start_s, 2), _number(episode.end_s, 2),
        Cell(", ".join(w.upper() for w in episode.wheels) or "vehicle", dot=WHEEL_COLOURS.get(first, "")),
        Cell(episode.severity, tag=episode.severity if episode.kind == "aquaplaning" else ""),
        _number(KMH * episode.v_x, 0), _number(episode.delta_a_x_max, 2), _number(100.0 * _slip(episode), 1),
        _number(episode.distance_m, 0), str(len(episode.events)),
        " + ".join(detector_name(d).lower() for d in episode.decided_by),
    ]  # fmt: skip


def _slip(episode: Episode) -> float:
    """The slip furthest from rolling, of wheels that slow down or spin. [-]"""
    return max((x for x in (episode.slip_min, episode.slip_max) if math.isfinite(x)), key=abs, default=math.nan)


def _number(x: float, decimals: int) -> Cell:
    return Cell(number(x, decimals), key=x if math.isfinite(x) else -math.inf)
