"""Physics of tyres on water: limits named in the docstrings, published figures, compiled against numpy."""

import inspect

import numpy as np
import pytest

from aqualog.core.compiled import compiled, inlined
from aqualog.model.tyre import TYRES
from aqualog.physics import (
    contact,
    hydroplaning,
    kinematics,
    load,
    resistance,
    rolling,
    slip,
    surface,
    tyre_brush,
    water,
)
from aqualog.physics.steering import tie_rod_force

KMH = 1 / 3.6
MM = 1e-3
G = 9.80665


def one(x):
    return np.array([float(x)])


L_ALL = np.linspace(0.0, 1.0, 101)


def test_remaining_share_of_its_edges():
    assert contact.remaining_share(np.array([-0.07, 0.0, 0.07]), np.array([0.07])) == pytest.approx([0.0, 0.5, 1.0])


def test_ratios_are_clipped_and_ordered():
    L = np.array([-0.2, 0.0, 1.0, 1.3])
    assert contact.friction_ratio(L).tolist() == [0.0, 0.0, 1.0, 1.0]
    assert contact.slip_stiffness_ratio(L).tolist() == [0.0, 0.0, 1.0, 1.0]
    inside = L_ALL[1:-1]
    assert (contact.slip_stiffness_ratio(inside) < contact.friction_ratio(inside)).all()
    assert (np.diff(contact.friction_ratio(L_ALL)) > 0).all()


@pytest.mark.parametrize("n", [2.0, 4.0, 6.0])
def test_lost_contact(n):
    v = np.array([0.0, 10.0, -10.0, 30.0, 45.0])
    lost = contact.lost_contact(v, one(30.0), exponent=n)
    assert lost == pytest.approx([0.0, 3.0**-n, 3.0**-n, 1.0, 1.0])
    assert contact.contact_share(v, one(30.0), exponent=n) == pytest.approx(1.0 - lost)
    assert contact.lost_contact(v, one(np.inf), exponent=n).tolist() == [0.0] * 5


def test_contact_half_length():
    kw = {"a_ref": 0.07, "F_z_ref": 4000.0, "p_ref": 2.2e5}
    assert contact.contact_half_length(np.array([-50.0, 0.0, 4000.0]), p=2.2e5, **kw) == pytest.approx([0, 0, 0.07])
    assert contact.contact_half_length(one(16000.0), p=2.2e5, **kw)[0] == pytest.approx(0.14)
    # longer by low pressure; the area carries the load by the pressure
    assert contact.contact_half_length(one(4000.0), p=1.1e5, **kw)[0] == pytest.approx(0.07 * np.sqrt(2))


@pytest.mark.parametrize("arm", [0.3, 0.45, 1.0])
def test_load_shift_is_linear_in_the_lost_contact(arm):
    e = contact.load_shift(np.array([1.0, 0.75, 0.5, 0.0, 1.2, -0.1]), one(0.07), arm=arm)
    assert e == pytest.approx(0.07 * arm * np.array([0.0, 0.25, 0.5, 1.0, 0.0, 1.0]))
    assert contact.load_shift(one(0.4), one(0.14), arm=arm) == pytest.approx(
        2 * contact.load_shift(one(0.4), one(0.07), arm=arm)
    )


def test_load_shift_and_film_take_about_the_momentum_of_the_water():
    """A rolling wheel cannot take more from the road than water thrown at up to twice its speed would."""
    t = TYRES["worn_summer"]
    v = np.array([70, 80, 90, 100]) * KMH
    L = contact.contact_share(v, t.full_speed(one(1.3 * MM), one(4e3), p=1.9e5), exponent=t.contact_exponent)
    a = contact.contact_half_length(one(4e3), p=1.9e5, a_ref=t.half_length, F_z_ref=4e3, p_ref=2.2e5)
    film = water.film_drag(
        one(1.3 * MM), v, v, width=t.width, tread_capacity=t.tread_capacity, h_film=t.h_film, relief=t.groove_relief
    )
    force = contact.load_shift(L, a, arm=t.wedge_arm) * 4e3 / 0.31 + film
    of_momentum = force / (water.RHO_WATER * t.width * 1.3 * MM * v * v)
    assert (of_momentum > 0.3).all()
    assert (of_momentum < 2.0).all()


F_Z, C_S = 4000.0, 120e3
MU = 0.9
S = np.linspace(-0.3, 0.3, 1201)


def force(s, mu=MU, F_z=F_Z, C_s=C_S):
    return tyre_brush.brush_force(np.asarray(s, dtype=float), np.asarray(F_z, dtype=float), mu=mu, C_s=C_s)


@pytest.mark.parametrize("mu", [0.1, 0.4, 1.0])
def test_slope_at_zero_holds_no_friction(mu):
    """C2."""
    assert (force([1e-7], mu)[0] - force([-1e-7], mu)[0]) / 2e-7 == pytest.approx(C_S, rel=1e-4)
    assert tyre_brush.brush_slope(np.zeros(1), one(F_Z), mu=mu, C_s=C_S)[0] == C_S


def test_odd_and_bounded():
    s = np.concatenate([S, [-50.0, -9.0, 9.0, 50.0]])
    assert force(-s) == pytest.approx(-force(s), abs=1e-9)
    assert np.abs(force(s)).max() == pytest.approx(MU * F_Z, rel=1e-12)
    assert (np.abs(force(s)) <= MU * F_Z * (1 + 1e-12)).all()
    assert (np.diff(force(S)) >= -1e-9).all()
    assert force([0.0])[0] == 0.0


def test_reaches_friction_at_the_full_sliding_slip():
    s = tyre_brush.brush_slip(one(MU), mu=MU, slope=C_S / F_Z)[0]
    assert s == pytest.approx(3 * 0.9 * 4000 / 120e3)
    assert force([s])[0] == pytest.approx(MU * F_Z, rel=1e-12)
    assert force([0.98 * s])[0] < MU * F_Z * (1 - 1e-6)
    assert tyre_brush.brush_slope(np.array([s, 2 * s]), one(F_Z), mu=MU, C_s=C_S) == pytest.approx([0, 0], abs=1e-9)


def test_no_load_or_no_friction_no_force():
    assert np.abs(force(S, F_z=0.0)).max() < 1e-8
    assert np.abs(force(S, mu=0.0)).max() < 1e-8
    assert np.isnan(force([np.nan])).all()
    assert tyre_brush.brush_force(one(0.1), one(F_Z), mu=MU, C_s=C_S, L=0.0)[0] == 0.0


def test_parts_of_the_full_contact():
    theta = np.array([0.0, 1 - 0.5 ** (1 / 3), 1.0, 7.0])
    assert sum(tyre_brush.brush_parts(theta, 1.0)) == pytest.approx([0.0, 0.5, 1.0, 1.0])
    assert sum(tyre_brush.brush_parts(one(1e-7), 1.0))[0] / 1e-7 == pytest.approx(3.0, rel=1e-6)
    assert tyre_brush.sliding_edge(np.array([0.0, 0.5, 1.0, 4.0]), 1.0) == pytest.approx([-1.0, 0.0, 1.0, 1.0])


@pytest.mark.parametrize("L", [1.0, 0.9, 0.6, 0.4, 0.1])
def test_contact_by_its_bristles(L):
    """The water has lifted the front: bristles enter at b under pressure and carry the less of stretch and friction."""
    a, n = 0.06, 200_000
    x = -a + (np.arange(n) + 0.5) / n * 2 * a * L
    b = a * (2 * L - 1)
    q = 0.75 * F_Z / a * (1 - (x / a) ** 2)
    c_px = C_S / (2 * a**2)
    assert tyre_brush.brush_stiffness(one(c_px), one(a))[0] == pytest.approx(C_S)
    for s in (0.002, 0.02, 0.05, 0.2, 2.0):
        bristles = np.minimum(c_px * s * (b - x), MU * q).sum() * 2 * a * L / n
        assert tyre_brush.brush_force(one(s), one(F_Z), mu=MU, C_s=C_S, L=L)[0] == pytest.approx(bristles, rel=1e-4)
    small = tyre_brush.brush_force(one(1e-7), one(F_Z), mu=MU, C_s=C_S, L=L)[0] / 1e-7
    assert small == pytest.approx(C_S * L**2, rel=1e-4)  # (2.2)
    large = tyre_brush.brush_force(one(1e6), one(F_Z), mu=MU, C_s=C_S, L=L)[0]
    assert large == pytest.approx(MU * F_Z * L**2 * (3 - 2 * L), rel=1e-4)  # (2.1)
    s = np.array([-0.05, 0.003, 0.02, 0.08])
    rise = tyre_brush.brush_force(s + 1e-7, one(F_Z), mu=MU, C_s=C_S, L=L)
    rise = (rise - tyre_brush.brush_force(s - 1e-7, one(F_Z), mu=MU, C_s=C_S, L=L)) / 2e-7
    assert tyre_brush.brush_slope(s, one(F_Z), mu=MU, C_s=C_S, L=L) == pytest.approx(rise, rel=1e-3)


def test_full_sliding_works_against_the_sliding_velocity():
    F_x, F_y = combined(3.0, 3.0)
    assert np.arctan2(F_y, F_x)[()] == pytest.approx(np.pi / 4, abs=1e-6)


def combined(s_x, s_y, C_x=C_S, C_y=80e3, mu=MU):
    s_x, s_y = np.broadcast_arrays(np.asarray(s_x, dtype=float), np.asarray(s_y, dtype=float))
    return tyre_brush.brush_forces(s_x, s_y, one(F_Z), mu=mu, C_x=C_x, C_y=C_y)


def test_combined_slip_reduces_to_pure():
    F_x, F_y = combined(S, 0.0)
    assert F_x == pytest.approx(force(S), rel=1e-12)
    assert (F_y == 0.0).all()
    F_x, F_y = combined(0.0, S)
    assert F_y == pytest.approx(force(S, C_s=80e3), rel=1e-12)
    assert (F_x == 0.0).all()


def test_equal_stiffness_is_isotropic():
    angle = np.linspace(0, 2 * np.pi, 25)
    for s in (0.01, 0.05, 0.3):
        F_x, F_y = combined(s * np.cos(angle), s * np.sin(angle), C_y=C_S)
        assert np.hypot(F_x, F_y) == pytest.approx(force([s])[0], rel=1e-12)
        assert np.arctan2(F_y, F_x) == pytest.approx(np.arctan2(np.sin(angle), np.cos(angle)), abs=1e-9)


def test_combined_force_within_the_friction_circle():
    s_x, s_y = np.meshgrid(S, S)
    F_x, F_y = combined(s_x, s_y)
    assert np.hypot(F_x, F_y).max() <= MU * F_Z * (1 + 1e-12)
    assert (F_x * s_x >= 0).all()
    assert (F_y * s_y >= 0).all()
    # side slip costs longitudinal force
    assert combined(0.05, 0.1)[0] < combined(0.05, 0.0)[0]


def test_a_lifted_wheel_gives_no_combined_force():
    F_x, F_y = tyre_brush.brush_forces(one(0.1), one(0.1), one(0.0), mu=1.0, C_x=0.0, C_y=0.0)
    assert (F_x[0], F_y[0]) == (0.0, 0.0)


def test_horne_figures():
    """numbers.md (a)."""
    v = hydroplaning.horne_speed(np.array([180, 200, 220, 240, 260, 300]) * 1e3)
    assert v / KMH == pytest.approx([85, 90, 94, 99, 103, 110], abs=0.7)
    # NHTSA: 30 psi 56.7 mph, 25 psi 51.8 mph; the same law as 10.35 sqrt(p) mph and 6.36 sqrt(p / kPa) km/h
    psi = hydroplaning.horne_speed(np.array([30.0, 25.0]) * 6894.757)
    assert psi / 0.44704 == pytest.approx([56.7, 51.8], abs=0.1)
    assert hydroplaning.horne_speed(one(2e5))[0] / KMH == pytest.approx(6.36 * np.sqrt(200), rel=2e-3)


def test_pavdrn_figures():
    v = hydroplaning.pavdrn_speed(np.array([0.6, 0.8, 1.1, 1.3, 2.0]) * MM)
    assert v / KMH == pytest.approx([111, 103, 95, 91, 81], abs=0.7)


def test_gallaway_figures():
    def v(p=2.2e5, tread=1.6, texture=0.78):
        h = np.array([0.6, 2.0]) * MM
        return hydroplaning.gallaway_speed(h, one(p), tread_depth=tread * MM, texture_depth=texture * MM) / KMH

    assert v() == pytest.approx([93, 85], abs=0.7)
    assert v(tread=8.0) - v() == pytest.approx([7.5, 7.5], abs=1.0)
    # rough road and high pressure help
    assert (np.minimum(v(texture=2.0), v(p=2.64e5)) > v()).all()


def test_usf_exponents():
    h, p, F_z = np.array([[1 * MM, 2e5, 4e3], [1 * MM, 8e5, 4e3], [1 * MM, 2e5, 32 * 4e3], [2 * MM, 2e5, 4e3]]).T
    v = hydroplaning.usf_speed(h, p, F_z) / KMH
    assert v[0] == pytest.approx(4000**0.2 * np.sqrt(200) * 1.31)
    assert v[1:3] == pytest.approx(2 * v[0])
    assert v[3] < v[0]


def depth(h, gain=0.58):
    return hydroplaning.depth_factor(np.asarray(h) * MM, thin_gain=gain, h_bulk=2 * MM)


def test_depth_factor():
    def fall(f):
        return 1 - f[1] / f[0]

    h = np.array([0.6, 2.0]) * MM
    gallaway = hydroplaning.gallaway_speed(h, one(2.2e5), tread_depth=1.6 * MM, texture_depth=0.78 * MM)
    assert fall(gallaway) == pytest.approx(0.09, abs=0.006)
    assert fall(hydroplaning.pavdrn_speed(h)) == pytest.approx(0.27, abs=0.005)
    assert fall(gallaway) < fall(depth([0.6, 2.0])) < fall(hydroplaning.pavdrn_speed(h))


def test_bulk_water_is_usfs_and_thin_films_float_later_by_their_gain():
    assert depth([20.0, 40.0]) / hydroplaning.usf_speed(np.array([20.0, 40.0]) * MM, one(2e5), one(4e3)) == (
        pytest.approx(depth([20.0])[0] / hydroplaning.usf_speed(one(20 * MM), one(2e5), one(4e3))[0], rel=1e-3)
    )
    assert depth([0.2])[0] / depth([0.2], 0.0)[0] == pytest.approx(1.58, rel=1e-3)
    assert depth([2.0])[0] / depth([2.0], 0.0)[0] == pytest.approx(1.29)  # half of the gain at h_bulk


LAW = hydroplaning.WaterLaw(33.0, 0.5, 0.58, 2 * MM, 0.15 * MM, 33.5, 3.5, 0.4)
CAR = hydroplaning.ASPECT_ANCHOR
WORN = {"tread_depth": 1.6 * MM, "tread_capacity": 0.4 * MM, "texture": 1.0, "aspect": CAR, "law": LAW}
NEW = WORN | {"tread_depth": 7.8 * MM, "tread_capacity": 1.95 * MM}


def v_full(h=1.3 * MM, F_z=4000.0, p=1.9e5, **kw):
    return hydroplaning.full_aquaplaning_speed(np.atleast_1d(h), np.atleast_1d(F_z), p=p, **(WORN | kw))


def test_no_water_no_aquaplaning():
    assert v_full(0.0)[0] == 1e6
    assert (np.diff(1.0 / v_full(np.geomspace(1e-4, 10, 300) * MM)) > 0).all()
    lost = contact.lost_contact(one(30.0), v_full(np.array([0.01, 0.02]) * MM), exponent=3.5)
    assert lost[0] < 0.3 * lost[1] < 0.01


def test_full_aquaplaning_speed_is_monotone():
    assert (np.diff(v_full(np.linspace(0.05, 10, 400) * MM)) < 0).all()
    assert (np.diff(v_full(F_z=np.linspace(500, 9000, 50))) > 0).all()
    assert v_full()[0] == pytest.approx(33.0, rel=1e-12)  # at the anchor
    assert np.isfinite(v_full(F_z=0.0)).all()  # a lifted wheel
    assert v_full(p=4 * 1.9e5)[0] == pytest.approx(66.0)  # the exponent of pressure of this law
    assert v_full(F_z=32 * 4000.0)[0] == pytest.approx(66.0)  # USF
    assert v_full(1.3 * MM, tread_capacity=1.2 * MM)[0] > v_full(1.3 * MM)[0]
    # at four times the pressure a contact is half as long: one of the same aspect has Horne's root
    assert v_full(p=4 * 1.9e5, aspect=0.5 * CAR, law=LAW._replace(pressure_exponent=0.3))[0] == pytest.approx(66.0)
    assert v_full(aspect=4 * CAR)[0] == pytest.approx(33.0 * 4**-0.4)


@pytest.mark.parametrize("h", [1.3, 2.0, 3.0, 5.0, 7.0, 8.0, 15.0])
def test_tread_counts_at_every_depth(h):
    """Version 0.15 completed the wedge 0.15 mm beyond the capacity: above 2.1 mm of water new and worn were the same."""
    assert v_full(h * MM, **NEW)[0] > 1.1 * v_full(h * MM)[0]


def test_the_wedge_has_no_edge_where_the_grooves_are_full():
    v = v_full(np.linspace(1.5, 2.4, 91) * MM, **NEW)
    assert np.abs(np.diff(np.log(v))).max() < 0.012


def test_glass_has_no_texture_that_breaks_a_thin_film():
    assert v_full(1.3 * MM, texture=0.0)[0] < 0.75 * v_full(1.3 * MM)[0]
    assert v_full(8 * MM, texture=0.0)[0] == pytest.approx(v_full(8 * MM)[0], rel=0.01)


FILM = {"width": 0.2, "tread_capacity": 0.4 * MM, "h_film": 0.6 * MM, "relief": 0.7}


def test_drained_share():
    h = np.array([0.0, 0.1, 0.4, 40.0]) * MM
    share = water.drained_share(h, tread_capacity=0.4 * MM)
    assert share == pytest.approx([1.0, 1.0, 2 ** (-1 / 3), 0.01], abs=0.006)
    assert water.drained_share(one(1 * MM), tread_capacity=0.0)[0] < 1e-8
    drained = np.linspace(0.01, 20, 500) * MM
    drained = drained * water.drained_share(drained, tread_capacity=0.4 * MM)
    assert (np.diff(drained) > -1e-15).all()
    assert (drained <= 0.4 * MM).all()  # no more than there is room for


def test_resistance_falls_beyond_full_aquaplaning():
    v = np.array([20.0, 30.0, 33.0, 45.0, 60.0])
    share = water.skimming_share(v, one(30.0))
    assert share[:2].tolist() == [1.0, 1.0]
    force = v**2 * share
    assert force[1] == force.max()
    assert (np.diff(force[1:]) < 0).all()


def test_film_drag_by_hand_and_in_its_limits():
    assert water.film_drag(one(0.0), one(30.0), one(30.0), **FILM)[0] == 0.0
    assert water.film_drag(one(1 * MM), one(0.0), one(0.0), **FILM)[0] == 0.0
    expected = 1000 * 0.2 * 0.6e-3 * (1 - 0.7 * (1 + 2.5**3) ** (-1 / 3)) * 900
    assert water.film_drag(one(1 * MM), one(30.0), one(30.0), **FILM)[0] == pytest.approx(expected)
    ratio = water.film_drag(one(1 * MM), one(60.0), one(60.0), **FILM) / water.film_drag(
        one(1 * MM), one(30.0), one(30.0), **FILM
    )
    assert ratio[0] == pytest.approx(4.0)  # parabolic
    half = water.film_drag(one(1 * MM), one(30.0), one(15.0), **FILM)[0]
    assert half == pytest.approx(0.5 * expected)  # a tread at half the speed throws half the momentum


def test_film_drag_saturates_with_depth():
    """Fig. 2.11 (C38): little change from 0.6 to 1.3 mm, where momentum alone would double."""
    F = water.film_drag(np.array([0.6, 1.3]) * MM, one(30.0), one(30.0), **(FILM | {"tread_capacity": 0.0}))
    assert F[0] == pytest.approx(F[1], rel=1e-8)
    F = water.film_drag(np.array([0.6, 1.3]) * MM, one(30.0), one(30.0), **FILM)
    assert 1.0 < F[1] / F[0] < 1.6


def test_momentum_of_two_wheels_is_that_of_the_table():
    """numbers.md (d): w = .245, two wheels, 1650 kg, 0.6 mm: .05 .09 .14 .20 m/s^2 at 60 80 100 120 km/h."""
    v = np.array([60, 80, 100, 120]) * KMH
    kw = {"width": 0.245, "tread_capacity": 0.0, "h_film": 1.0, "relief": 0.0}
    for h, a in ((0.6, [0.05, 0.09, 0.14, 0.20]), (2.0, [0.16, 0.29, 0.46, 0.66])):
        assert 2 * water.film_drag(one(h * MM), v, v, **kw) / 1650 == pytest.approx(a, abs=0.006)


def test_wave_drag():
    kw = {"width": 0.2, "h_wave": 1.3 * MM}
    assert water.wave_drag(np.array([0.0, 0.6, 1.3]) * MM, one(30.0), **kw).tolist() == [0.0, 0.0, 0.0]
    F = water.wave_drag(np.array([1.4, 1.5]) * MM, one(30.0), **kw)
    assert pytest.approx([1000 * 0.2 * 0.1e-3 * 900, 1000 * 0.2 * 0.2e-3 * 900]) == F
    assert water.wave_drag(one(2 * MM), one(0.0), **kw)[0] == 0.0


def test_residual_film():
    h = np.array([0.0, 0.3, 0.6, 1.3, 2.0]) * MM
    kept = 0.5 * MM * (1 - np.exp(-h / (0.5 * MM)))
    assert water.residual_film(h, one(1.0), h_track=0.5 * MM) == pytest.approx(kept)
    assert kept[1] / h[1] > 0.7 > 0.3 > kept[4] / h[4]  # a share of the undisturbed film, less of a deeper one
    assert water.residual_film(one(1.0), one(1.0), h_track=0.5 * MM)[0] == pytest.approx(0.5 * MM, rel=1e-3)
    assert water.residual_film(h, one(0.0), h_track=0.5 * MM) == pytest.approx(h)
    # a front wheel with half its contact leaves much the same of 0.6 as of 2 mm (thesis 2.3 on Fig. 2.17)
    half = water.residual_film(h, one(0.5), h_track=0.5 * MM)
    assert half[4] - half[2] < 0.15 * (h[4] - h[2])
    film = water.residual_film(one(2 * MM), L_ALL, h_track=0.5 * MM)
    assert (np.diff(film) <= 0).all()
    assert water.residual_film(one(2 * MM), np.array([-0.1, 1.1]), h_track=0.5 * MM) == pytest.approx(
        [2e-3, 0.491e-3], rel=1e-3
    )


def test_series_slope():
    slope = np.array([10.0, 31.7, 60.0])
    assert surface.series_slope(slope, compliance=0.0).tobytes() == slope.tobytes()
    assert surface.series_slope(slope, compliance=1e6) == pytest.approx(1e-6, rel=1e-5)
    assert 1 / surface.series_slope(slope, compliance=1 / 15) == pytest.approx(1 / slope + 1 / 15)
    # thesis 3.3: 30 on high friction, 10 on low
    assert surface.series_slope(one(30.0), compliance=1 / 15)[0] == pytest.approx(10.0)


def test_effective_radius_grows_by_a_quarter_per_cent():
    """numbers.md (f): +0.24 % from 60 to 120 km/h."""
    r = rolling.effective_radius(one(0.317), np.array([0.0, 60 * KMH, 120 * KMH]), growth=2.9e-6)
    assert r[0] == 0.317
    assert r[2] / r[1] - 1 == pytest.approx(0.0024, abs=1e-4)
    assert (rolling.effective_radius(one(0.317), np.linspace(0, 60, 9), growth=0.0) == 0.317).all()


def test_warm_up():
    f = rolling.warm_up_factor(np.array([0.0, 600.0, 6000.0, 1e9]), extra=0.4, time_constant=600.0)
    assert f == pytest.approx([1.4, 1 + 0.4 / np.e, 1.0, 1.0], abs=1e-4)
    assert f[-1] == 1.0
    assert (rolling.warm_up_factor(np.linspace(0, 100, 5), extra=0.0, time_constant=600.0) == 1.0).all()


def test_load_factor_figures():
    """A published set, (21.687 + 13.728 df) exp(-0.4098 df): 19.9, 21.2, 22.1, 22.8 at -30, -10, +10, +30 %."""
    df = np.array([-0.3, -0.1, 0.1, 0.3])
    published = (21.687 + 13.728 * df) * np.exp(-0.4098 * df)
    assert published == pytest.approx([19.9, 21.2, 22.1, 22.8], abs=0.06)
    factor = rolling.load_factor(4000.0 * (1 + df), F_z_ref=4000.0, sensitivity=0.22)
    assert 21.687 * factor == pytest.approx(published, rel=0.02)  # the tangent
    assert rolling.load_factor(np.array([0.0, 777.7, 9e3]), F_z_ref=4000.0, sensitivity=0.0).tolist() == [1.0] * 3
    assert rolling.load_factor(one(4000.0), F_z_ref=4000.0, sensitivity=0.22)[0] == 1.0
    assert rolling.load_factor(one(0.0), F_z_ref=4000.0, sensitivity=2.0)[0] == 0.1


def test_pressed_radius_is_the_tangent_of_a_published_law():
    """r_e = R - rho_0 (D atan(B rho) + F rho), rho the load over the nominal one: B 8.4, D 0.27, F 0.07, rho_0 20 mm."""
    rho = np.array([0.7, 0.9, 1.1, 1.3])
    lost = 0.02 * (0.27 * np.arctan(8.4 * rho) + 0.07 * rho - 0.27 * np.arctan(8.4) - 0.07)
    assert 0.315 * (1.0 - rolling.pressed_radius(rho, F_z_ref=1.0, loss=0.0066)) == pytest.approx(lost, abs=1e-4)
    assert rolling.pressed_radius(np.array([0.0, 777.7, 9e3]), F_z_ref=4000.0, loss=0.0).tolist() == [1.0] * 3


def test_pressure_factor_figures():
    """numbers.md (c): +11 % at -25 %, -7 % at +30 %; a smaller slope at high pressure (C53)."""
    p = 2.2e5 * np.array([0.75, 1.0, 1.3])
    assert rolling.pressure_factor(p, p_ref=2.2e5, p_nominal=2.2e5) == pytest.approx([1.11, 1.0, 0.93], abs=0.005)
    assert rolling.pressure_factor(one(1.9e5), p_ref=1.9e5, p_nominal=2.2e5)[0] == 1.0
    relative = rolling.pressure_factor(one(2.2e5), p_ref=1.9e5, p_nominal=2.2e5)[0]
    assert relative == pytest.approx(1 / rolling.pressure_factor(one(1.9e5), p_ref=2.2e5, p_nominal=2.2e5)[0])


def test_tie_rod_polynomial_by_hand():
    F = tie_rod_force(one(300.0), one(-2000.0), c0=(15.0,), c_y=(0.11, 1e-6), c_x=(0.06, 0.0, 1e-8))
    assert F[0] == pytest.approx(15 - 220 + 4.0 + 18 + 0.27)
    assert tie_rod_force(one(300.0), one(2000.0), c0=(), c_y=(), c_x=()).tolist() == [0.0]


def test_wheel_velocity_of_a_spinning_top():
    """Turning left on the spot: the front goes left, the right side forward."""
    along, across = kinematics.wheel_velocity(np.zeros(1), np.zeros(1), one(0.5), np.zeros(1), x=1.4, y=-0.75)
    assert (along[0], across[0]) == pytest.approx((0.375, 0.7))
    # a wheel that is steered by a right angle to the left: its plane lies across the car
    along, across = kinematics.wheel_velocity(np.zeros(1), np.zeros(1), one(0.5), one(np.pi / 2), x=1.4, y=-0.75)
    assert (along[0], across[0]) == pytest.approx((0.7, -0.375))


@pytest.mark.parametrize("y", [-0.75, 0.75])
@pytest.mark.parametrize("front", [True, False])
def test_wheel_velocity_inverts_the_centre_line_speed(y, front):
    """For a car whose rear axle moves straight ahead."""
    wheelbase, l_r, v, psi_dot = 2.8, 1.4, 20.0, 0.4
    delta = float(kinematics.kinematic_steer_angle(one(psi_dot), one(v), wheelbase=wheelbase)[0]) if front else 0.0
    x = wheelbase - l_r if front else -l_r
    along, _ = kinematics.wheel_velocity(one(v), one(psi_dot * l_r), one(psi_dot), one(delta), x=x, y=y)
    back = kinematics.centre_line_speed(along, one(psi_dot), one(delta), y=y, wheelbase=wheelbase)
    assert back[0] == pytest.approx(v, rel=1e-12)


def test_bounded_slip():
    v_w = np.array([0.51, 20.0, 31.0, 100.0])
    v = np.array([20.0, 20.5, 30.0, 30.0])
    assert slip.bounded_slip(v_w, v) == pytest.approx((v_w - v) / v_w)
    assert slip.bounded_slip(v_w[1:], v[1:]) == pytest.approx(slip.wheel_slip(v_w[1:] / 0.3, v[1:], 0.3))
    assert slip.bounded_slip(one(0.0), one(25.0))[0] == pytest.approx(-50.0)  # large, not infinite
    assert slip.bounded_slip(one(0.0), one(0.0))[0] == 0.0
    # a wheel that turns backwards in a car that goes ahead is braked, one that turns faster backwards drives backwards
    assert slip.bounded_slip(one(-1.0), one(20.0))[0] == pytest.approx(-21.0)
    assert slip.bounded_slip(one(-21.0), one(-20.0))[0] < 0
    # continuous where the bound begins
    near = slip.bounded_slip(np.array([0.5 - 1e-9, 0.5 + 1e-9]), one(3.0))
    assert near[0] == pytest.approx(near[1], abs=1e-6)


def test_grade_force():
    F = resistance.grade_force(np.array([0.0, 0.05, -0.05, np.pi / 2]), mass=1650.0)
    assert pytest.approx([0.0, 1650 * 9.80665 * 0.05, -1650 * 9.80665 * 0.05, 1650 * 9.80665], rel=5e-4) == F
    assert F[1] > 0  # uphill is against the motion


def test_cornering_drag():
    F = resistance.cornering_drag(np.array([0.0, 2.0, -2.0]), mass=1500.0, coefficient=0.01)
    assert pytest.approx([0.0, 60.0, 60.0]) == F


MODULES = (contact, hydroplaning, kinematics, load, resistance, rolling, slip, surface, tyre_brush, water)
RANGES = {
    "L": (0, 1), "L_front": (0, 1), "b": (-0.07, 0.07), "a": (0.05, 0.1), "v": (0, 50), "v_full": (20, 50),
    "F_z": (500, 9000), "p": (1.5e5, 3e5), "p_ref": (1.5e5, 3e5), "p_nominal": (1.5e5, 3e5),
    "h_w": (1e-4, 3e-3), "s_x": (-0.3, 0.3), "s_y": (-0.3, 0.3), "mu": (0.05, 1.2), "C_s": (2e4, 2e5),
    "C_x": (2e4, 2e5), "C_y": (2e4, 2e5), "theta": (0, 1.5), "mass": (1e3, 3e3), "slope": (5, 60),
    "tread_capacity": (0, 1e-3), "h_film": (1e-4, 2e-3), "h_wave": (1e-4, 2e-3), "h_track": (1e-4, 1e-3),
    "F_z_ref": (2e3, 6e3), "width": (0.1, 0.3), "exponent": (2, 6), "h_onset": (1e-4, 5e-4),
    "h_bulk": (1e-3, 3e-3), "texture_depth": (2e-4, 2e-3),
    "tread_depth": (1e-3, 8e-3), "growth": (0, 5e-6), "v_w": (-5, 50), "v_along": (0, 50), "c_px": (1e6, 1e7),
    "unevenness": (1e-6, 1e-3), "friction": (0, 300), "per_force": (1e-6, 1e-5), "rack": (-0.01, 0.01), "free": (-0.01, 0.01),
    "l_f": (1, 2), "l_r": (1, 2), "h_cg": (0.3, 1), "track": (1.3, 1.8), "t": (0, 600),
}  # fmt: skip
NOT_FOR_SCALARS = {"wheel_loads", "nominal_acceleration", "kinematic_steer_angle", "slip_of_wheel_speed", "wheel_slip"}
FUNCTIONS = [
    getattr(m, n) for m in MODULES for n in m.__all__ if inspect.isfunction(getattr(m, n)) and n not in NOT_FOR_SCALARS
]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_inlined_equals_numpy(function):
    parameters = inspect.signature(function).parameters.values()
    rng = np.random.default_rng(11)
    scalar = inlined(function)
    for _ in range(40):
        values = {q.name: float(rng.uniform(*RANGES.get(q.name, (0.1, 1.0)))) for q in parameters}
        if "law" in values:
            low, high = np.array(LAW) * 0.7, np.array(LAW) * 1.3
            values["law"] = hydroplaning.WaterLaw(*rng.uniform(low, high).tolist())
        arrays = {q.name: one(values[q.name]) if q.kind is not q.KEYWORD_ONLY else values[q.name] for q in parameters}
        expected = np.ravel(np.array(function(**arrays)))
        assert np.ravel(np.array(scalar(*values.values()))) == pytest.approx(expected, rel=1e-13, abs=1e-13)


_brush = inlined(tyre_brush.brush_force)


@compiled
def _by_position(s, F_z, mu, C_s):
    return _brush(s, F_z, mu, C_s)


@compiled
def _by_keyword(s, F_z, mu, C_s):
    return _brush(s, F_z, C_s=C_s, mu=mu)


def test_inlined_inside_a_kernel():
    assert _by_position(0.02, F_Z, MU, C_S) == pytest.approx(force([0.02])[0], rel=1e-14)
    assert _by_keyword(0.02, F_Z, MU, C_S) == _by_position(0.02, F_Z, MU, C_S)
