"""Many drives together: stored results per log, regressions over speed, speed of full aquaplaning."""
