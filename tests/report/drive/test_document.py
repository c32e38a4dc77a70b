"""A drive's events as spans of a log."""

import json

from aqualog.report.drive.document import document, result_events
from tests.report.fake_result import make_result


def test_each_event_becomes_a_span_with_what_the_document_says():
    result = make_result()
    events, spans = document(result, log="a.mf4")["events"], result_events(result)
    assert len(spans) == len(events) > 3
    for event, span in zip(events, spans, strict=True):
        assert (span.start_ns, span.end_ns) == (round(event["start_s"] * 1e9), round(event["end_s"] * 1e9))
        told = {k: v for k, v in {**event, **event["evidence"]}.items() if v is not None and k != "evidence"}
        assert dict(span.properties) == {"kind": "event"} | {
            k: v if isinstance(v, str) else json.dumps(v) for k, v in told.items()
        }
    spin_down = next(s for s in spans if s.properties["detector"] == "spin_down")
    assert spin_down.name == f"Spin-down {spin_down.properties['wheel'].upper()}"
