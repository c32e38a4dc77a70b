"""Metrics 1 to 6, 9 to 11 of judged cases, each a share with its exact interval beside its target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tests.blind.judging.cases import Judged, limited
from tests.blind.metrics import naming, worth
from tests.blind.metrics.intervals import clopper_pearson
from tests.blind.metrics.measure import Measure, by, quantity, share

__all__ = ["figures", "misses_text", "of_worlds", "reliability_text", "risk_coverage"]

STRONG, WEAK, GAINFUL, SURE = 8.0, (3.0, 5.0), 6.0, 0.95
EDGES = (0.0, 0.25, 0.5, 0.8, 0.9, 0.95, 1.0)


def figures(cases: Sequence[Judged]) -> list[Measure]:
    """All figures. Measured drives with nothing added have no truth: they are not counted."""
    counted = [c for c in cases if not c.is_baseline]
    makers = (
        false_discovery, names, wrong, weak, coverage, forecasts, calibration, compounds, gains, unknown, honesty, cost,
    )  # fmt: skip
    return [m for make in makers for m in make(counted)]


def of_worlds(cases: Sequence[Judged]) -> list[Measure]:
    """The figures of each world by itself, without those of single effects."""
    out = []
    for world, group in sorted(by((c for c in cases if not c.is_baseline), lambda c: c.world).items()):
        few = (m for m in figures(group) if m.count and not m.name.startswith("  "))
        out += [Measure(m.number, f"{world}: {m.name}", *_rest(m)) for m in few]
    return out


def _rest(m: Measure) -> tuple[int, float, float, float, str, bool | None]:
    return m.count, m.value, m.low, m.high, m.target, m.reached


def _singles(cases: Sequence[Judged], low: float = 0.0, high: float = math.inf) -> list[Judged]:
    """Known effects alone in a drive, of a size within these bounds."""
    return [c for c in cases if c.kind == "known" and len(c.row.truth) == 1 and low <= c.row.truth[0].z <= high]


def false_discovery(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 1: anything at all where nothing is hidden; in an injected drive: anything that the clean one does not say."""
    nulls = [c for c in cases if c.kind == "null" and not c.row.error]
    out = [share(
        1, "false discovery, nothing hidden", [c.row.found for c in nulls],
        "<= 0.05, upper bound <= 0.075", accept=lambda v, _, high: v <= 0.05 and high <= 0.075, least=400, note=_said(nulls),
    )]  # fmt: skip
    for text, key in (("noise", lambda c: c.row.noise), ("drive", lambda c: c.row.programme)):
        for name, group in sorted(by(nulls, key).items()):
            out.append(share(1, f"  {text} {name}", [c.row.found for c in group], "<= 0.10", least=10))
    return out


def _said(cases: Sequence[Judged]) -> str:
    """What was said where it was not right, with the number of times."""
    said = by((c for c in cases if c.row.found or c.row.error), lambda c: _words(c))
    return ", ".join(f"{n} {len(g)}" for n, g in sorted(said.items(), key=lambda x: -len(x[1]))[:4])


def _words(c: Judged) -> str:
    names = "+".join(x.key for x in c.row.causes[:3]) or (c.row.error[:40] if c.row.error else c.row.verdict)
    return f"({names})" if c.row.verdict == "cannot_tell" else names


def names(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 2: the name of one strong effect; cases that failed are misses."""
    every = _singles(cases, STRONG)
    strong = [c for c in every if not c.limit_is_right]
    isolable = _isolable(strong)
    missed = [c for c in strong if not c.first_is_right]
    out = [
        share(2, "right name first, z >= 8", [c.first_is_right for c in strong], ">= 0.95", least=100, note=_missed(missed)),
        share(2, "right name, or it and true twins", [c.is_right_or_twins for c in strong], ">= 0.95", least=100),
        share(2, "truth in the answer", [c.in_answer for c in strong], ">= 0.98", least=100),
        share(2, "right name first, forecast isolable", [c.first_is_right for c in isolable], ">= 0.95", least=100),
    ]  # fmt: skip
    out.append(share(2, "no effect, below the stated limit (no miss)", [c.limit_is_right for c in every], "-"))
    for effect, group in sorted(by(strong, lambda c: c.row.truth[0].effect).items()):
        note = _missed([c for c in group if not c.first_is_right])
        out.append(share(2, f"  {effect}", [c.first_is_right for c in group], ">= 0.95", least=10, note=note))
    return out


def _isolable(cases: Sequence[Judged]) -> list[Judged]:
    return [c for c in cases if c.row.error or c.row.truth[0].p_right >= SURE]


def _missed(cases: Sequence[Judged]) -> str:
    said = by(cases, _words)
    return ", ".join(f"{n} {len(g)}" for n, g in sorted(said.items(), key=lambda x: -len(x[1]))[:4])


def wrong(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 3: a name without reserve for what is not hidden."""
    strong, small = _singles(cases, STRONG), _singles(cases, 0.0, np.nextafter(STRONG, 0.0))
    return [
        share(3, "confidently wrong, z >= 8", [c.wrong for c in strong], "<= 0.01", least=100,
              note=_said([c for c in strong if c.wrong])),
        share(3, "confidently wrong, z < 8", [c.wrong for c in small], "<= 0.03", least=100,
              note=_said([c for c in small if c.wrong])),
    ]  # fmt: skip


def weak(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 4: effects near what can be seen; where nothing is found the stated limit should be above what is hidden."""
    few = _singles(cases, *WEAK)
    silent = [c for c in few if c.row.verdict == "no_effect"]
    return [
        share(4, "confidently wrong at z 3 ... 5", [c.wrong for c in few], "<= 0.05", least=40),
        share(4, "truth in the answer at z 3 ... 5", [c.in_answer for c in few], "-"),
        share(4, "no effect, and the limit holds the truth", [_below(c) for c in silent], ">= 0.85", least=20),
    ]  # fmt: skip


def _below(c: Judged) -> bool:
    """A limit that is not stated is one that nothing reaches."""
    return limited(c.row.truth[0]) <= c.row.limits.get(c.row.truth[0].key, math.inf)


def coverage(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 5, as for the blind drives. A measured drive has values of its own, below the limit, that nobody knows."""
    some = [c for c in cases if c.kind in ("known", "compound")]
    real = naming.coverage([c.row for c in some if c.is_measured])[0]
    return [
        *naming.coverage([c.row for c in some if not c.is_measured]),
        Measure(5, "the same in measured drives", *_rest(replace(real, target="-", reached=None))),
    ]


def forecasts(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 6: the chance to tell an effect from its nearest rival, as stated for what is above the limit, beside its name."""
    large = [c for c in _singles(cases, STRONG) if not c.row.error and not c.limit_is_right]
    told = [c for c in large if math.isfinite(c.row.truth[0].p_right)]
    pairs = [(c.row.truth[0].p_right, c.first_is_right) for c in told]
    return [
        _skill(6, "isolability forecast, Brier skill", pairs, 50),
        _worst(6, "isolability forecast, worst bin", pairs, 50),
    ]


def calibration(cases: Sequence[Judged]) -> list[Measure]:
    """`probability` of causes and forms beside whether they were so; nothing where an engine does not say any."""
    pairs = [p for c in cases for p in c.chances]
    return [
        _skill(6, "probability, Brier skill over the base rate", pairs, 100, above=0.2),
        _worst(6, "probability, worst bin", pairs, 100),
        Measure(6, "probability, expected calibration error", len(pairs), _ece(pairs), math.nan, math.nan, "<= 0.05",
                _ece(pairs) <= 0.05 if len(pairs) >= 100 else None),
    ]  # fmt: skip


Pairs = Sequence[tuple[float, bool]]


def _skill(number: int, name: str, pairs: Pairs, least: int, above: float = 0.0) -> Measure:
    p, o = np.array([x for x, _ in pairs]), np.array([float(y) for _, y in pairs])
    constant = float(np.mean((o - o.mean()) ** 2)) if o.size else 0.0
    skill = 1.0 - float(np.mean((p - o) ** 2)) / constant if constant > 0.0 else math.nan
    known = len(pairs) >= least and math.isfinite(skill)
    return Measure(
        number, name, len(pairs), skill, math.nan, math.nan, f"> {above:g}", skill > above if known else None
    )


def bins(pairs: Pairs) -> list[tuple[float, float, int, int, float]]:
    """(low, high, number, hits, mean of the stated) of each bin that has any."""
    out = []
    for low, high in pairwise(EDGES):
        own = [(p, o) for p, o in pairs if low <= p < high or (high == 1.0 and p == 1.0)]
        if own:
            out.append((low, high, len(own), sum(o for _, o in own), float(np.mean([p for p, _ in own]))))
    return out


def _ece(pairs: Pairs) -> float:
    return sum(n * abs(k / n - p) for _, _, n, k, p in bins(pairs)) / len(pairs) if pairs else math.nan


def _worst(number: int, name: str, pairs: Pairs, least: int) -> Measure:
    errors = [abs(k / n - p) for _, _, n, k, p in bins(pairs) if n >= 5]
    worst = max(errors, default=math.nan)
    reached = worst <= 0.05 if len(pairs) >= least and errors else None
    return Measure(number, name, len(pairs), worst, math.nan, math.nan, "<= 0.05", reached)


def reliability_text(cases: Sequence[Judged]) -> str:
    """The stated probabilities in bins beside the shares that were so; empty without any."""
    pairs = [p for c in cases if not c.is_baseline for p in c.chances]
    lines = ["stated          n   mean stated   was so   95 % interval"]
    for low, high, n, k, p in bins(pairs):
        a, b = clopper_pearson(k, n)
        lines.append(f"{low:.2f} ... {high:.2f}  {n:4d}   {p:11.3f}   {k / n:6.3f}   {a:.3f} ... {b:.3f}")
    return "\n".join(lines) if pairs else ""


def misses_text(cases: Sequence[Judged]) -> str:
    """A line for each case that is not right: case, truth, answer with its probabilities, error; empty if there is none."""
    return "\n".join(
        f"{c.row.key:24s} {_hidden(c):44s} -> {_answer(c)}" for c in cases if not c.is_baseline and _is_miss(c)
    )


def _is_miss(c: Judged) -> bool:
    if c.row.error or c.wrong:
        return True
    if c.kind == "null":
        return c.row.found
    return not (c.form_is_right if c.kind == "unknown" else c.is_right_or_twins or c.limit_is_right)


def _hidden(c: Judged) -> str:
    if c.unknown:
        return f"{c.unknown['kind']} ({', '.join(c.unknown['depends_on'])})"
    return " + ".join(f"{f.key} z {f.z:.1f}" for f in c.row.truth) or "nothing"


def _answer(c: Judged) -> str:
    causes = [f"{x.key} {p:.2f}" for x, p in zip(c.row.causes, c.probability, strict=True)]
    forms = [f"{'/'.join(f.mechanisms)} over {', '.join(sorted(f.depends_on))} {f.probability:.2f}" for f in c.forms]
    return f"{c.row.error or c.row.verdict}: {'; '.join((*causes, *forms)) or '-'}"


def compounds(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 9, as for the blind drives; a case whose separation is not known counts."""
    return worth.compounds([replace(c.row, group="compound") for c in cases if c.kind == "compound"])


def gains(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 10, where there was a held-out drive; the share of the oracle's where a truth knows that."""
    some = [c for c in cases if c.kind == "known" and c.row.truth[0].z >= GAINFUL and math.isfinite(c.row.gain)]
    shares = [c.row.gain / c.row.oracle for c in some if c.row.oracle > 0.0]
    nulls = [c.row.worse for c in cases if c.kind == "null" and math.isfinite(c.row.worse)]
    return [
        share(10, "held-out gain above zero, z >= 6", [c.gain_low > 0.0 for c in some], ">= 0.80", least=20),
        quantity(10, "share of the oracle's gain, median", shares, lambda x: float(np.median(x)), ">= 0.95", least=20),
        quantity(10, "worst channel's error on nulls, largest", nulls, lambda x: float(np.max(x)), "<= +1 %", accept=lambda v: v <= 0.01, least=20),
    ]  # fmt: skip


def unknown(cases: Sequence[Judged]) -> list[Measure]:
    """Metric 11: forms that no effect has; those held back from development by themselves."""
    some = [c for c in cases if c.kind == "unknown"]
    out = [
        share(11, "unexplained", [c.row.verdict == "unexplained" or c.is_accepted for c in some], ">= 0.90", least=40),
        share(11, "with the right mechanism and coordinate", [c.form_is_right for c in some], ">= 0.90", least=40),
        share(11, "with them in part", [c.form_is_near for c in some], "-"),
        share(11, "misnamed", [c.wrong for c in some], "<= 0.05", least=40,
              note=_said([c for c in some if c.wrong])),
    ]  # fmt: skip
    errors = [x for c in some if math.isfinite(x := c.function_error)]
    out += [
        quantity(
            11, "function error of right forms, median", errors, lambda x: float(np.median(x)), "<= 0.15", least=40
        ),
        share(11, "function error of right forms at most 15 %", [x <= 0.15 for x in errors], "-"),
    ]
    for name, group in sorted(by(some, lambda c: str((c.unknown or {})["kind"])).items()):
        text = f"  {name}" + (", held back" if any((c.unknown or {})["held_back"] for c in group) else "")
        note = _missed([c for c in group if not c.form_is_right])
        out.append(share(11, text, [c.form_is_right for c in group], ">= 0.90", least=5, note=note))
    return out


def honesty(cases: Sequence[Judged]) -> list[Measure]:
    """Who never names is never wrong: how often one name is given."""
    strong = _singles(cases, STRONG)
    alone = _isolable(strong)
    return [
        share(0, "one name given, z >= 8", [c.row.single for c in strong], "-"),
        share(0, "one name given, forecast isolable", [c.row.single for c in alone], ">= 0.8", least=100),
    ]


def cost(cases: Sequence[Judged]) -> list[Measure]:
    """Time, memory and failures, as for the blind drives."""
    return worth.speed([c.row for c in cases])


def risk_coverage(cases: Sequence[Judged]) -> list[tuple[float, float, float]]:
    """(evidence asked for, share with one name, share of these that is wrong); see `naming.risk_coverage`."""
    return naming.risk_coverage([replace(c.row, group="named") for c in _singles(cases) if not c.is_baseline])
