"""Events in written logs, as asammdf and mcap read them."""

import json
import xml.etree.ElementTree as ET

import asammdf
import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader

from aqualog.io.log_event import LogEvent
from aqualog.io.open_log import open_log
from aqualog.io.write_log import LogGroup, write_log

START_NS = 1_748_000_000_000_000_000
T_NS = np.arange(300, dtype=np.int64) * 10_000_000
NAME = "{http://www.asam.net/mdf/v4}"
EVENTS = (
    LogEvent("Spin-down FR", 1_250_000_000, 2_500_000_000, "slip <-2 %> & more", {"wheel": "fr", 'peak "v"': "3.5"}),
    LogEvent("Resistance", 10_000_000, 2_990_000_000, "a\x00b", {}),
)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    groups = [LogGroup("signals", {"v_x": ("m/s", "speed", T_NS * 1e-9)})]
    for suffix in (".mf4", ".mcap"):
        write_log(folder / f"a{suffix}", T_NS, groups, suffix=suffix, start_ns=START_NS, events=EVENTS)
        write_log(folder / f"none{suffix}", T_NS, groups, suffix=suffix, start_ns=START_NS)
    return folder


def test_mdf_holds_each_event_as_a_range(written):
    with asammdf.MDF(written / "a.mf4") as mdf:
        blocks = mdf.events
        assert [(b.name, round(b.value, 9), b.range_type) for b in blocks] == [
            ("Spin-down FR", 1.25, 1), ("Spin-down FR", 2.5, 2), ("Resistance", 0.01, 1), ("Resistance", 2.99, 2),
        ]  # fmt: skip
        assert [b.range_start_ev_addr for b in blocks] == [0, blocks[0].address, 0, blocks[2].address]
        first, second = (ET.fromstring(blocks[i].comment) for i in (0, 2))
    assert (first.tag, first.findtext(f"{NAME}TX")) == (f"{NAME}EVcomment", "slip <-2 %> & more")
    assert {e.get("name"): e.text for e in first.iter(f"{NAME}e")} == dict(EVENTS[0].properties)
    assert second.findtext(f"{NAME}TX") == "a b"


def test_mcap_holds_each_event_as_a_message_of_the_timeline(written):
    with (written / "a.mcap").open("rb") as file:
        found = [(s, m.log_time, json.loads(m.data)) for s, _, m in make_reader(file).iter_messages("/aqualog/events")]
    assert [(s.name, s.encoding, t) for s, t, _ in found] == [
        ("foxglove.Event", "jsonschema", START_NS + e.start_ns) for e in reversed(EVENTS)
    ]
    for schema, _, event in found:
        jsonschema.Draft202012Validator(json.loads(schema.data)).validate(event)
    last = found[-1][2]
    assert (last["start_time"], last["end_time"]) == (
        {"sec": START_NS // 10**9 + 1, "nsec": 250_000_000}, {"sec": START_NS // 10**9 + 2, "nsec": 500_000_000},
    )  # fmt: skip
    pairs = {p["key"]: p["value"] for p in last["metadata"]}
    assert pairs == {"name": "Spin-down FR", "text": "slip <-2 %> & more", **EVENTS[0].properties}


@pytest.mark.parametrize("suffix", [".mf4", ".mcap"])
def test_signals_are_as_without_events(written, suffix):
    with open_log(written / f"a{suffix}") as with_events, open_log(written / f"none{suffix}") as without:
        plain = without.read(without.channels())
        same = with_events.read([c for c in with_events.channels() if "events" not in c.path])
    assert [c.info.path for c in same] == [c.info.path for c in plain]
    assert len(plain) == 1
    np.testing.assert_array_equal(same[0].values, plain[0].values)


def test_without_events_there_is_no_topic(written):
    with (written / "none.mcap").open("rb") as file:
        assert [c.topic for c in make_reader(file).get_summary().channels.values()] == ["/signals"]
