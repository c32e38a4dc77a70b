"""A drive's events as spans of a log."""

import json
import math
from dataclasses import replace

from aqualog.core.judgement import Episode, Judgement
from aqualog.report.drive.document import document, result_events
from tests.report.fake_result import make_result


def test_each_event_becomes_a_span_with_what_the_document_says():
    result = make_result()
    events, spans = document(result, log="a.mf4")["events"], result_events(result)
    spans = [s for s in spans if s.properties["kind"] == "event"]
    assert len(spans) == len(events) > 3
    for event, span in zip(events, spans, strict=True):
        assert (span.start_ns, span.end_ns) == (round(event["start_s"] * 1e9), round(event["end_s"] * 1e9))
        told = {k: v for k, v in {**event, **event["evidence"]}.items() if v is not None and k != "evidence"}
        assert dict(span.properties) == {"kind": "event"} | {
            k: v if isinstance(v, str) else json.dumps(v) for k, v in told.items()
        }
    spin_down = next(s for s in spans if s.properties["detector"] == "spin_down")
    assert spin_down.name == f"Spin-down {spin_down.properties['wheel'].upper()}"


def test_each_episode_becomes_a_span():
    episode = Episode(
        "aquaplaning",
        8.2,
        17.7,
        ("fr", "fl"),
        "f",
        None,
        "partial",
        28.0,
        ("resistance",),
        1.1,
        -0.2,
        0.0,
        math.nan,
        (0,),
    )
    span, *_ = result_events(replace(make_result(), judgement=Judgement("aquaplaning", episodes=(episode,))))
    assert (span.name, span.start_ns, span.end_ns) == ("Aquaplaning", 8_200_000_000, 17_700_000_000)
    assert span.text == "8.2–17.7 s, 101 km/h, front right, front left, partial"
    assert {k: span.properties[k] for k in ("kind", "wheels", "v_x_kmh", "axle")} == {
        "kind": "aquaplaning", "wheels": '["fr", "fl"]', "v_x_kmh": "100.8", "axle": "f",
    }  # fmt: skip
    assert "distance_m" not in span.properties
