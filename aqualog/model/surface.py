"""Road surfaces as data: friction, yield, roughness and extra rolling resistance."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SURFACES", "Surface"]


@dataclass(frozen=True, slots=True)
class Surface:
    """One surface.

    `mu` is the friction of a tyre on it [-], None for the vehicle's own on dry asphalt; `compliance` the inverse slip
    slope of a layer that yields [-]; `rolling` extra rolling resistance coefficient [-]; `roughness` rms of the wheel
    torque that unevenness makes [N·m]; `source` where the values come from (K: general knowledge).
    """

    name: str
    mu: float | None = None
    compliance: float = 0.0
    rolling: float = 0.0
    roughness: float = 0.0
    source: str = ""


SURFACES: dict[str, Surface] = {
    s.name: s
    for s in (
        Surface("asphalt"),
        Surface("damp", mu=0.85, source="wet without a layer of water: least effect on the slope (V, [carlson2005])"),
        # slope 30 -> 10 on low friction (thesis 3.3): 1/10 = 1/30 + 1/15
        Surface("snow", mu=0.30, compliance=1.0 / 15.0, rolling=0.012, roughness=15.0, source="snow on asphalt (K)"),
        Surface("snow_on_ice", mu=0.29, compliance=1.0 / 30.0, rolling=0.008, roughness=8.0, source="Fig. 3.1 (D)"),
        Surface("deep_snow", mu=0.30, compliance=1.0 / 12.0, rolling=0.035, roughness=25.0, source="fresh (K)"),
        Surface("ice", mu=0.12, source="dry ice: slope as on asphalt (thesis 3.1)"),
        Surface("wet_ice", mu=0.06, compliance=1.0 / 60.0, source="thesis Fig. 3.1 (D)"),
        Surface("gravel", mu=0.60, compliance=1.0 / 25.0, rolling=0.015, roughness=60.0, source="(K)"),
        Surface("rough", roughness=60.0, source="broken asphalt (K)"),
    )
}  # fmt: skip
