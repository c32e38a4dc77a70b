"""Diagnoses made by hand, one for each verdict, with names of drives that mean harm."""

import math
from dataclasses import replace

import numpy as np

from aqualog.diagnose import records
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term

NAN = float("nan")
HOSTILE = "</script><script>alert(1)</script>.mf4"
IMAGE = '"><img src=x onerror=alert(2)> %{y} <b>&amp;.csv'
CHANNELS = ("force_balance", "kinematic", "slip_rl", "slip_rr", "tie_rod_fl", "lateral")
UNITS = {"force_balance": "m/s^2", "kinematic": "m/s^2", "slip_rl": "-", "slip_rr": "-", "tie_rod_fl": "N",
         "lateral": "m/s^2"}  # fmt: skip
SCALES = {
    "force_balance": 0.05,
    "kinematic": 0.05,
    "slip_rl": 1e-3,
    "slip_rr": 1e-3,
    "tie_rod_fl": 20.0,
    "lateral": 0.1,
}

MASS = records.Cause(
    "payload_mass", None, {"delta_mass": records.Estimate(262.0, 240.0, 285.0, "kg")}, ("force_balance",),
    "The car weighed 262 kg more than the vehicle file says.",
)  # fmt: skip
TORQUE = records.Cause(
    "torque_gain", None, {"gain": records.Estimate(0.8651, 0.8532, 0.8771, "-")}, ("force_balance",),
    "The wheels get 0.865 of the torque.",
)  # fmt: skip
RADIUS = records.Cause(
    "tyre_radius", "fl", {"delta": records.Estimate(-0.00431, -0.00462, -0.00398, "-")}, ("slip_fl", "side_slip_f"),
    "The tyre has a radius -0.43% off.",
)  # fmt: skip
GROWTH = records.Cause(
    "tyre_radius_growth",
    "r",
    {"growth": records.Estimate(2.04e-6, 1.7e-6, 2.4e-6, "s^2/m^2")},
    ("slip_rl", "slip_rr"),
    "",
)
FOUND = records.Significance(213.4, 12.31, 0.01, 0.01, 0.0101, 99)
NOTHING = records.Significance(8.12, 12.31, 0.34, 0.01, 0.0101, 99)
LIMITS = (
    records.Limit("payload_mass", None, 14.2, "kg"), records.Limit("torque_gain", None, 0.0123, "-"),
    records.Limit("head_wind", None, 1.93, "m/s"), records.Limit("aero_drag", None, 0.0812, "m^2"), records.Limit("road_grade", None, NAN, "rad"),
    records.Limit("tyre_radius", "fl", 0.00021, "-"), records.Limit("tyre_radius_growth", "r", 4.1e-7, "s^2/m^2"),
    records.Limit("accelerometer_bias", "a_x", 0.006, "m/s^2"), records.Limit("signal_delay", "v_x", 0.0321, "s"),
    records.Limit("clock_skew", "a_x", 1234.0, "ppm"),
)  # fmt: skip
RELATION = (
    "An accelerometer bias b is the same as a constant grade of b/g with a rolling resistance that is off by -b/g."
)
CONFUSIONS = (
    records.Confusion("payload_mass", ("torque_gain",), 0.81, 0.674),
    records.Confusion("torque_gain", ("payload_mass",), 1.1, 0.700),
    records.Confusion("payload_mass", ("head_wind",), 410.0, 1.0),
    records.Confusion("aero_drag", ("head_wind",), 0.21, 0.591),
    records.Confusion("tyre_radius@fl", ("payload_mass",), 9000.0, 1.0),
    records.Confusion("payload_mass", ("torque_gain", "wheel_inertia"), 0.02, 0.528),
    records.Confusion("accelerometer_bias@a_x", ("road_grade", "rolling_resistance"), 0.0, 0.5, RELATION),
    records.Confusion("road_grade", ("rolling_resistance",), 301.0, 1.0),
    records.Confusion("accelerometer_bias@a_x", ("road_grade",), 14.0, 0.969),
)
HILL = records.Manoeuvre(
    "speed_staircase", (("payload_mass", "torque_gain"),),
    "Drive a staircase of speeds, 40 to 120 km/h in steps of 20 km/h: drag does not follow the mass.", 0.81, 64.2, 4.5,
)  # fmt: skip
GAIN = records.Gain(
    (
        records.ChannelGain("force_balance", "m/s^2", 0.1182, 0.0451, 0.311, 0.132),
        records.ChannelGain("kinematic", "m/s^2", 0.0512, 0.0511),
        records.ChannelGain("slip_rl", "-", 0.00213, 0.00209, 0.0031, 0.0032),
        records.ChannelGain("tie_rod_fl", "N", 21.3, 21.3),
    ),
    812.4, 700.2, 930.1, ("autumn.mf4", IMAGE), False,
    (
        records.Consequence("resistance", 12, 1, 84.2, 0.421, 0.402, 38, 38, 40),
        records.Consequence("joint_cusum", 0, 0, 84.2, None, None, 40, 40, 40),
    ),
    ("The intervals treat a drive as the unit.",), 790.0,
)  # fmt: skip
AGREED = records.Agreement(
    "payload_mass", "delta_mass",
    (
        records.ByDrive("b24.mf4", records.Estimate(268.1, 243.2, 293.0, "kg"), 255.3, 31.2),
        records.ByDrive(HOSTILE, records.Estimate(255.3, 228.9, 281.7, "kg"), 268.1, -0.72),
    ),
    0.482,
)  # fmt: skip
BASE = records.Diagnosis(
    verdict="named", sentence=MASS.sentence, drives=("b24.mf4", HOSTILE), duration_s=1265.0, used_s=1103.4,
    causes=(MASS,), alternatives=(records.Alternative((RADIUS, GROWTH), 14.3),), significance=FOUND, limits=LIMITS,
    confusions=CONFUSIONS, remainders=(), manoeuvre=None, gain=GAIN,
    model=Model((Term(EFFECTS["payload_mass"], {"delta_mass": 262.0}),)), channels=CHANNELS,
    untested={"relaxation_length": "needs torque above 2 Hz", "water_drag": "no water on these drives <b>"},
    notes=("The noise model is of order 18.",), agreement=(AGREED,),
)  # fmt: skip


def remainder():
    v = np.linspace(15.0, 35.0, 40)
    f = 0.08 * np.exp(-(((v - 26.0) / 3.0) ** 2))
    return records.Remainder(
        "force_balance", ("v_x",), 0.412, 0.0099, v[:, None], f, f - 0.011, f + 0.011, ("torque",), "aero_drag", 0.431,
        "Between 20 and 31 m/s the car is slowed more than the model says, by up to 0.08 m/s^2.",
    )  # fmt: skip


def surface():
    v, h = (x.ravel() for x in np.meshgrid(np.linspace(15.0, 35.0, 12), np.linspace(0.0, 0.002, 9)))
    f = 20.0 * h * (v / 30.0) ** 2
    f[3] = NAN
    return records.Remainder(
        "kinematic", ("v_x", "water_depth"), 0.2, NAN, np.column_stack([v, h]), f, f - 0.01, f + 0.01, (), None, NAN, ""
    )


def view(drive, channel, *, seed=1, gain=1.0, changed=True, n=6000):
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(n)
    v = 22.0 + 9.0 * np.sin(2 * np.pi * t / 240.0)
    a_x = np.gradient(v, t) + 0.3 * np.sin(2 * np.pi * t / 17.0)
    noise = SCALES[channel] * (rng.normal(size=n) + 0.6 * np.convolve(rng.normal(size=n), np.ones(15) / 4.0, "same"))
    before = noise + SCALES[channel] * gain * a_x * 2.0
    before[700:900] = NAN
    before[2 * n // 3] = 200.0 * SCALES[channel]
    after = noise.copy()
    after[700:900] = NAN
    title = {"force_balance": "Force balance", "kinematic": "Acceleration against wheel speeds"}.get(channel, channel)
    return records.ResidualView(
        drive, channel, title, UNITS[channel], 0.1,
        {"t": t, "v_x": v, "torque": 1600.0 * 0.31 * a_x + 90.0, "position": np.cumsum(v) * 0.1, "a_x": a_x},
        before, after if changed else before.copy(),
    )  # fmt: skip


def cases():
    nothing = replace(GAIN, log_score=1.4, low=-3.2, high=6.1, heldout=(), in_sample=True, consequences=())
    return {
        "named": BASE,
        "compound": replace(
            BASE, verdict="compound", causes=(MASS, RADIUS),
            sentence="The car weighed 262 kg more than the vehicle file says, and the tyre FL is 0.43 % too small.",
        ),
        "cannot_tell": replace(
            BASE, verdict="cannot_tell", causes=(MASS, TORQUE), alternatives=(), manoeuvre=HILL,
            sentence="262 kg more mass or 0.865 of the torque: this log cannot tell which.",
        ),
        "unexplained": replace(
            BASE, verdict="unexplained", agreement=(), causes=(), alternatives=(), remainders=(remainder(), surface()), gain=nothing,
            sentence="Force balance and speed hang together in a way that no known effect has.",
        ),
        "no_effect": replace(
            BASE, verdict="no_effect", agreement=(), causes=(), alternatives=(), significance=NOTHING, gain=None, model=Model(),
            sentence="Nothing is missing: a payload of 14.2 kg would have been seen.",
        ),
        "not_testable": replace(
            BASE, verdict="not_testable", agreement=(), causes=(), alternatives=(), significance=None, gain=None, limits=(),
            confusions=(), channels=(), used_s=0.0, model=Model(), untested={"all": "the log has no torque"},
            sentence="These drives cannot be tested: there is no wheel torque.",
        ),
    }  # fmt: skip


def views_of(verdict):
    if verdict == "not_testable":
        return ()
    changed = verdict in ("named", "compound", "cannot_tell")
    return tuple(
        view(d, c, seed=i, gain=1.0 if i % 6 == 0 else 0.1, changed=changed)
        for i, (d, c) in enumerate((d, c) for d in BASE.drives for c in CHANNELS)
    )


def numbers_in(value):
    """All numbers of a document, but not those within its texts."""
    if isinstance(value, dict):
        return [x for v in value.values() for x in numbers_in(v)]
    if isinstance(value, list):
        return [x for v in value for x in numbers_in(v)]
    return (
        [float(value)]
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        else []
    )
