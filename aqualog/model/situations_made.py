"""How each situation is driven: those in which a car aquaplanes, and those in which no wheel floats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from aqualog.core.notation import WHEELS
from aqualog.model.drawing import KMH, Drawing, Taken, full_speed, lagging_torque, slalom_angle, terms
from aqualog.model.scenario import Kick, Lane, Profile, Scenario, Steering, Surface
from aqualog.model.sensors import ESC, SensorFault
from aqualog.model.term import Model
from aqualog.physics.load import G

__all__ = ["DRY", "FAULTS", "WATER", "Makers"]

Makers = dict[str, tuple[str, Callable[[Drawing], Taken]]]  # name -> title, and what makes the drive of a drawing

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


def _lane_slalom(k: Drawing) -> Taken:
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
    drag = 0.015 * k.vehicle.mass * G * k.vehicle.r_e_r  # [N m] of an engine in a high gear (K)
    share = ((0.0, 1.0), (t_lane - 1.0, 1.0), (t_lane - 0.7, 0.0), (t_out, 0.0), (t_out + 1.0, 1.0))
    engine = ((t_lane - 1.0, 0.0), (t_lane - 0.7, -drag), (t_out, -drag), (t_out + 1.0, 0.0))
    return Taken(replace(scenario, drive_share=share, extra_torque=engine), Model(), f"{note}, foot off")


WATER: Makers = {
    "lane_constant": ("constant speed through a watered lane", _constant),
    "lane_accelerating": ("accelerating into and on the lane", _accelerating),
    "lane_coasting": ("slowing down through the lane", _coasting),
    "lane_slalom": ("slalom on the lane", _lane_slalom),
    "lane_one_sided": ("water under the wheels of one side", _one_sided),
    "puddle": ("a puddle of 5 to 15 m", _puddle),
    "lane_uneven": ("water of very uneven depth", _uneven),
    "lane_deep": ("into deep water far above full aquaplaning", _deep),
    "lane_foot_off": ("on the lane without the foot on the pedal", _foot_off),
}


NONE = Model()


def _cruise(k: Drawing, low: float, high: float, *, spread: float = 0.08, **given: Any) -> Taken:
    duration, v = k.between(60.0, 120.0), k.between(low, high) * KMH
    scenario = k.drive(duration, k.cruise(duration, v, spread=spread), **given)
    return Taken(scenario, NONE, f"about {v / KMH:.0f} km/h")


def _wind_shelter(k: Drawing) -> Taken:
    """A steady head wind that pauses behind woods and lorries for 5 to 15 s."""
    wind, t = k.rng.uniform(8.0, 12.0), 25.0
    profile = [(0.0, wind)]
    while t < 110.0:
        lee = k.rng.uniform(5.0, 15.0)
        profile += [(t, wind), (t + 1.0, 0.2 * wind), (t + lee, 0.2 * wind), (t + lee + 1.0, wind)]
        t += lee + k.rng.uniform(15.0, 40.0)
    return _cruise(k, 80.0, 120.0, wind=tuple(profile))


def _on(
    k: Drawing,
    name: str,
    friction: tuple[float, float] | None,
    low: float,
    high: float,
    *,
    rolling: tuple[float, float] | None = None,
    roughness: tuple[float, float] | None = None,
    hills: float | None = None,
    spread: float = 0.08,
) -> Taken:
    """All the way on one surface, whose properties are drawn between two."""
    drawn = {n: k.between(*ends) for n, ends in (("rolling", rolling), ("roughness", roughness)) if ends}
    surface = k.surface(name, friction, **drawn)
    given = {} if hills is None else {"grade": k.hills(hills)}
    lanes = (Lane(0.0, 1e5, in_metres=True, surface=surface),)
    taken = _cruise(k, low, high, spread=spread, lanes=lanes, **given)
    return taken._replace(note=f"{taken.note}, {_told(surface)}")


def _told(surface: Surface) -> str:
    return surface.name + ("" if surface.mu is None else f" of mu {surface.mu:.2f}")


def _snow_entry(k: Drawing) -> Taken:
    """From a cleared road onto snow, at a steady speed, gently faster or slower."""
    v, a = k.between(60.0, 100.0) * KMH, k.between(-0.5, 0.3)
    entry, stay = k.between(15.0, 30.0), k.between(5.0, 25.0)
    surface = k.surface("snow", k.pool.snow)
    speed: Profile = ((0.0, v), (entry, v), (entry + stay, max(v + a * stay, 10.0)))
    scenario = k.drive(entry + stay + 10.0, speed, lanes=(Lane(entry, entry + stay, surface=surface),))
    return Taken(scenario, NONE, f"{_told(surface)} from {entry:.0f} s at {v / KMH:.0f} km/h")


def _split(k: Drawing) -> Taken:
    """Snow or ice under the wheels of one side, asphalt under the others: a road that is half cleared."""
    name = k.one_of("snow", "ice")
    low, dry = k.surface(name, k.pool.snow if name == "snow" else k.pool.ice), k.surface("asphalt")
    left, right = k.one_of((low, dry), (low, dry), (dry, low))
    duration, v = k.between(40.0, 80.0), k.between(40.0, 80.0) * KMH
    lanes = tuple(
        Lane(t, t + k.between(5.0, 12.0), surface=left, surface_right=right)
        for t in (k.between(10.0, 14.0), k.between(27.0, 30.0))
    )
    scenario = k.drive(duration, k.cruise(duration, v), lanes=lanes)
    return Taken(scenario, NONE, f"{_told(low)} {'left' if left is low else 'right'}, {v / KMH:.0f} km/h")


def _braking(
    k: Drawing, name: str, friction: tuple[float, float] | None, demand: float, *, antilock: bool = True
) -> Taken:
    """Two stops, or nearly; the driver requests `demand` of the available friction."""
    surface = k.surface(name, friction)
    mu = 1.0 if surface.mu is None else surface.mu
    v, low = k.between(70.0, 110.0) * KMH if mu > 0.5 else k.between(50.0, 80.0) * KMH, 10.0 * KMH
    a = min(demand, 0.85) * mu * G
    seconds = (v - low) / a
    torque = demand * mu * k.vehicle.mass * G * k.vehicle.r_e_f
    start, points, brake, t = k.between(8.0, 15.0), [(0.0, v)], [(0.0, 0.0)], 0.0
    for t_0 in (start, start + seconds + 25.0):
        t = t_0 + seconds
        points += [(t_0, v), (t, low), (t + 2.0, low), (t + 2.0 + (v - low) / min(2.0, 0.4 * mu * G), v)]
        brake += [(t_0, 0.0), (t_0 + 0.2, torque), (t, torque), (t + 0.2, 0.0)]
        if points[-1][0] > start + seconds + 25.0:
            break  # on a slippery road it takes long to be fast again: one stop
    scenario = k.drive(
        max(points[-1][0], t) + 5.0, tuple(points), brake_torque=tuple(brake), antilock=antilock,
        lanes=() if surface.name == "asphalt" else (Lane(0.0, 1e5, in_metres=True, surface=surface),),
    )  # fmt: skip
    return Taken(scenario, NONE, f"{_told(surface)}, from {v / KMH:.0f} km/h")


def _hard_acceleration(k: Drawing) -> Taken:
    a, v_0, v_1 = k.between(2.5, 4.0), k.between(15.0, 40.0) * KMH, k.between(90.0, 130.0) * KMH
    t, t_1 = k.between(5.0, 10.0), (v_1 - v_0) / k.between(2.5, 4.0)
    speed: Profile = ((0.0, v_0), (t, v_0), (t + t_1, v_1), (t + t_1 + 10.0, v_1), (t + t_1 + 25.0, v_0 + 5.0))
    speed += ((t + t_1 + 30.0, v_0 + 5.0), (t + t_1 + 35.0, min(v_0 + 5.0 + 5.0 * a, v_1)))
    return Taken(k.drive(speed[-1][0] + 5.0, speed), NONE, f"{a:.1f} m/s^2")


def _gear_shifts(k: Drawing) -> Taken:
    """Torque that breaks off and comes back a little too high, three to six times, reported late."""
    n, share, t = int(k.rng.integers(3, 7)), [(0.0, 1.0)], k.between(6.0, 10.0)
    for _ in range(n):
        gap, over = k.between(0.2, 0.6), k.between(1.05, 1.3)
        share += [(t, 1.0), (t + 0.08, 0.0), (t + gap, 0.0), (t + gap + 0.15, over), (t + gap + 0.5, 1.0)]
        t += k.between(3.0, 7.0)
    v_0, a = k.between(20.0, 40.0) * KMH, k.between(0.8, 2.0)
    v_1 = min(v_0 + a * (t - 5.0), 140.0 * KMH)
    speed: Profile = ((0.0, v_0), (4.0, v_0), (4.0 + (v_1 - v_0) / a, v_1))
    sensors = lagging_torque(ESC, k.between(0.05, 0.15))
    scenario = k.drive(t + 10.0, speed, drive_share=tuple(share), sensors=sensors)
    return Taken(scenario, NONE, f"{n} shifts, {a:.1f} m/s^2")


def _cornering(k: Drawing) -> Taken:
    v, a_y = k.between(50.0, 90.0) * KMH, k.between(0.7, 0.9) * G
    steering = Steering(1.1 * slalom_angle(k.vehicle, k.tyre, v, a_y), k.between(10.0, 16.0), k.between(4.0, 8.0))
    scenario = k.drive(k.between(40.0, 60.0), ((0.0, v),), steering=steering)
    return Taken(scenario, NONE, f"{a_y / G:.2f} g at {v / KMH:.0f} km/h")


def _stop_and_go(k: Drawing) -> Taken:
    points, t = [(0.0, 30.0 * KMH), (5.0, 30.0 * KMH)], 5.0
    while t < 80.0:
        v = k.between(15.0, 50.0) * KMH
        down, stand, up = points[-1][1] / k.between(0.8, 2.0), k.between(2.0, 8.0), v / k.between(0.8, 1.8)
        points += [(t + down, 0.0), (t + down + stand, 0.0), (t + down + stand + up, v)]
        t = points[-1][0] + k.between(2.0, 8.0)
        points.append((t, v))
    return Taken(k.drive(t + 3.0, tuple(points)), NONE, "")


def _standstill(k: Drawing) -> Taken:
    """Waiting, a short way, waiting."""
    wait, v = k.between(10.0, 20.0), k.between(20.0, 40.0) * KMH
    points = ((0.0, 0.0), (wait, 0.0), (wait + v, v), (wait + v + 8.0, v), (wait + 2.0 * v + 8.0, 0.0))
    return Taken(k.drive(points[-1][0] + wait, points, grade=()), NONE, "")


def _roof_box(k: Drawing) -> Taken:
    """Four passengers and a box on the roof; the vehicle file knows neither."""
    taken = _cruise(k, 80.0, 130.0)
    people = k.between(220.0, 330.0)
    box = {"delta_drag_area": k.between(0.1, 0.25)}
    scenario = replace(taken.scenario, load_front=0.45 * people, load_rear=0.55 * people)
    return Taken(scenario, terms(("aero_drag", box, None)), f"{taken.note}, {people:.0f} kg")


def _trailer(k: Drawing) -> Taken:
    taken = _cruise(k, 70.0, 100.0, spread=0.12)
    mass = k.between(500.0, 1200.0)
    model = terms(("trailer", {"mass": mass, "delta_drag_area": k.between(0.5, 1.5)}, None))
    return Taken(replace(taken.scenario, load_rear=60.0), model, f"{taken.note}, {mass:.0f} kg in tow")


DRY: Makers = {
    "dry_cruise": ("dry country road", lambda k: _cruise(k, 60.0, 110.0, spread=0.15)),
    "motorway": (
        # gusts of 3 m/s rms behind lorries, faster than those of the weather (K)
        "dry motorway in the turbulence of others",
        lambda k: _cruise(k, 110.0, 140.0, wind=k.gusts(125.0, 3.0, mean=k.between(-3.0, 3.0), every_s=1.0)),
    ),
    "hilly": (
        "grades of up to 8 %",
        lambda k: _cruise(k, 50.0, 90.0, grade=k.hills(0.05, every_m=k.between(60.0, 150.0))),
    ),
    "head_wind": ("a head wind of 10 m/s", lambda k: _cruise(k, 80.0, 120.0, head_wind=10.0, wind=k.gusts(125.0, 2.0))),
    "wind_shelter": ("a head wind that pauses behind woods and lorries", _wind_shelter),
    "damp": ("a damp road without a layer of water", lambda k: _on(k, "damp", k.pool.damp, 70.0, 120.0, spread=0.12)),
    "snow_entry": ("onto snow at speed", _snow_entry),
    "snow": ("snow from the start", lambda k: _on(k, "snow", k.pool.snow, 40.0, 80.0)),
    "deep_snow": ("deep snow", lambda k: _on(k, "deep_snow", k.pool.snow, 30.0, 60.0, rolling=(0.02, 0.04))),
    "ice": ("dry ice", lambda k: _on(k, "ice", k.pool.ice, 30.0, 60.0, hills=0.005)),
    "wet_ice": ("wet ice", lambda k: _on(k, "wet_ice", k.pool.wet_ice, 20.0, 50.0, spread=0.04, hills=0.002)),
    "gravel": ("gravel", lambda k: _on(k, "gravel", (0.5, 0.7), 40.0, 80.0)),
    "rough_asphalt": ("broken asphalt", lambda k: _on(k, "rough", None, 50.0, 100.0, roughness=(40.0, 80.0))),
    "split_friction": ("snow or ice under one side", _split),
    "abs_dry": ("antilock braking on dry asphalt", lambda k: _braking(k, "asphalt", None, 1.3)),
    "abs_damp": ("antilock braking on a damp road", lambda k: _braking(k, "damp", k.pool.damp, 1.35)),
    "abs_snow": ("antilock braking on snow", lambda k: _braking(k, "snow", k.pool.snow, 1.6)),
    "hard_braking": (
        "hard braking without an antilock system, wheels not locked",
        lambda k: _braking(k, "asphalt", None, k.between(0.5, 0.75), antilock=False),
    ),
    "hard_acceleration": ("hard acceleration", _hard_acceleration),
    "gear_shifts": ("gear shifts, torque reported late", _gear_shifts),
    "cornering_limit": ("0.7 to 0.9 g to the side", _cornering),
    "stop_and_go": ("stop and go", _stop_and_go),
    "standstill": ("standstill, a short way, standstill", _standstill),
    "roof_box": ("roof box and four passengers, unknown to the vehicle file", _roof_box),
    "trailer": ("a trailer, unknown to the vehicle file", _trailer),
}

BUSES = ("wheels", "esc", "drive", "brake", "steering", "gnss")


def _kerbs(k: Drawing) -> Taken:
    """Holes and kerbs of 10 to 50 cm: blows of 1 to 5 kN, most of it through the axle and little about it (K)."""
    v, duration = k.between(40.0, 100.0) * KMH, k.between(50.0, 80.0)
    kicks = tuple(
        Kick(
            v * t, k.between(0.2, 0.6), k.one_of("left", "right", "right", "both"), k.between(60.0, 500.0),
            k.between(1000.0, 5000.0),
        )
        for t in sorted(k.between(6.0, duration - 5.0) for _ in range(int(k.rng.integers(4, 11))))
    )  # fmt: skip
    scenario = k.drive(duration, k.cruise(duration, v, spread=0.04), kicks=kicks)
    return Taken(scenario, Model(), f"{len(kicks)} blows at {v / KMH:.0f} km/h")


def _pressure_loss(k: Drawing) -> Taken:
    v, wheel = k.between(80.0, 130.0) * KMH, k.one_of(*WHEELS)
    loss = {
        "radius": k.between(0.005, 0.015), "slope": k.between(0.05, 0.25), "start": k.between(15.0, 25.0),
        "duration": k.between(20.0, 60.0),
    }  # fmt: skip
    scenario = k.drive(110.0, k.cruise(110.0, v))
    note = f"{wheel} loses {loss['radius']:.1%} of its radius over {loss['duration']:.0f} s"
    return Taken(scenario, terms(("pressure_loss", loss, wheel)), note)


def _dropouts(k: Drawing) -> Taken:
    """Blocks without values in single signals, whole messages missing for 0.2 to 3 s, values that stand still."""
    duration, v = k.between(60.0, 90.0), k.between(60.0, 120.0) * KMH
    signals = tuple(s for g in ESC.groups if g.name in BUSES for s in g.signals)

    def fault(names: tuple[str, ...], low: float, high: float, kind: str) -> SensorFault:
        t = k.between(5.0, duration - 5.0)
        return SensorFault(k.one_of(*names), t, t + k.between(low, high), "frozen" if kind == "frozen" else "missing")

    faults = (
        *(fault(signals, 0.1, 2.0, "missing") for _ in range(int(k.rng.integers(4, 11)))),
        *(fault(BUSES, 0.2, 3.0, "missing") for _ in range(int(k.rng.integers(1, 4)))),
        *(fault(signals, 0.5, 3.0, "frozen") for _ in range(int(k.rng.integers(1, 4)))),
    )
    scenario = k.drive(duration, k.cruise(duration, v, spread=0.12), sensors=replace(ESC, faults=faults))
    return Taken(scenario, Model(), f"{len(faults)} faults at {v / KMH:.0f} km/h")


def _accelerometer(k: Drawing) -> Taken:
    """An accelerometer that is off by up to 0.2 m/s² from the start, or drifts there."""
    duration, v = k.between(60.0, 120.0), k.between(70.0, 120.0) * KMH
    error = k.between(0.08, 0.2) * k.one_of(-1.0, 1.0)
    if k.between(0.0, 1.0) < 0.5:
        model, note = terms(("accelerometer_bias", {"bias": error}, "a_x")), "off"
    else:
        model, note = terms(("accelerometer_drift", {"drift": error / duration}, "a_x")), "drifts"
    return Taken(k.drive(duration, k.cruise(duration, v)), model, f"{note} by {error:+.2f} m/s^2")


FAULTS: Makers = {
    "kerbs_and_holes": ("kerbs and holes", _kerbs),
    "pressure_loss": ("a tyre loses its air", _pressure_loss),
    "dropouts": ("sensors and buses that fail for a while", _dropouts),
    "accelerometer": ("an accelerometer that is off or drifts", _accelerometer),
}
