"""What an effect that no library has does to a residual, as the function that a good description would find."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from aqualog.core.vehicle import Vehicle

from .effects import Hidden

__all__ = ["Shape", "shape_of"]


class Shape(NamedTuple):
    """Residual `channel` (measured less nominal) over the coordinates `depends_on` [SI]; `f` takes them in that order.

    Units: `force_balance`, `kinematic` [m/s^2]; `slip` relative change of the slip slope [-]. `torque` is that of all
    wheels together [N m], `position` the distance driven [m].
    """

    channel: str
    depends_on: tuple[str, ...]
    f: Callable[..., np.ndarray]


def shape_of(hidden: Hidden, vehicle: Vehicle) -> Shape | None:
    """The function behind an effect, None for the library's effects and for `hills`, which the road alone knows."""
    v, m = hidden.values, vehicle.mass

    def bump(x, size):
        return size * np.exp(-0.5 * ((np.asarray(x) - v["centre"]) / v["width"]) ** 2)

    if hidden.effect == "speed_hump":
        return Shape("force_balance", ("v_x",), lambda x: bump(x, -v["force"] / m))
    if hidden.effect == "wet_hump":
        return Shape(
            "force_balance", ("v_x", "water_depth"),
            lambda x, h: np.where(np.asarray(h) > 1e-5, bump(np.asarray(x) * h, -v["force"] / m), 0.0),
        )  # fmt: skip
    if hidden.effect == "slip_saddle":
        return Shape(
            "slip", ("slip",),
            lambda s: -v["depth"] * np.exp(-0.5 * ((np.abs(s) - v["at"]) / v["width"]) ** 2),
        )  # fmt: skip
    if hidden.effect == "drag_patch":

        def patch(s):
            x = np.asarray(s) - v["start"]
            period = v.get("period", 0.0)
            x = np.where(x >= 0.0, np.mod(x, period), x) if period > 0.0 else x
            return -v["force"] / m * np.clip(np.minimum(x, v["length"] - x) / 10.0 + 0.5, 0.0, 1.0)

        return Shape("force_balance", ("position",), patch)
    if hidden.effect == "gear_loss":
        r = vehicle.torque_split_rear
        squares = 0.5 * (r * r + (1.0 - r) ** 2) * v["coefficient"] / m
        radius = r * vehicle.r_e_r + (1.0 - r) * vehicle.r_e_f
        return Shape("force_balance", ("torque",), lambda T: -squares * np.maximum(T, 0.0) ** 2 / radius)
    if hidden.effect == "accelerometer_speed":
        return Shape("force_balance", ("v_x", "a_x"), lambda x, a: v["rate"] * (np.asarray(x) - 15.0) * np.asarray(a))
    return None
