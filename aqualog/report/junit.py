"""Test results as JUnit XML, which build servers show."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["Case", "Suite", "junit_xml"]


@dataclass(frozen=True, slots=True)
class Case:
    """One test. `failure` says what was not as asked for, `error` why it could not be tried; both empty: passed."""

    group: str
    name: str
    failure: str = ""
    error: str = ""
    output: str = ""


@dataclass(frozen=True, slots=True)
class Suite:
    """Tests that belong together."""

    name: str
    cases: Sequence[Case]


def junit_xml(suites: Sequence[Suite]) -> str:
    """Return suites as JUnit XML, with a line end at the end; characters that XML cannot hold become blanks."""
    root = ET.Element("testsuites", _counts([c for s in suites for c in s.cases]))
    for suite in suites:
        of_suite = ET.SubElement(root, "testsuite", {"name": _clean(suite.name), **_counts(suite.cases)})
        for case in suite.cases:
            one = ET.SubElement(
                of_suite, "testcase", {"classname": _clean(case.group), "name": _clean(case.name), "time": "0"}
            )
            for kind, text in (("failure", case.failure), ("error", case.error)):
                if text:
                    ET.SubElement(one, kind, {"message": _clean(text), "type": kind}).text = _clean(text)
            if case.output:
                ET.SubElement(one, "system-out").text = _clean(case.output)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _counts(cases: Sequence[Case]) -> dict[str, str]:
    failures, errors = sum(bool(c.failure) for c in cases), sum(bool(c.error) for c in cases)
    return {"tests": str(len(cases)), "failures": str(failures), "errors": str(errors), "time": "0"}


def _clean(text: str) -> str:
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)
