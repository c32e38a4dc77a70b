"""Traction coefficient of driven wheels while they spin up, over speed."""

from __future__ import annotations

import numpy as np

from aqualog.campaign.bins import Picked, Plan, cells, driven_of
from aqualog.campaign.resistance import MeanRow, mean_of_cell
from aqualog.campaign.samples import CampaignData, RunInfo, RunSamples
from aqualog.campaign.slip_slope import Limits
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray
from aqualog.physics.load import wheel_loads
from aqualog.physics.traction import residual_traction

__all__ = ["SPINNING", "events_of", "is_spinning", "spin_ups"]

LIMITS = Limits(samples=3)
SPINNING = 0.10  # [-] slip from which a brush of slope 30 and friction 1 slides as a whole: 3 mu / C (D)


def spin_ups(data: CampaignData, plan: Plan, *, residual: bool = False, limits: Limits = LIMITS) -> tuple[MeanRow, ...]:
    """Mean traction coefficient [-] on the lane while a wheel spins up, per configuration, driven wheel and bin.

    Parameters
    ----------
    data, plan
    residual : bool
        Subtract the missing acceleration of the vehicle (`physics.traction.residual_traction`); the rest pushes the car
        and is a lower bound. Otherwise the traction is the torque minus the wheel's own acceleration; on water it also
        turns the wheel against the increased rolling resistance.
    limits : Limits

    Slip defines spinning (`is_spinning`), not the detector's events. The detector reports spin-ups only below a
    traction of 0.07, to exclude other slippery surfaces; a mean over its events would have no values above that.

    Thesis: Fig. 2.7.
    """

    def columns(info: RunInfo, samples: RunSamples, wheel: str) -> Picked | str:
        mu = samples.array(f"mu_{wheel}")
        if np.isnan(mu).all():
            return "no traction: no torque of the driven wheels"
        if residual:
            car = info.vehicle
            a_x = np.nan_to_num(samples.array("a_x"))
            loads = wheel_loads(
                a_x, np.zeros_like(a_x), mass=car.mass, l_f=car.l_f, l_r=car.l_r, h_cg=car.h_cg, track=car.track
            )
            mu = residual_traction(mu, samples.array("delta_a_x"), loads[WHEELS.index(wheel)], mass=car.mass)
        return Picked({"v_x": samples.array("v_x"), "mu": mu}, {"no spin-up": ~is_spinning(samples, wheel)})

    found, _ = cells(data, plan, wheels=driven_of, columns=columns, road="wet", only_usable=False)
    return tuple(mean_of_cell(c, "mu", limits) for c in found)


def is_spinning(samples: RunSamples, wheel: str) -> BoolArray:
    """Steps in which the rim is all the time faster than the car by `SPINNING`."""
    with np.errstate(invalid="ignore"):
        spins: BoolArray = samples.array(f"slip_min_{wheel}") > SPINNING
    return spins


def events_of(info: RunInfo, samples: RunSamples, detector: str, wheel: str) -> BoolArray:
    """Samples within events of a detector at a wheel."""
    inside = np.zeros(samples.t.size, dtype=np.bool_)
    for event in info.events:
        if event["detector"] == detector and event["wheel"] == wheel:
            inside |= (samples.t >= event["start_s"]) & (samples.t <= event["end_s"])
    return inside
