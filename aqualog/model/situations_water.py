"""Situations in which a car aquaplanes, at least in part."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aqualog.model.drawing import KMH, Drawing, Taken, full_speed, slalom_angle
from aqualog.model.scenario import Lane, Profile, Scenario, Steering
from aqualog.model.term import Model
from aqualog.physics.load import G

__all__ = ["MAKERS"]

V_FULL = (70.0 * KMH, 145.0 * KMH)  # [m/s] tyre, water and pressure that a road car can aquaplane on
LANE_S = (1.5, 10.0)  # [s]
FLOATING_S = (1.5, 3.5)  # near and above full aquaplaning: who stays longer spins
APPROACH_S = (10.0, 20.0)  # dry road before it
RUN_OUT_S = 6.0


def _water(k: Drawing, deeper: float = 1.0) -> tuple[Drawing, float, float]:
    """A drawing whose tyre aquaplanes at a speed that can be driven, the depth of the water [m], and that speed."""
    tyres = [t for t in k.pool.tyres for _ in k.pool.depths]
    pairs = [(t, h * deeper, p) for t, h in zip(tyres, k.pool.depths * len(k.pool.tyres), strict=True)
             for p in k.pool.pressures]  # fmt: skip
    fit = [x for x in pairs if V_FULL[0] <= full_speed(replace(k, tyre=x[0], p=x[2]), x[1]) <= V_FULL[1]]
    tyre, depth, p = k.one_of(*fit)
    k = replace(k, tyre=tyre, p=p)
    return k, depth, full_speed(k, depth)


def _lane(k: Drawing, start_m: float, length: float, depth: float, **given: Any) -> Lane:
    """A lane as on a proving ground: the left track has less water and less even (thesis 2.1)."""
    usual = {
        "depth_left": depth * k.between(0.6, 1.0), "depth_right": depth,
        "irregularity_left": k.between(0.05, 0.5), "irregularity_right": k.between(0.03, 0.15),
    }  # fmt: skip
    return Lane(start_m, start_m + length, in_metres=True, **{**usual, **given})


def _through(
    k: Drawing, depth: float, v: float, v_full: float, a: float = 0.0, before: float = 0.0, **given: Any
) -> tuple[Scenario, str]:
    """Through a lane that is met at the speed v [m/s], at the acceleration a on it and `before` ahead of it. [m/s²]"""
    approach = k.between(*APPROACH_S)
    on_lane = k.between(*(LANE_S if v + max(a, 0.0) * LANE_S[1] < v_full - 10.0 * KMH else FLOATING_S))
    v_0 = v - before * 5.0
    v_end = max(v + a * on_lane, 5.0)
    t = approach + on_lane
    speed: Profile = ((0.0, v_0), (approach - 5.0, v_0), (approach, v), (t, v_end), (t + RUN_OUT_S, v_end))
    start = v_0 * (approach - 5.0) + 2.5 * (v_0 + v)
    lane_given = given.pop("lane", {})
    length = lane_given.pop("length", 0.5 * (v + v_end) * on_lane)
    lane = _lane(k, start, length, depth, **lane_given)
    scenario = k.drive(t + RUN_OUT_S, speed, lanes=(lane,), **given)
    return scenario, f"{k.tyre.name}, {lane.depth_right * 1e3:.1f} mm, entry at {v / KMH:.0f} km/h"


def _below(k: Drawing, v_full: float, low: float = -40.0, high: float = 10.0) -> float:
    return max(v_full + k.between(low, high) * KMH, 40.0 * KMH)


def _constant(k: Drawing) -> Taken:
    k, depth, v_full = _water(k)
    scenario, note = _through(k, depth, _below(k, v_full), v_full)
    return Taken(scenario, Model(), note)


def _accelerating(k: Drawing) -> Taken:
    k, depth, v_full = _water(k)
    a = k.between(0.5, 1.5)
    scenario, note = _through(k, depth, _below(k, v_full, -30.0, 0.0), v_full, a, before=a)
    return Taken(scenario, Model(), f"{note}, {a:.1f} m/s^2")


def _coasting(k: Drawing) -> Taken:
    k, depth, v_full = _water(k)
    a = -k.between(0.2, 0.8)
    scenario, note = _through(k, depth, _below(k, v_full, -20.0, 10.0), v_full, a, before=a)
    return Taken(scenario, Model(), f"{note}, {a:.1f} m/s^2")


def _slalom(k: Drawing) -> Taken:
    k, depth, v_full = _water(k)
    v = _below(k, v_full, -30.0, 5.0)
    a_y = k.between(1.0, 2.0)
    steering = Steering(slalom_angle(k.vehicle, k.tyre, v, a_y), k.between(3.0, 5.0), 2.0)
    scenario, note = _through(k, depth, v, v_full, steering=steering)
    return Taken(scenario, Model(), f"{note}, {a_y:.1f} m/s^2 to the side")


def _one_sided(k: Drawing) -> Taken:
    k, depth, v_full = _water(k)
    side = k.one_of("left", "right")
    dry = {f"depth_{'right' if side == 'left' else 'left'}": 0.0, f"depth_{side}": depth}
    scenario, note = _through(k, depth, _below(k, v_full, -25.0, 10.0), v_full, lane=dry)
    return Taken(scenario, Model(), f"{note}, water on the {side}")


def _puddle(k: Drawing) -> Taken:
    k, depth, v_full = _water(k, 1.25)
    length = k.between(5.0, 15.0)
    scenario, note = _through(k, depth, _below(k, v_full, -20.0, 10.0), v_full, lane={"length": length})
    return Taken(scenario, Model(), f"{note}, {length:.0f} m long")


def _uneven(k: Drawing) -> Taken:
    k, depth, v_full = _water(k)
    rms = {"irregularity_left": k.between(0.5, 1.0), "irregularity_right": k.between(0.4, 0.9)}
    scenario, note = _through(k, depth, _below(k, v_full, -30.0, 10.0), v_full, lane=rms)
    return Taken(scenario, Model(), note)


def _deep(k: Drawing) -> Taken:
    k, depth, v_full = _water(k, 2.0)
    scenario, note = _through(k, depth, _below(k, v_full, 15.0, 30.0), v_full, lane={"depth_left": depth * 0.9})
    return Taken(scenario, Model(), note)


def _foot_off(k: Drawing) -> Taken:
    k, depth, v_full = _water(k)
    v = _below(k, v_full, -25.0, 10.0)
    scenario, note = _through(k, depth, v, v_full, -0.4)
    t_lane, t_out = scenario.speed[2][0], scenario.speed[3][0]
    drag = 0.015 * k.vehicle.mass * G * k.vehicle.r_l_r  # [N m] of an engine in a high gear (K)
    share = ((0.0, 1.0), (t_lane - 1.0, 1.0), (t_lane - 0.7, 0.0), (t_out, 0.0), (t_out + 1.0, 1.0))
    engine = ((t_lane - 1.0, 0.0), (t_lane - 0.7, -drag), (t_out, -drag), (t_out + 1.0, 0.0))
    return Taken(replace(scenario, drive_share=share, extra_torque=engine), Model(), f"{note}, foot off")


MAKERS = {
    "lane_constant": ("constant speed through a watered lane", _constant),
    "lane_accelerating": ("accelerating into and on the lane", _accelerating),
    "lane_coasting": ("slowing down through the lane", _coasting),
    "lane_slalom": ("slalom on the lane", _slalom),
    "lane_one_sided": ("water under the wheels of one side", _one_sided),
    "puddle": ("a puddle of 5 to 15 m", _puddle),
    "lane_uneven": ("water of very uneven depth", _uneven),
    "lane_deep": ("into deep water far above full aquaplaning", _deep),
    "lane_foot_off": ("on the lane without the foot on the pedal", _foot_off),
}
