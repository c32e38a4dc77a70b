"""The free numbers of the law of water, from a user's own passes: `aqualog calibrate --wet`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from aqualog.calibrate.records import Calibration, Parameter, PassFit
from aqualog.core.errors import ConfigError, FitError, SignalError
from aqualog.core.intervals import student_quantile
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.model.even_wheel import even_slip
from aqualog.model.tyre import TYRE_KEYS, Tyre
from aqualog.trade.wet_passes import SPUN, Told, WetPass, Window, passes_of

__all__ = ["FITTED", "KNOWN", "WaterFit", "calibrate_wet", "check_known", "fit_water"]

KNOWN: Mapping[str, tuple[float, float, str]] = {
    "tread": (0.0, 20.0, "mm"), "pressure": (0.5, 10.0, "bar"), "depth": (0.05, 50.0, "mm"),
}  # fmt: skip
"""What can be given as known of the passes, with bounds and unit; tread and gauge pressure must be."""

FITTED = ("v_anchor", "contact_exponent")
"""Numbers that the passes of one tyre in one state can show; the others are those of the published figures."""

LEAST_PASSES = 4
_SCALES = np.linspace(math.log(0.6), math.log(1.7), 53)  # log of v_anchor over the tyre's, steps of 2 %
_EXPONENTS = np.linspace(math.log(1.2), math.log(8.0), 17)  # log
_ROUNDS, _REACH = 4, 4.0  # each about the estimate of the one before: standard deviations, or steps that are longer
_SCATTERS = (0.01, 0.02, 0.04, 0.08)  # rms of v_full from window to window, relative
_UNIT = 0.003  # [-] slip below which the scale of slips is even, above it logarithmic
_SLIP_SD = 0.0008  # [-] of a window's slip: sensors and the dry ratio
_LATE_S = 0.1  # [s] by which the velocity may be late (K)
_RELATIVE_SD = 0.10  # of a window's slip: the wheel's load and the film (K)
_OUTLIER = 1e-3  # likelihood of a window that no numbers explain
_EVEN_SD = (0.008, 0.06)  # of the logarithms: the balance is on even water, the road is not (`water_study`, D)
_WIDE = {"v_anchor": 0.10, "contact_exponent": 0.5}
"""Half of an interval over its value beyond which a number is not identified."""


def check_known(known: Mapping[str, float]) -> Told:
    """What the user says of the passes, in SI.

    Raises
    ------
    ConfigError
        For an unknown name, an impossible value, and where tread or pressure is missing.
    """
    for name, value in known.items():
        if name not in KNOWN:
            raise ConfigError(f'fix "{name}" is not known of passes over water', expected=", ".join(KNOWN))
        low, high, unit = KNOWN[name]
        if not low <= value <= high:
            raise ConfigError(f"fix {name}={value:g}", expected=f"a value between {low:g} and {high:g} {unit}")
    missing = [n for n in ("tread", "pressure") if n not in known]
    if missing:
        raise ConfigError(
            f"{' and '.join(missing)} of the tyres not given", expected="tread in mm, pressure in bar",
            hint="--fix tread=1.6 --fix pressure=2.2",
        )  # fmt: skip
    return Told(1e-3 * known.get("depth", math.nan), 1e-3 * known["tread"], 1e5 * known["pressure"])


def calibrate_wet(
    drives: Sequence[Signals], names: Sequence[str], vehicle: Vehicle, known: Mapping[str, float]
) -> Calibration:
    """Fit the law of water to passes over water.

    Parameters
    ----------
    drives : sequence of Signals
        Each with at least one watered stretch and a dry second before it.
    names : sequence of str
        Of the drives, for messages.
    vehicle : Vehicle
    known : mapping
        Names of `KNOWN`: `tread` [mm], `pressure` [bar], and `depth` [mm] where the logs lack it.

    Returns
    -------
    Calibration

    Raises
    ------
    ConfigError, SignalError, FitError
        As `check_known` and `fit_water`.
    """
    told = check_known(known)
    by_drive = {n: passes_of(s, vehicle, n, told) for s, n in zip(drives, names, strict=True)}
    passes = [w for own in by_drive.values() for w in own]
    file_values = {n: w.value for n, w in vehicle.water.items()}
    tyre = replace(Tyre(), tread_depth=told.tread, **file_values)  # type: ignore[arg-type]
    fit = fit_water(passes, vehicle, tyre, p=told.p)
    notes = [f"{fit.lost} of {len(fit.used)} passes lose a front wheel; v_full scatters by {100 * fit.scatter:.0f} %"]
    notes += [f"{n}: no watered stretch" for n, own in by_drive.items() if not own]
    own = [f"{w.name} {1e3 * w.windows[0].h_w:.2g} mm" for w in passes if w.windows and w.windows[0].h_w != told.depth]
    if math.isfinite(told.depth) and own:
        notes.append(f"the logs' own water depth counts, not the given one: {', '.join(own[:3])}")
    if "tyre.slip_slope_f" not in vehicle.given:
        notes.append(
            "the vehicle file does not give tyre.slip_slope_f: the default is taken as exact; see `slip-slope`"
        )
    return Calibration(
        vehicle.name, fit.parameters, (), dict(known), fit.cannot_tell, tuple(notes),
        passes=tuple(_pass_fit(w) for w in passes),
    )  # fmt: skip


def _pass_fit(w: WetPass) -> PassFit:
    if not w.windows:
        return PassFit(w.name, math.nan, math.nan, math.nan, 0, w.why)
    lost = [x.v for x in w.windows if x.is_lost]
    v, h_w = (float(np.mean([x[i] for x in w.windows])) for i in (0, 1))
    return PassFit(w.name, v, min(lost, default=math.nan), h_w, len(w.windows))


_Grid = tuple[FloatArray, FloatArray]
"""Logarithms of the scale and of the exponent, evenly spaced."""


class _Posterior(NamedTuple):
    """Mean and standard deviation of the logarithms of scale and exponent, (2,) each; mean of the scatter."""

    mean: FloatArray
    sd: FloatArray
    scatter: float


@dataclass(frozen=True, slots=True)
class WaterFit:
    """Numbers with intervals, the passes that count and those that do not, and what the passes do not show.

    `scatter`: rms of the speed of full aquaplaning from window to window, relative. `lost`: passes with a wheel that
    floats.
    """

    parameters: tuple[Parameter, ...]
    used: tuple[WetPass, ...]
    left_out: tuple[WetPass, ...]
    scatter: float
    lost: int
    cannot_tell: tuple[str, ...]


def fit_water(passes: Sequence[WetPass], vehicle: Vehicle, tyre: Tyre, *, p: float) -> WaterFit:
    """Fit `FITTED` to passes of one tyre.

    Parameters
    ----------
    passes : sequence of WetPass
    vehicle : Vehicle
        Slip slope and friction on the dry road, loads, radii.
    tyre : Tyre
        All other numbers of the law; its tread is that of the passes.
    p : float
        Inflation pressure. [Pa]

    Returns
    -------
    WaterFit

    Raises
    ------
    SignalError
        Without any pass over water.
    FitError
        If fewer than `LEAST_PASSES` passes have windows.

    The slip of a front wheel on even water follows from the balance of its torques (`even_slip`). A window's speed of
    full aquaplaning scatters about the law's; the likelihood is the mean over that. Estimates are means of the
    posterior over a grid, flat in the logarithms. Intervals: the larger of its standard deviation and that of a
    jackknife over passes, with Student's t, and on top of it what an uneven road does to the balance. The slip slope
    of the vehicle file is taken as exact.

    Source: the balance of `model/wheel.py`; jackknife as in `calibrate`.
    """
    used = tuple(w for w in passes if w.windows)
    left_out = tuple(w for w in passes if not w.windows)
    if not passes:
        raise SignalError(
            "no pass over water in the logs", expected="on_water, or a water depth, in each log",
            hint="a signal map that names one of them; dry drives go without --wet",
        )  # fmt: skip
    if len(used) < LEAST_PASSES:
        why = "; ".join(f"{w.name}: {w.why}" for w in left_out[:3])
        raise FitError(
            f"{len(used)} of {len(passes)} passes over water can be used" + (f" ({why})" if why else ""),
            expected=f"at least {LEAST_PASSES}, at several speeds up to a wheel that stops",
        )

    def over(grid: _Grid) -> FloatArray:
        return np.stack([_likelihood(w.windows, vehicle, tyre, p, grid) for w in used])

    grid: _Grid = (_SCALES, _EXPONENTS)
    each = over(grid)
    edges = _at_edges(each.sum(axis=0))
    for _ in range(_ROUNDS - 1):
        grid = _finer(grid, _posterior(each.sum(axis=0), grid))
        each = over(grid)
    total = each.sum(axis=0)
    whole, sd, scatter = _posterior(total, grid)
    left = np.array([_posterior(total - one, grid).mean for one in each])
    n = len(used)
    jack = np.sqrt((n - 1.0) / n * ((left - left.mean(axis=0)) ** 2).sum(axis=0))
    half = np.hypot(student_quantile(0.975, n - 1.0) * np.maximum(sd, jack), 1.96 * np.array(_EVEN_SD))
    logs = whole + np.log([tyre.v_anchor, 1.0])
    parameters = tuple(
        _parameter(name, float(logs[i]), float(half[i]), tyre, at_edge=edges[i]) for i, name in enumerate(FITTED)
    )
    told = tuple(f"{q.name}: {q.why_not}" for q in parameters if not q.identified)
    lost = sum(any(w.is_lost for w in x.windows) for x in used)
    return WaterFit(parameters, used, left_out, scatter, lost, told)


def _parameter(name: str, log: float, half: float, tyre: Tyre, *, at_edge: bool) -> Parameter:
    value, low, high = (math.exp(x) for x in (log, log - half, log + half))
    why = ""
    if at_edge:
        why = "no pass comes near floating, or all do; drive from partial to full aquaplaning"
    elif half > _WIDE[name]:
        why = f"known to {100 * half:.0f} % only; more passes between partial and full aquaplaning are needed"
    key = TYRE_KEYS[name]
    remark = "" if why else "from passes over water, by this law; slip slope and friction as in the vehicle file"
    return Parameter(name, value, (low, high), key.unit, not why, why, remark, float(getattr(tyre, name)))


def _likelihood(windows: Sequence[Window], vehicle: Vehicle, tyre: Tyre, p: float, grid: _Grid) -> FloatArray:
    """Log-likelihood of a pass over (scatter, scale, exponent)."""
    log_scale, log_exponent = grid
    table = np.array([w[:5] for w in windows])
    v, h_w, F_z, demand, slip = table.T
    lost = np.array([w.is_lost for w in windows])
    y = np.arcsinh(slip / _UNIT)
    late = np.abs([w.a for w in windows]) * _LATE_S / v
    sd = np.hypot(_RELATIVE_SD * np.abs(slip), np.hypot(_SLIP_SD, late)) / np.hypot(slip, _UNIT)
    out = np.empty((len(_SCATTERS), log_scale.size, log_exponent.size))
    kernels = [np.exp(-0.5 * ((log_scale[:, None] - log_scale[None]) / s) ** 2) for s in _SCATTERS]
    for j, n in enumerate(np.exp(log_exponent)):
        own = replace(tyre, contact_exponent=float(n))
        s = even_slip(own, vehicle, v, h_w, F_z, p=p, demand=demand, scales=np.exp(log_scale))
        floats = ~(s <= SPUN)
        z = (np.arcsinh(np.where(floats, -1.0, s) / _UNIT) - y[:, None]) / sd[:, None]
        density = np.where(
            lost[:, None], floats, ~floats * np.exp(-0.5 * np.minimum(z * z, 200.0)) / (2.5 * sd[:, None])
        )
        for k, kernel in enumerate(kernels):
            smooth = density @ (kernel / kernel.sum(axis=1, keepdims=True)).T
            out[k, :, j] = np.log(smooth + _OUTLIER).sum(axis=0)
    return out


def _posterior(log_likelihood: FloatArray, grid: _Grid) -> _Posterior:
    """Of a likelihood over (scatter, scale, exponent)."""
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    shares = weight.sum(axis=(0, 2)), weight.sum(axis=(0, 1))
    mean = np.array([share @ x for x, share in zip(grid, shares, strict=True)])
    square = [share @ (x - m) ** 2 + (x[1] - x[0]) ** 2 / 12.0 for x, m, share in zip(grid, mean, shares, strict=True)]
    return _Posterior(mean, np.sqrt(square), float(weight.sum(axis=(1, 2)) @ _SCATTERS))


def _finer(grid: _Grid, found: _Posterior) -> _Grid:
    """The same number of values about the estimate: steps of 12 % of the exponent move the scale by 3 %."""
    beside = (2.5 * found.scatter, 0.0)  # speeds that scatter into the range
    ends = [(x[0], x[-1], _REACH * max(s, x[1] - x[0]) + b) for x, s, b in zip(grid, found.sd, beside, strict=True)]
    fine = [
        np.linspace(max(m - r, a), min(m + r, b), x.size)
        for x, m, (a, b, r) in zip(grid, found.mean, ends, strict=True)
    ]
    return fine[0], fine[1]


def _at_edges(log_likelihood: FloatArray) -> tuple[bool, bool]:
    """Whether much of the posterior of scale and exponent lies at the end of its range."""
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    shares = weight.sum(axis=(0, 2)), weight.sum(axis=(0, 1))
    return tuple(bool(s[0] + s[-1] > 0.05) for s in shares)  # type: ignore[return-value]
