"""Change detection on the prediction error of the filter."""

from __future__ import annotations

from aqualog.compiled import compiled

__all__ = ["cusum_input"]


@compiled
def cusum_input(innovation, slip, adapted):  # type: ignore[no-untyped-def]
    """What is summed up: the prediction error, or that in the direction of the slip.

    Parameters
    ----------
    innovation : float
        epsilon = y - h(x, 0). [-]
    slip : float
        Differential slip without its estimated offset, s_delta - delta. With the offset in it, which is often larger
        than the slip, the sign would not alternate (E12). [-]
    adapted : bool
        True: sgn(slip) epsilon, positive where the slip is larger than the slope explains, whichever way the traction
        goes. False: epsilon.

    Thesis: Eq. (3.23); adapted, (3.25) with E12. The sums (3.24) are `detect.cusum.step`.
    """
    if not adapted:
        return innovation
    if slip > 0.0:
        return innovation
    return -innovation if slip < 0.0 else 0.0
