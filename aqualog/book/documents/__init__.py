"""Every field of every JSON document, and the columns of the tables that aqualog writes."""

from __future__ import annotations

from aqualog.book.documents import (
    align,
    cache,
    calibrate,
    campaign,
    detect,
    diagnose,
    doctor,
    evaluate,
    files,
    regressions,
    simulate,
    slip_slope,
    thesis,
)
from aqualog.book.documents import inspect as inspect_log
from aqualog.book.documents.fields import Document

__all__ = ["DOCUMENTS"]

DOCUMENTS: dict[str, Document] = {
    d.name: d
    for d in (
        detect.DOCUMENT,
        slip_slope.DOCUMENT,
        inspect_log.DOCUMENT,
        doctor.DOCUMENT,
        align.DOCUMENT,
        calibrate.DOCUMENT,
        diagnose.DOCUMENT,
        evaluate.DOCUMENT,
        simulate.DOCUMENT,
        campaign.INIT,
        campaign.INSPECT,
        campaign.BATCH,
        campaign.PLAN,
        regressions.SLIP_SLOPE,
        regressions.RESISTANCE,
        thesis.FIGURES,
        thesis.REPRODUCE,
        cache.DOCUMENT,
        files.MANIFEST,
        files.HISTORY,
    )
}
"""By name, which is that of the schema file too."""
