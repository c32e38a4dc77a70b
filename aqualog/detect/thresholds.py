"""The threshold of each detector: the one number by which it is made more or less sensitive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from aqualog.core.errors import ConfigError
from aqualog.detect.registry import BY_NAME, DETECTORS

__all__ = ["DEFAULT", "Thresholds"]


class Thresholds(Mapping[str, float]):
    """One value per detector of the thesis, in its unit; a larger one means fewer alarms.

    An item and an attribute of a name are the same. All other values of a detector follow from
    physics and stay (drifts, hysteresis, memories).

    Parameters
    ----------
    values : float, by name
        Those left out keep the detector's default.

    Raises
    ------
    ConfigError
        If a value is not positive, or a share is not below 1.
    """

    __slots__ = ("_values",)

    def __init__(self, **values: float) -> None:
        unknown = [n for n in values if n not in DETECTORS]
        if unknown:
            raise ConfigError(f"no detector {unknown[0]!r}", expected=", ".join(DETECTORS))
        self._values = {n: values.get(n, BY_NAME[n].threshold) for n in DETECTORS}
        for name, value in self._values.items():
            d = BY_NAME[name]
            if not 0.0 < value < d.highest:
                bounds = "above 0" if math.isinf(d.highest) else f"between 0 and {d.highest:g}"
                raise ConfigError(
                    f"threshold {name} = {value:g} {d.unit}", expected=f"a value {bounds} ({d.meaning})"
                )  # fmt: skip

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __getattr__(self, name: str) -> float:
        if name.startswith("_") or name not in self._values:
            raise AttributeError(name)
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"Thresholds({', '.join(f'{n}={x!r}' for n, x in self._values.items())})"

    def __reduce__(self) -> tuple[object, ...]:
        return _made, (self._values,)

    def with_values(self, values: Mapping[str, float]) -> Thresholds:
        """Return the same with other values."""
        return Thresholds(**{**self._values, **values})

    def scaled(self, detector: str, factor: float) -> Thresholds:
        """Return the same with the threshold of one detector times a factor; a share as `Detector.scaled`."""
        return self.with_values({detector: BY_NAME[detector].scaled(self._values[detector], factor)})


def _made(values: Mapping[str, float]) -> Thresholds:
    return Thresholds(**values)


DEFAULT = Thresholds()
