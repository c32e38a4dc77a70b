"""The page of an examination: findings first, then pictures of the channels with the fault marked."""

import json
import re

import numpy as np
import pytest

from aqualog.core.records import Channel, ChannelInfo
from aqualog.doctor.findings import Examination, FileState, Finding
from aqualog.doctor.pictures import pictures_of
from aqualog.report.examination import examination_report
from aqualog.report.page import report_page
from aqualog.report.text import report_text

FILE = "drive.mf4"


def channel(name, values):
    t_ns = (np.arange(values.size) * 10_000_000).astype(np.int64)
    return Channel(ChannelInfo(name, name, "km/h", values.size, FILE), t_ns, values, absolute=False)


@pytest.fixture(scope="module")
def found():
    speed = 50.0 + np.random.default_rng(1).normal(0.0, 1.0, 10_000)
    speed[4000:6000] = speed[4000]
    torque = np.where(np.arange(10_000) // 100 == 30, np.nan, 7.0)
    findings = (
        Finding("mended", "wraps", FILE, "torque", "2 overflows of the time counter", "", 2, 10_000, 12.5),
        Finding("doubt", "frozen", FILE, "speed", "stands at 50 for 20 s", "check this part"),
        Finding("lost", "not_finite", FILE, "torque", "100 of 10000 samples are no numbers"),
        Finding("doubt", "code", FILE, "gear", "1022 looks like an error code", "invalid = [1022] in the map"),
    )
    gear = np.where(np.arange(10_000) >= 9000, 1022.0, 3.0)
    channels = [channel("speed", speed), channel("torque", torque), channel("gear", gear)]
    pictures = tuple(pictures_of(findings, channels))
    return Examination((FileState(FILE, "mdf", 1000, 2, 20_000, 0.0, 100.0),), findings, ("spin_down",), (), pictures)


def test_pictures_have_few_samples_and_the_times_of_the_faults(found):
    torque, speed, gear = found.pictures
    assert np.array(torque.spans) == pytest.approx(np.array([(12.5, 12.5), (30.0, 30.99)]))
    assert np.array(speed.spans) == pytest.approx(np.array([(40.0, 59.99)]), abs=0.02)
    assert np.array(gear.spans) == pytest.approx(np.array([(90.0, 99.99)]))
    assert speed.t.size < 2000
    assert speed.values.max() > 53.0
    assert np.isnan(torque.values).any()


def test_page_begins_with_the_gravest_finding_and_marks_it(found):
    page = report_page(examination_report(found), title="drive")
    words = re.sub(r"<[^>]+>|\s+", " ", page[page.index("<h1>") : page.index("<footer>")])
    assert "4 findings: 1 lost, 2 worth checking, 1 mended" in words
    assert words.index("100 of 10000 samples") < words.index("stands at 50") < words.index("2 overflows")
    assert words.index("2 overflows") < words.index("Detectors")
    figures = json.loads(re.search(r'id="figure-data">(.*?)</script>', page, re.DOTALL)[1])
    shapes = figures["picture-1"]["layout"]["shapes"]
    assert [(s["x0"], s["x1"]) for s in shapes] == [(pytest.approx(40.0, abs=0.02), pytest.approx(59.99, abs=0.02))]
    moment = figures["picture-0"]["layout"]["shapes"][0]
    assert 0.1 < moment["x1"] - moment["x0"] < 1.0


def test_text_is_without_the_page_s_tables(found):
    text = report_text(examination_report(found))
    assert text.startswith("drive.mf4: MDF, 1,000 bytes, 2 channels, 20,000 samples, 100.0 s\n\nlost:\n")
    assert text.count("stands at 50") == 1
