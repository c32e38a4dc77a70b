"""Many drives together: results per log kept, regressions over speed, the number a tyre engineer wants."""
