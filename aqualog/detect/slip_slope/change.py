"""Detect changes in the prediction error of the filter."""

from __future__ import annotations

from aqualog.core.compiled import compiled

__all__ = ["cusum_input"]


@compiled
def cusum_input(innovation, direction, adapted):  # type: ignore[no-untyped-def]
    """Return the statistic to sum: the prediction error, or its projection on the sign of the traction.

    Parameters
    ----------
    innovation : float
        epsilon = y - h(x, 0). [-]
    direction : float
        Has the sign of the slip: the differential traction mu_delta. The thesis takes the differential slip. There the
        radii's error is often larger than the slip, so that its sign does not alternate. With the estimated offset
        removed it does (E12), but it then holds the same noise as epsilon, and sgn(u + v) v drifts upwards by up to
        0.8 of the noise's rms. The traction has neither fault. [-]
    adapted : bool
        True: sgn(direction) epsilon, positive where the slip is larger than the slope explains, whichever way the
        traction goes. False: epsilon.

    Thesis: Eq. (3.23); adapted, (3.25) with E12. The sums (3.24) are `detect.cusum.step`.
    """
    if not adapted:
        return innovation
    if direction > 0.0:
        return innovation
    return -innovation if direction < 0.0 else 0.0
