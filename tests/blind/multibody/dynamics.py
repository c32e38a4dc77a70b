"""The car in motion: 46 states, Adams-Bashforth of second order at 0.5 ms, Coulomb brakes as impulses on the rims."""

from __future__ import annotations

from math import cos, exp, pi, sin, tanh

from aqualog.core.compiled import part

from .tyre import load_factor, lost_share, tmeasy, water_push

__all__ = ["AUX", "STATES", "H", "advance", "at", "odd_force", "odd_slope"]

G = 9.81
H = 5e-4  # [s]
# states: speeds, way; heave, pitch, roll with rates; and by wheel or axle from these on
VX, VY, YAW, WAY, Z, Z_RATE, PITCH, PITCH_RATE, ROLL, ROLL_RATE = range(10)
ZU, ZU_RATE, RIM, BELT, TORSION, BRISTLE_X, BRISTLE_Y, ANGLE = 10, 14, 18, 22, 26, 30, 34, 38
ENGINE, SHAFT = 42, 44
STATES = 46
# besides: specific force along and across, and by wheel the torque of shafts, load, slip, film, lost share, force along
# and what is open
A_X, A_Y, T_SHAFT, LOAD, SLIP, FILM, LOST, FORCE, OPEN = 0, 1, 2, 6, 10, 14, 18, 22, 26
AUX = 27
GRADE, BANK, FILM_L, FILM_R = range(4)  # columns of the slow road, every metre
FINE, COARSE = 0.1, 1.0  # [m] steps of the uneven and of the slow road


@part
def at(x, column, s, ds):
    """Value of a column at a way, linear between."""
    k = s / ds
    last = x.shape[0] - 2
    if k <= 0.0:
        return x[0, column]
    if k >= last:
        return x[last, column]
    j = int(k)
    return x[j, column] + (k - j) * (x[j + 1, column] - x[j, column])


@part
def _bell(x, centre, width):
    z = (x - centre) / width
    return exp(-0.5 * z * z)


@part
def odd_force(t, share, v, way, steer, torque, a_side, yaw, a_x, is_open, odd):
    """Forces against the motion that no effect has [N]; `share` of the drive that is over, `torque` of all shafts."""
    F = 0.0
    if odd.hump[0] != 0.0:
        F += odd.hump[0] * _bell(v, odd.hump[1], odd.hump[2])
    if odd.interval[0] != 0.0 and 0.0 <= t - odd.interval[1] < odd.interval[2]:
        F += odd.interval[0]
    if odd.waves[0] != 0.0:
        F += odd.waves[0] * sin(2.0 * pi * way / odd.waves[1] + odd.waves[2])
    if odd.steering[0] != 0.0:
        F += odd.steering[0] * abs(steer)
    if odd.hours[0] != 0.0:  # up in a quarter of the drive, a hollow, and up again
        F += odd.hours[0] * (tanh((share - odd.hours[1]) / 0.08) - 1.6 * _bell(share, odd.hours[2], 0.09))
    if odd.valley[0] != 0.0:
        F += odd.valley[0] * _bell(v, odd.valley[1], odd.valley[2]) * _bell(torque, odd.valley[3], odd.valley[4])
    if odd.chafe[0] != 0.0:
        F += odd.chafe[0] * 0.5 * (1.0 + tanh((odd.chafe[1] * a_side - odd.chafe[2]) / odd.chafe[3]))
    if odd.stretch[0] != 0.0:  # by the square of speed, on two fifths of the way
        on = tanh(4.0 * sin(2.0 * pi * way / odd.stretch[1] + odd.stretch[2]) - 1.2)
        F += odd.stretch[0] * (v / 20.0) ** 2 * 0.5 * (1.0 + on)
    F += odd.agate[0] * tanh(abs(yaw) / odd.agate[1])
    if odd.beryl[0] != 0.0:
        on = tanh(t - odd.beryl[1]) - tanh(t - odd.beryl[1] - odd.beryl[2])
        F += odd.beryl[0] * (v / 20.0) ** 2 * 0.5 * on
    if odd.garnet[0] != 0.0:
        F += odd.garnet[0] * max(-a_x - odd.garnet[1], 0.0)
    F += odd.pyrite[0] * (v / 20.0) ** 2 * is_open
    F += odd.calcite[0] * max(-torque, 0.0)
    if odd.albite[0] != 0.0:  # a power, on and off
        on = tanh(8.0 * sin(2.0 * pi * t / odd.albite[1] + odd.albite[2]))
        F += odd.albite[0] / max(v, 5.0) * 0.5 * (1.0 + on)
    return F * tanh(v / 0.5)


@part
def _vertical(y, f, aux, fine, p):
    """Springs, dampers, bars; fills loads and the accelerations of the unsprung masses, returns forces on the body."""
    lift_up, moment_y, moment_x = 0.0, 0.0, 0.0
    half = 0.5 * p.track
    base = p.l_f + p.l_r
    for i in range(4):
        x = p.l_f if i < 2 else -p.l_r
        side = half if i % 2 == 0 else -half
        j = i + 1 if i % 2 == 0 else i - 1
        corner = y[Z] - y[PITCH] * x + y[ROLL] * side
        other = y[Z] - y[PITCH] * x - y[ROLL] * side
        rate = y[Z_RATE] - y[PITCH_RATE] * x + y[ROLL_RATE] * side
        travel = y[ZU + i] - corner
        F_s = p.spring[i] * travel + p.damper[i] * (y[ZU_RATE + i] - rate)
        F_s += p.bar[i // 2] * (travel - (y[ZU + j] - other))
        s = y[WAY] + x - p.l_f + base
        h = at(fine, i % 2, s, FINE)
        h_rate = (at(fine, i % 2, s + 0.05, FINE) - at(fine, i % 2, s - 0.05, FINE)) / 0.1 * y[VX]
        F_t = p.tyre_spring[i] * (h - y[ZU + i]) + p.tyre_damper[i] * (h_rate - y[ZU_RATE + i])
        F_t = max(F_t, -p.static[i])
        aux[LOAD + i] = p.static[i] + F_t
        f[ZU + i] = y[ZU_RATE + i]
        f[ZU_RATE + i] = (F_t - F_s) / p.unsprung[i]
        lift_up += F_s
        moment_y -= x * F_s
        moment_x += side * F_s
    return lift_up, moment_y, moment_x


@part
def _driveline(y, f, aux, drive, gear, p):
    """Engine or motor of each axle, shafts with backlash; fills the wheels' torques."""
    for a in range(2):
        share = p.split_rear if a == 1 else 1.0 - p.split_rear
        if share == 0.0:
            continue
        rate = y[ENGINE + a] - 0.5 * (y[RIM + 2 * a] + y[RIM + 2 * a + 1])
        twist = y[SHAFT + a]
        gap = 0.5 * p.backlash
        T = 0.0
        if abs(twist) > gap:
            T = p.shaft[a] * (twist - (gap if twist > 0.0 else -gap)) + p.shaft_damper[a] * rate
        f[SHAFT + a] = rate
        f[ENGINE + a] = (share * drive - T) / (share * p.turning[gear])
        aux[T_SHAFT + 2 * a] = 0.5 * T
        aux[T_SHAFT + 2 * a + 1] = 0.5 * T


@part
def _slope(i, t, y, aux, leak, lost, p, odd, linger):
    slope = p.slope[i] * load_factor(aux[LOAD + i], p.load_ref[i], p.load_law[i])
    slope *= exp(p.slope_drift[i] * t) * (1.0 + p.leak_slope[i] * leak) * (1.0 - lost) ** p.law[9]
    return slope * odd_slope(i, aux[T_SHAFT + i], y[YAW], y[VX], y[WAY], linger, aux[SLIP + i], odd)


@part
def odd_slope(i, torque, yaw, v, way, linger, slip, odd):
    """Factor on the slope of wheel i that no effect has; `torque` of its shaft."""
    factor = 1.0 - odd.soft[0] * linger
    if odd.saddle[0] != 0.0:
        factor *= 1.0 - odd.saddle[0] * _bell(abs(torque), odd.saddle[1], odd.saddle[2])
    if odd.turning[0] != 0.0 and i > 1:
        factor *= 1.0 / (1.0 + odd.turning[0] * abs(yaw))
    if odd.hum[0] != 0.0:
        factor *= 1.0 - odd.hum[0] * _bell(v, odd.hum[1], odd.hum[2])
    if odd.galena[0] != 0.0:  # patches of two lengths
        x = 2.0 * pi * way / odd.galena[1] + odd.galena[2]
        factor *= 1.0 - odd.galena[0] * 0.5 * (1.0 + tanh(6.0 * (sin(x) + sin(0.618 * x) - 0.3)))
    if odd.rutile[0] != 0.0:
        factor *= 1.0 - odd.rutile[0] * 0.5 * (1.0 - tanh(slip / 4e-4))
    return factor / (1.0 + odd.talc[0] * abs(torque) * v / 1e4)


@part
def _rhs(t, share, y, f, aux, fine, slow, p, odd, drive, gear, steer, gust, linger):
    up, moment_y, moment_x = _vertical(y, f, aux, fine, p)
    _driveline(y, f, aux, drive, gear, p)
    v, v_y, yaw, way = y[VX], y[VY], y[YAW], y[WAY]
    base = p.l_f + p.l_r
    warm = 1.0 + p.warm_extra * exp(-t / p.warm_time)
    leak = min(max((t - p.leak_start) / p.leak_time, 0.0), 1.0)
    pace = abs(v) / 30.0
    c, s = cos(steer), sin(steer)
    sum_x, sum_y, turn, wave = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        front = i < 2
        x = p.l_f if front else -p.l_r
        side = 0.5 * p.track if i % 2 == 0 else -0.5 * p.track
        u, w = v - yaw * side, v_y + yaw * x
        if front:
            u, w = c * u + s * w, c * w - s * u
        F_z = aux[LOAD + i]
        pressed = F_z / p.tyre_spring[i]
        # the tread length stays, so that a deflection takes little from the rolling radius; by it the force acts on the
        # belt, as the work of slip, rolling and water is all that may be lost between torque and road
        r_e = p.r_e[i] * (1.0 + p.growth[i] * u * u) * (1.0 - p.leak_radius[i] * leak)
        r_e -= 0.04 * (pressed - p.load_ref[i] / p.tyre_spring[i])
        if odd.jasper[0] != 0.0 and i == int(odd.jasper[1]):
            leans = (odd.jasper[2] * aux[A_Y] - odd.jasper[3]) / odd.jasper[4]
            r_e *= 1.0 - odd.jasper[0] * 0.5 * (1.0 + tanh(leans))
        film = at(slow, FILM_L if i % 2 == 0 else FILM_R, way + (base if front else 0.0), COARSE)
        if not front and film > p.track_film:
            film = p.track_film + 0.05 * (film - p.track_film)
        lost, push, mu = 0.0, 0.0, p.mu[i]
        if film > 2e-5:
            lost = min(lost_share(u, film, F_z, 4000.0, p.law) * p.contact_gain[i], 1.0)
            push = water_push(u, film, p.law) * p.water_gain[i]
            mu *= 0.78 * (1.0 - lost)
        rolls = y[BELT + i] * r_e
        slope = _slope(i, t, y, aux, leak, lost, p, odd, linger)
        f[BRISTLE_X + i] = rolls - u - abs(rolls) / p.bristle_x[i] * y[BRISTLE_X + i]
        f[BRISTLE_Y + i] = -w - abs(rolls) / p.bristle_y[i] * y[BRISTLE_Y + i]
        s_x, s_y = y[BRISTLE_X + i] / p.bristle_x[i], y[BRISTLE_Y + i] / p.bristle_y[i]
        F_x, F_y = tmeasy(s_x, s_y, F_z, mu, slope, p.cornering[i] * (1.0 - lost) ** 2)
        still = exp(-(u * u) / 4.0)  # rubber damps where it does not roll
        F_x += 3000.0 * still * f[BRISTLE_X + i]
        F_y += 3000.0 * still * f[BRISTLE_Y + i]
        # belt and rim
        twist = y[TORSION + i]
        slipping = y[RIM + i] - y[BELT + i]
        T = p.torsion[i] * twist + p.torsion_damper[i] * slipping
        rolling = (p.roll_0[i] * warm + p.roll_1 * pace + p.roll_4 * pace**4) * F_z
        against = (rolling + 0.6 * push) * r_e * tanh(y[BELT + i] / 0.7)
        drag = p.brake_drag[i] + (odd.linger[0] * linger if i > 1 else 0.0)
        ripple = 0.0
        if odd.ripple[0] != 0.0 and i == int(odd.ripple[1]):
            ripple = odd.ripple[0] * sin(odd.ripple[2] * y[ANGLE + i])
        if (p.split_rear if i > 1 else 1.0 - p.split_rear) > 0.0:  # from the faster wheel of an axle to the other
            ripple -= odd.spinel[0] * tanh((y[RIM + i] - y[RIM + (i ^ 1)]) / odd.spinel[1])
        f[RIM + i] = (aux[T_SHAFT + i] - T - drag * tanh(y[RIM + i]) + ripple) / p.rim[i]
        f[BELT + i] = (T - F_x * r_e - against) / p.belt[i]
        f[TORSION + i] = slipping
        f[ANGLE + i] = y[RIM + i]
        b_x, b_y = (c * F_x - s * F_y, s * F_x + c * F_y) if front else (F_x, F_y)
        wave += 0.4 * push
        sum_x, sum_y = sum_x + b_x, sum_y + b_y
        turn += x * b_y - side * b_x
        aux[SLIP + i], aux[FILM + i], aux[LOST + i], aux[FORCE + i] = s_x, film, lost, F_x
    # the body
    grade, bank = at(slow, GRADE, way + base, COARSE), at(slow, BANK, way + base, COARSE)
    air = v + p.wind + gust
    dynamic = 0.5 * p.air_density * air * abs(air)
    resist = dynamic * p.drag_area + wave + p.towed * G * 0.011 * tanh(v / 0.5)
    a_side = sum_y / p.mass
    resist += p.corner_drag * p.mass * a_side * a_side
    torque = aux[T_SHAFT] + aux[T_SHAFT + 1] + aux[T_SHAFT + 2] + aux[T_SHAFT + 3]
    if v > odd.pyrite[1]:
        aux[OPEN] = 1.0
    elif v < odd.pyrite[1] - odd.pyrite[2]:
        aux[OPEN] = 0.0
    resist += odd_force(t, share, v, way, steer, torque, a_side, yaw, aux[A_X], aux[OPEN], odd)
    a_x = (sum_x - resist) / (p.mass + p.towed)
    f[VX] = a_x - G * sin(grade) + yaw * v_y
    f[VY] = a_side - G * sin(bank) - yaw * v
    f[YAW] = turn / p.I_zz
    f[WAY] = v
    lift_f, lift_r = dynamic * p.lift_f, dynamic * p.lift_r
    sprung = p.mass - p.unsprung.sum()
    tip, heel = -p.h_cg * sum_x, p.h_cg * sum_y  # about the axes y and x
    f[Z], f[PITCH], f[ROLL] = y[Z_RATE], y[PITCH_RATE], y[ROLL_RATE]
    f[Z_RATE] = (up + lift_f + lift_r) / sprung
    f[PITCH_RATE] = (moment_y - p.l_f * lift_f + p.l_r * lift_r + (1.0 - p.anti) * tip) / p.I_yy
    f[ROLL_RATE] = (moment_x + (1.0 - p.anti) * heel) / p.I_xx
    for i in range(4):  # what the links carry loads the wheels at once
        down = p.anti * (tip / base * (0.5 if i < 2 else -0.5) + heel / p.track * (-0.5 if i % 2 == 0 else 0.5))
        f[ZU_RATE + i] -= down / p.unsprung[i]
    aux[A_X] = a_x - G * (y[PITCH] - odd.zircon[0] * linger)
    aux[A_Y] = a_side + G * y[ROLL]


@part
def advance(t, share, y, f, before, aux, fine, slow, p, odd, drive, brake, gear, steer, gust, linger, braked):
    """One step; `before` are the derivatives of the last step, `braked` (4,) gets the brakes' torques [N m]."""
    _rhs(t, share, y, f, aux, fine, slow, p, odd, drive, gear, steer, gust, linger)
    for k in range(STATES):
        if t <= 0.0:  # the first step is Euler's; an assignment of arrays compiles a message about shapes, for 3 s
            before[k] = f[k]
        y[k] += H * (1.5 * f[k] - 0.5 * before[k])
        before[k] = f[k]
    for i in range(4):
        limit = 0.5 * brake * (p.brake_front if i < 2 else 1.0 - p.brake_front) * H / p.rim[i]
        change = min(limit, abs(y[RIM + i]))
        if y[RIM + i] < 0.0:
            change = -change
        y[RIM + i] -= change
        braked[i] = change * p.rim[i] / H
        most = 3.0 * p.bristle_x[i]
        y[BRISTLE_X + i] = min(max(y[BRISTLE_X + i], -most), most)
        most = 3.0 * p.bristle_y[i]
        y[BRISTLE_Y + i] = min(max(y[BRISTLE_Y + i], -most), most)
