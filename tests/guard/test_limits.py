"""Limits of reading: their variables and defaults."""

import pytest

from aqualog.core.errors import ConfigError
from aqualog.guard.limits import ReadLimits, limits_from
from aqualog.guard.system import machine_memory


def test_limits_are_named_by_variables():
    limits = limits_from({"AQUALOG_LIMIT_S": "5", "AQUALOG_LIMIT_MB": "0", "AQUALOG_LIMIT_FILE_MB": "1.5"})
    assert limits == ReadLimits(wall_s=5.0, memory=0, file=1_500_000)
    assert (limits.wall_for(10**9), limits.memory_here(), limits.file_for(10**9)) == (5.0, 0, 1_500_000)
    # 100 h of MF4, 4.6 GB, are read in 4 min and 0.7 GB
    assert ReadLimits().wall_for(4_600_000_000) > 3600.0
    assert ReadLimits().memory_here() >= min(2_000_000_000, machine_memory())
    for text in ("x", "-1", "nan", "inf", "1e10"):
        with pytest.raises(ConfigError, match=r"AQUALOG_LIMIT_CPU_S: is .* expected a number of seconds"):
            limits_from({"AQUALOG_LIMIT_CPU_S": text})
    assert limits_from({"AQUALOG_LIMIT_FILE_MB": "1e-300"}).file == 1  # not 0, which is none
    with pytest.raises(ConfigError, match=r"AQUALOG_LIMIT_MB: is '200'; expected 300 or more, or 0 for no limit"):
        limits_from({"AQUALOG_LIMIT_MB": "200"})
