"""Values and records as JSON holds them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

__all__ = ["fields_of", "plain"]


def plain(value: Any, digits: int | None = 9) -> Any:
    """A value for JSON: NaN and infinities become null, floats keep so many significant digits (None: all)."""
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return float(value) if digits is None else float(f"{value:.{digits}g}")
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), digits)
    if isinstance(value, list | tuple):
        return [plain(v, digits) for v in value]
    if isinstance(value, Mapping):
        return {k: plain(v, digits) for k, v in value.items()}
    return value


def fields_of(record: Any, *names: str, digits: int | None = 9, **renamed: str) -> dict[str, Any]:
    """Fields of a record for JSON, in this order; `renamed` are those that the document calls otherwise."""
    both = {**{name: name for name in names}, **renamed}
    return {key: plain(getattr(record, name), digits) for key, name in both.items()}
