"""Settings of the detectors from a thresholds file."""

from __future__ import annotations

from pathlib import Path

from aqualog.config.thresholds import load_thresholds
from aqualog.detect.stream import Settings

__all__ = ["load_settings"]


def load_settings(path: Path) -> Settings:
    """Read and check a thresholds file.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    thresholds, _ = load_thresholds(path)
    return Settings(thresholds=thresholds)
