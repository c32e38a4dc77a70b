"""JUnit XML as build servers read it."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from aqualog.report.junit import Case, Suite, junit_xml

TEXT = junit_xml(
    [
        Suite("gates", [Case("gates.a", "a>=1"), Case("gates.a", "a<2", 'was 3 & "more"\x1b', output="3")]),
        Suite("drives", [Case("drives", "x.mf4", error="cannot be read")]),
    ]
)


def test_counts_and_kinds():
    root = ET.fromstring(TEXT.encode())
    assert TEXT.startswith('<?xml version="1.0" encoding="UTF-8"?>\n')
    assert (root.tag, [root.get(k) for k in ("tests", "failures", "errors")]) == ("testsuites", ["3", "1", "1"])
    gates, drives = root
    assert [gates.get(k) for k in ("name", "tests", "failures", "errors")] == ["gates", "2", "1", "0"]
    assert [[(e.tag, e.get("message")) for e in case] for case in (*gates, *drives)] == [
        [], [("failure", 'was 3 & "more" '), ("system-out", None)], [("error", "cannot be read")],
    ]  # fmt: skip
    assert {k for case in root.iter("testcase") for k in case.attrib} == {"classname", "name", "time"}


def test_it_is_valid_by_the_schema_of_the_build_server():
    """The schema of Jenkins' plug-in for test results, under the MIT licence that stands in it."""
    etree = pytest.importorskip("lxml.etree")
    schema = etree.XMLSchema(etree.parse(Path(__file__).with_name("junit-10.xsd")))
    schema.assertValid(etree.fromstring(TEXT.encode()))
