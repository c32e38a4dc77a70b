"""Wet grip index of a set of stops, by coefficients of the user's own copy of the regulation."""

from __future__ import annotations

from dataclasses import dataclass

from aqualog.core.vehicle import Key

__all__ = ["COEFFICIENT_KEYS", "Coefficients", "wet_grip_index"]

COEFFICIENT_KEYS: dict[str, Key] = {
    k.name: k
    for k in (
        Key("", "scale", "-", 125.0, 1.0, 1000.0, "index times 100 of a tyre that brakes as the control does", "K"),
        Key("", "a", "1/K", 0.0, -10.0, 10.0, "per degree of the stops' temperature beyond t0", "your copy"),
        Key("", "t0", "degC", 20.0, -20.0, 60.0, "reference temperature", "your copy"),
        Key("", "b", "-", 0.0, -1000.0, 1000.0, "per relative deviation of the control from bfc_r0", "your copy"),
        Key("", "bfc_r0", "-", 0.7, 0.1, 2.0, "braking force coefficient that the control should have", "your copy"),
    )
}
"""Keys of a file of coefficients; all must be given."""


@dataclass(frozen=True, slots=True)
class Coefficients:
    """Coefficients of the wet grip index; `name` is what they are called in the file."""

    name: str
    scale: float
    a: float
    t0: float
    b: float
    bfc_r0: float


def wet_grip_index(bfc: float, bfc_control: float, temperature: float, c: Coefficients) -> float:
    """Wet grip index G of a tyre.

    Parameters
    ----------
    bfc, bfc_control : float
        Braking force coefficients of the tyre and of the control at its place in the order. [-]
    temperature : float
        Mean of the tyre's stops. [degC]
    c : Coefficients
        From the user's copy of the regulation.

    Returns
    -------
    G : float
        (scale bfc / bfc_control + a (t - t0) + b (bfc_control / bfc_r0 - 1)) / 100. [-]

    Limits: a tyre that brakes as the control does, at t0, with a control at bfc_r0: scale / 100.

    Source: the form is general knowledge (K) of UN R117 [unece_r117_2011]; the numbers are the user's.
    """
    ratio = bfc / bfc_control
    return (c.scale * ratio + c.a * (temperature - c.t0) + c.b * (bfc_control / c.bfc_r0 - 1.0)) / 100.0
