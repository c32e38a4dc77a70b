"""Active excitation: waveforms against their definitions, forces that cancel, and the purpose of negative forces."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.model.excitation import WAVEFORMS, axle_forces, f_step, waveform
from aqualog.model.scenario import Waveform
from aqualog.thesis.claims import NEEDS_DATA, Check, Checks, judge, limit
from aqualog.thesis.evidence.half_car import Case, drive, estimate, first_alarm, is_used
from aqualog.thesis.evidence.seeds import Maker, Plan

__all__ = ["CHECKS"]

_N = 20_000
_EXACT = limit("exact")
_TAU = 8.0  # [s]


def _polyline(t: FloatArray, period: float, knots: tuple[tuple[float, float], ...]) -> FloatArray:
    """A periodic line through knots (share of the period, value)."""
    phase = (t / period) % 1.0
    return np.interp(phase, [k for k, _ in knots], [v for _, v in knots])


_TRIANGLE = ((0.0, 0.0), (0.25, 1.0), (0.5, 0.0), (0.75, -1.0), (1.0, 0.0))
_RAMP = ((0.0, 0.0), (1 / 6, 1.0), (1 / 3, 1.0), (2 / 3, -1.0), (5 / 6, -1.0), (1.0, 0.0))


def _sine(t: FloatArray, period: float) -> FloatArray:
    """Sine by its power series, so that no library's sine is compared with itself."""
    x = 2.0 * np.pi * ((t / period + 0.5) % 1.0 - 0.5)
    term, total = x.copy(), x.copy()
    for k in range(1, 16):
        term = -term * x * x / ((2 * k) * (2 * k + 1))
        total = total + term
    return total


def _step(t: FloatArray, period: float) -> FloatArray:
    """1 in the first half of the period, -1 in the second."""
    return np.where((t / period) % 1.0 < 0.5, 1.0, -1.0)


def _waveforms(plan: Plan) -> Checks:
    rng = np.random.default_rng(plan.seeds[0])
    times = rng.uniform(-100.0, 100.0, (40, _N // 40))
    periods = [float(x) for x in 10.0 ** rng.uniform(-0.3, 1.8, 40)]
    even = (np.arange(60_000) + 0.5) / 60_000 * _TAU
    rms = {w: float(np.sqrt(np.mean(waveform(w, even, period=_TAU) ** 2))) for w in get_args(Waveform)}

    def worst(made: Callable[..., FloatArray], wanted: Callable[[FloatArray, float], FloatArray]) -> float:
        return max(float(np.abs(made(t, period=p) - wanted(t, p)).max()) for t, p in zip(times, periods, strict=True))

    def check(claim: str, name: str, wanted: Callable[[FloatArray, float], FloatArray], want_rms: float) -> Check:
        deviation = worst(WAVEFORMS[name], wanted)
        whole = deviation < _EXACT and abs(rms[name] - want_rms) < 1e-3
        outcome = (
            f"{deviation:.1e} over {_N} random times and periods from 0.5 to 63 s; root mean square {rms[name]:.3f}"
        )
        return judge(f"{claim}.half_car", outcome, whole=whole, value=deviation)

    ours = worst(f_step, _step)
    printed = worst(partial(f_step, printed_phase=True), lambda t, p: -_step(t, p))
    exact = ours == 0.0 and rms["step"] == 1.0
    outcome = (
        f"deviation {ours:.1e} over {_N} random times; 3.38 as printed is the opposite at all of them (deviation "
        f"{printed:.1e}); root mean square {rms['step']:.3f}"
    )
    return (
        check("C100", "triangle", partial(_polyline, knots=_TRIANGLE), 3.0**-0.5),
        check("C101", "sine", _sine, 0.5**0.5),
        check("C102", "ramp", partial(_polyline, knots=_RAMP), 5.0**0.5 / 3.0),
        judge("C103.half_car", outcome, whole=False, part=exact, value=ours),
    )


def _sums(plan: Plan) -> Check:
    rng = np.random.default_rng(plan.seeds[0])
    F, E, nus = rng.uniform(-5e3, 5e3, _N), rng.uniform(-2e3, 2e3, _N), rng.uniform(0.0, 1.0, 200)
    worst = front = 0.0
    for k, nu in enumerate(nus):
        f, e = F[100 * k : 100 * k + 100], E[100 * k : 100 * k + 100]
        F_f, F_r = axle_forces(f, e, nu=float(nu))
        worst = max(worst, float(np.abs(F_f + F_r - f).max()))
        # the difference of the axles moves by twice the excitation
        F_0, R_0 = axle_forces(f, 0.0 * e, nu=float(nu))
        front = max(front, float(np.abs((F_f - F_r) - (F_0 - R_0) - 2.0 * e).max()))
    whole = max(worst, front) < 1e-8
    outcome = f"{worst:.1e} N and {front:.1e} N over {_N} random forces, excitations and splits"
    return judge("C97.half_car_forces", outcome, whole=whole, value=worst)


def _negative_forces(_: Plan) -> Check:
    """C116: constant speed needs little force; excitation with positive forces alone and with negative ones."""
    rows = {}
    for kind, amplitude in (("relative", 1.0), ("mu", 0.05)):
        case = Case("sine", amplitude, kind, 8.0, a_x=0.0)
        d, e = drive(case), estimate(case)
        least = float(min(d.F_x_f.min(), d.F_x_r.min()))
        rows[kind] = (first_alarm(d, e), least, float(is_used(e)[d.t < 0.0].mean()))
    positive, negative = rows["relative"], rows["mu"]
    found = np.isfinite(negative[0]) and negative[0] < 8.0
    missed = not np.isfinite(positive[0]) or positive[0] > 2.0 * negative[0]
    whole = bool(found and missed and negative[1] < 0.0 <= positive[1] + 1.0)

    def text(x: float) -> str:
        return f"after {x:.2f} s" if np.isfinite(x) else "not within 20 s"

    outcome = (
        f"with negative forces (down to {negative[1]:.0f} N) {text(negative[0])}, {100 * negative[2]:.0f} % of "
        f"the dry samples used; positive only (least {positive[1]:.0f} N) {text(positive[0])}, "
        f"{100 * positive[2]:.0f} % used"
    )
    part = bool(found and not positive[0] <= negative[0])
    return judge("C116.half_car", outcome, whole=whole, part=part, value=negative[0] if found else None)


_NO_DRIVE = (
    "no such drive is at hand; what the method finds in simulated drives with series sensors is C112, C113, C115"
)

CHECKS = (
    Maker(("C97",), _sums),
    Maker(("C100", "C101", "C102", "C103"), _waveforms),
    Maker(("C116",), _negative_forces),
    Maker(("C117",), lambda _: judge("C117.half_car", _NO_DRIVE, verdict=NEEDS_DATA)),
)
