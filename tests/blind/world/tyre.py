"""Magic Formula tyre with similarity for combined slip, and what water leaves of it.

`parabola` is a second law, the third-order curve of bristles in a parabolic pressure, for cases in which the tyre shall be
no difference between this world and the library.
"""

from __future__ import annotations

from math import atan, exp, sin, sqrt, tanh

from aqualog.core.compiled import compiled

__all__ = ["KINDS", "SECANT", "C", "E", "combined", "load_law", "lost_contact", "saddle", "water_force"]

C, E = 1.1, 0.5  # shape; the peak lies beyond the slips of these drives
KINDS = {"magic": 0.0, "origin": 0.0, "parabola": 1.0}
"""`origin`: the Magic Formula's slope at no force is the vehicle file's; `magic`: that over the forces of daily driving."""
SECANT = 0.962  # slope at the origin over the vehicle file's that fits a parabola's curve best up to 0.3 of the load
GROWTH = 5.0  # of the lost contact with speed
V_FULL, H_FULL, F_FULL = 34.7, 1.3e-3, 4000.0  # [m/s, m, N] anchor of full aquaplaning: 125 km/h


@compiled
def combined(kind, sigma_x, sigma_y, F_z, mu, K_x, K_y):
    """Forces (x, y) [N] from theoretical slips; K_x, K_y stiffnesses [N, N/rad] at the origin: B C D = K."""
    D = mu * F_z
    if D <= 1.0:
        return 0.0, 0.0
    if kind > 0.5:
        u_x, u_y = K_x * sigma_x / (3.0 * D), K_y * sigma_y / (3.0 * D)
        u = sqrt(u_x * u_x + u_y * u_y)
        if u < 1e-9:
            return K_x * sigma_x, K_y * sigma_y
        rest = 1.0 - min(u, 1.0)
        F = D * (1.0 - rest * rest * rest)
        return F * u_x / u, F * u_y / u
    u_x = K_x * sigma_x / (C * D)
    u_y = K_y * sigma_y / (C * D)
    u = sqrt(u_x * u_x + u_y * u_y)
    if u < 1e-9:
        return K_x * sigma_x, K_y * sigma_y
    F = D * sin(C * atan(u - E * (u - atan(u))))
    return F * u_x / u, F * u_y / u


@compiled
def load_law(F_z, F_ref, delta):
    """Slip slope over that at the reference load: MF6.1's pKx1 ... pKx3 of a 205/60R15, and a hidden delta."""
    df = F_z / F_ref - 1.0
    return max((1.0 + 0.633 * df) * exp(-0.4098 * df) + delta * df, 0.1)


@compiled
def saddle(sigma, depth, at, width):
    """Share of the slope that a saddle in the slip curve leaves: less around the slip `at`, either sign."""
    z = (abs(sigma) - at) / width
    return 1.0 - depth * exp(-0.5 * z * z)


@compiled
def lost_contact(v, h, F_z):
    """Share of the contact that the film h [m] lifts at v [m/s], 0 ... 1: exponential, all of it at full aquaplaning."""
    if h < 1e-5:
        return 0.0
    v_full = V_FULL * (h / H_FULL) ** -0.2 * (max(F_z, 100.0) / F_FULL) ** 0.2
    lost = (exp(GROWTH * max(v, 0.0) / v_full) - 1.0) / (exp(GROWTH) - 1.0)
    return min(lost, 1.0) * tanh(h / 2e-4)


@compiled
def water_force(v, h):
    """Drag of the film on one wheel [N], k h v^2 with a k that grows with depth."""
    return 88.0 * h * (1.0 + (h / 3.2e-3) ** 2) * v * v
