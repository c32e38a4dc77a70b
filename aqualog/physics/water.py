"""Water that a wheel moves, and what it leaves for the wheel behind."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["RHO_WATER", "drained_share", "film_drag", "residual_film", "skimming_share", "wave_drag"]

RHO_WATER = 1000.0  # [kg/m^3]


def drained_share(h_w: FloatArray | float, *, tread_capacity: FloatArray | float) -> FloatArray | float:
    """Share of the water that finds room in the tread's grooves, (1 + (h / c)^3)^(-1/3).

    Parameters
    ----------
    h_w : array
        Water in front of the wheel, >= 0. [m]
    tread_capacity : array or float
        c: water that the grooves can take, as a depth, >= 0. [m]

    Returns
    -------
    share : array
        1 without water, c / h in deep water: full grooves. A film of just the capacity leaves 21 % outside, because
        grooves and water are not spread alike. [-]

    Source: conservation of mass in both limits. The power between them is an assumption: treaded tyres hardly float
    in less than they can take, [gengenbach1968] as [gallaway1979] quotes it.
    """
    fill = h_w / np.maximum(tread_capacity, 1e-12)
    return (1.0 + fill * fill * fill) ** (-1.0 / 3.0)


def skimming_share(v: FloatArray, v_full: FloatArray) -> FloatArray:
    """How the water's resistance falls beyond full aquaplaning, (v_full / v)^3, at most 1.

    Parameters
    ----------
    v : array
        Speed over the water. [m/s]
    v_full : array
        Speed of full aquaplaning of the wheel as it turns now. [m/s]

    Returns
    -------
    share : array
        Of the resistance of a tyre that reaches down to the road. With resistance ~ v^2 it then falls as 1 / v. [-]

    A tyre that skims turns aside a layer ~ 1 / v^2, which alone would keep the resistance as it was. It falls beyond
    the speed of full aquaplaning, where the bow wave is suppressed too.

    Source: NASA TN D-2056 [horne1963] that it peaks there; the power is an assumption.
    """
    return np.minimum(v_full / np.maximum(np.abs(v), 1e-3), 1.0) ** 3


def film_drag(
    h_w: FloatArray,
    v: FloatArray,
    v_tread: FloatArray,
    *,
    width: float,
    tread_capacity: float,
    h_film: float,
    relief: float,
) -> FloatArray:
    """Force that it costs to bring the film under the tread to a speed.

    Parameters
    ----------
    h_w : array
        Water in front of the wheel, >= 0. [m]
    v : array
        Speed over the water. [m/s]
    v_tread : array
        Speed that the film is given: omega r_e by a tread that throws it, v - omega r_e by one that skids. [m/s]
    width : float
        Width of the contact. [m]
    tread_capacity : float
        Water that the grooves can take, as a depth. [m]
    h_film : float
        Thickness of the film that the tread accelerates. [m]
    relief : float
        What grooves that take all the water save of it, 0 ... 1. [-]

    Returns
    -------
    F : array
        Of a throwing tread at the wheel's circumference, against its rotation; of a skidding one against the motion of
        the wheel's centre. [N]

    rho b v v_tread min(h, h_film) (1 - relief drained): momentum of the water flow, v^2 for a rolling wheel (NASA
    TN D-552: parabolic). The film saturates at h_film, because measured resistance hardly changes between 0.6 and
    1.3 mm (thesis Fig. 2.11), where momentum alone would double. Water in grooves stays behind at rest, so that a tread
    with 0.4 mm of capacity and a relief of 0.7 still rises by 38 % in between, one without grooves not at all.
    Limits: 0 without water or speed.

    Source: a momentum balance, derived; parabolic in speed as in NASA TN D-552 [horne1960]; saturation by Fig. 2.11 of
    [fichtinger2024] (C38).
    """
    film = np.minimum(h_w, h_film) * (1.0 - relief * drained_share(h_w, tread_capacity=tread_capacity))
    return RHO_WATER * width * film * v * v_tread


def wave_drag(h_w: FloatArray, v: FloatArray, *, width: float, h_wave: float) -> FloatArray:
    """Force of the bow wave that deeper water raises in front of the wheel, rho b (h - h_wave) v^2, >= 0.

    Parameters
    ----------
    h_w, v, width
        As in `film_drag`.
    h_wave : float
        Depth from which water is pushed ahead. [m]

    Returns
    -------
    F : array
        Against the motion of the wheel's centre. The pressure acts normal to the round tread, its line passes the axle:
        no torque. [N]

    About linear in depth and parabolic in speed (NASA TN D-552); begins beyond 1.3 mm (thesis Fig. 2.11: at 2 mm the
    level and gradient rise).

    Source: derived; linear in depth and parabolic in speed as in NASA TN D-552 [horne1960]; onset by Fig. 2.11 of
    [fichtinger2024] (C38).
    """
    return RHO_WATER * width * np.maximum(h_w - h_wave, 0.0) * v * v


def residual_film(h_w: FloatArray, L_front: FloatArray, *, h_track: float) -> FloatArray:
    """Water that a front wheel leaves in its track.

    Parameters
    ----------
    h_w : array
        Undisturbed water, >= 0. [m]
    L_front : array
        Remaining contact share of the front wheel, 0 ... 1. [-]
    h_track : float
        Film that a wheel with full contact leaves of deep water. [m]

    Returns
    -------
    h : array
        k + (h - k) (1 - L)^6 with k = h_track (1 - exp(-h / h_track)). [m]

    A wheel squeezes out a share that grows with the depth: much of 2 mm, little of 0.2 mm, which lies in texture and
    grooves. As long as it keeps half of its contact, the film depends little on the depth (thesis 2.3 on Fig. 2.17). A
    wheel that floats clears nothing; the sixth power makes the passage, over the last third of the contact, smooth.
    Limits:
    L = 0 leaves h; L = 1 leaves h of a thin film, and h_track of deep water.

    Source: an assumption in shape, after Fig. 2.17 of [fichtinger2024] (C50).
    """
    lost = 1.0 - np.minimum(np.maximum(L_front, 0.0), 1.0)
    kept = h_track * (1.0 - np.exp(-h_w / h_track))
    return kept + (h_w - kept) * lost**6
