"""Every field of every JSON document, and the columns of the tables that aqualog writes."""

from __future__ import annotations

from aqualog.book.documents import campaigns, drives, judged, trade
from aqualog.book.documents.fields import Document

__all__ = ["DOCUMENTS"]

DOCUMENTS: dict[str, Document] = {
    d.name: d
    for d in (
        drives.DETECT, drives.SLIP_SLOPE, drives.INIT, drives.INSPECT, drives.DOCTOR, drives.ALIGN, drives.CALIBRATE,
        judged.DIAGNOSE, judged.EVALUATE, drives.SIMULATE, campaigns.INIT, campaigns.INSPECT, campaigns.BATCH,
        campaigns.PLAN, campaigns.BIN_SLIP_SLOPE, campaigns.BIN_RESISTANCE, trade.STRAIGHT, trade.CURVE, trade.BRAKING,
        judged.FIGURES, judged.REPRODUCE, drives.CACHE, judged.VALIDATE, campaigns.MANIFEST,
        campaigns.HISTORY,
    )
}  # fmt: skip
"""By name, which is that of the schema file too."""
