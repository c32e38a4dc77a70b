"""`aqualog simulate SCENARIO --json`."""

from __future__ import annotations

from aqualog.book.documents.fields import HEAD, Document, count, number, several, text

__all__ = ["DOCUMENT"]

DOCUMENT = Document(
    "simulate",
    "aqualog simulate SCENARIO --json",
    "What was simulated, and how fast.",
    (
        *HEAD,
        text("log", "the log that was written"),
        number("duration_s", "s", "length of the drive"),
        number("sample_rate_hz", "Hz", "rate of the fastest signals"),
        count("seed", "seed of the random numbers"),
        several("signals", "signals in the log, the truth among them"),
        number("real_time_factor", "-", "simulated time over computing time"),
    ),
    files=("simulation.json",),
)
