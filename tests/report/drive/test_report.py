"""The page without a browser: what it says, what it escapes, what it must not hold."""

import base64
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import polars as pl
import pytest

import aqualog.report
from aqualog.core.judgement import Episode, Judgement
from aqualog.core.records import Margin, Quality, Unavailable
from aqualog.report.drive.judged import headline, judged_by
from aqualog.report.drive.report import FIRST_EVENTS, MOST_ROWS, detections_line, drive_page, drive_report, event_cells
from aqualog.report.page import write_page
from aqualog.report.reduce import POINTS
from aqualog.report.text import report_text
from tests.report import fake_result as fake

TEMPLATES = Path(aqualog.report.__file__).parent / "templates"


@pytest.fixture(scope="module")
def short():
    return fake.make_result()


@pytest.fixture(scope="module")
def page(short):
    return drive_page(short, title="run 12")


@pytest.fixture(scope="module")
def hour():
    return fake.make_result(3600.0)


class Reader(HTMLParser):
    """Elements with attributes, and the text outside scripts and styles."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.text, self._inside = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in ("script", "style"):
            self._inside = tag

    def handle_endtag(self, tag):
        if tag == self._inside:
            self._inside = ""

    def handle_data(self, data):
        if not self._inside:
            self.text.append(data)

    @property
    def words(self):
        return " ".join(" ".join(self.text).split())


def data_of(text):
    return json.loads(re.search(r'id="drive-data">(.*?)</script>', text, re.DOTALL)[1])


def decode(line):
    read = {"full": "<f4", "index": "<u4", "value": "<f4"}
    return {k: np.frombuffer(base64.b64decode(line[k]), dtype=d) for k, d in read.items()}


def test_same_result_same_bytes(short, tmp_path):
    write_page(tmp_path / "a.html", drive_page(short, title="\udcff"))
    write_page(tmp_path / "b.html", drive_page(fake.make_result(), title="\udcff"))
    assert "<h1>?</h1>" in (tmp_path / "a.html").read_text(encoding="utf-8")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert [p.name for p in tmp_path.iterdir() if p.name not in ("a.html", "b.html")] == []


def test_templates_switch_no_escaping_off():
    for path in TEMPLATES.glob("*.j2"):
        text = path.read_text(encoding="utf-8")
        assert "|safe" not in text.replace(" ", "")
        assert "autoescape" not in text
    assert "innerHTML" not in (TEMPLATES / "drive.js").read_text(encoding="utf-8")


def card(result):
    """Class and words of the verdict's card."""
    page = drive_page(result, title="t")
    text = re.search(r'<section id="verdict" class="(.*?)">(.*?)</section>', page, re.DOTALL)
    return text[1].split()[-1], Reader(text[2]).words


def test_verdict_comes_first_and_names_the_episode(page, short):
    (wet,) = short.judgement.of("aquaplaning")
    look, words = card(short)
    assert look == "partial"
    assert words.startswith(f"Aquaplaning: {wet.start_s:.1f}–{wet.end_s:.1f} s, 94 km/h, front left, front right, ")
    assert "Not judged: Slip-slope drop (needs torque_rl); Tie-rod force (needs tie_rod_fl, tie_rod_fr)" in words
    assert Reader(page).words.index("Aquaplaning:") < 400


def test_shades_end_with_the_water_not_with_the_alarms(page, short):
    (wet,) = short.judgement.of("aquaplaning")
    shaded = data_of(page)["shaded"]
    assert len(shaded) == len(short.events)
    assert {tuple(shaded[i]) for i in wet.events} == {(wet.start_s, wet.end_s)}
    alone = [i for i in range(len(shaded)) if i not in wet.events]
    assert all(shaded[i] == [short.events[i].start_s, short.events[i].end_s] for i in alone)
    assert any(short.events[i].end_s < wet.end_s for i in wet.events)  # else nothing is shown


def test_several_episodes_are_counted_and_listed(short):
    later = [replace(e, start_s=e.start_s + 20.0, end_s=e.end_s + 20.0, severity="full") for e in short.events]
    look, words = card(fake.with_events(short, [*short.events, *later]))
    assert look == "full"
    assert words.startswith("Aquaplaning: 2 episodes, 1 full 8.")


def test_without_the_joint_detectors_nothing_is_green_or_orange(short):
    """D5: one event of a single detector, or none, where nobody could judge."""
    spin = [e for e in short.events if e.detector == "minor_spin_down" and e.wheel == "fr"][:1]
    for events in ((), spin, [e for e in short.events if not e.detector.startswith("joint")]):
        look, words = card(fake.with_events(short, events, can_judge=False))
        assert look == "open"
        assert words.startswith("Aquaplaning cannot be judged: no wheel torque, no mass in a vehicle file ")
        assert "Ran: Spin-down; no single detector decides by itself" in words
    assert "Single detector: 8.4–8.9 s" in card(fake.with_events(short, spin))[1]


@pytest.mark.parametrize(
    ("sizes", "said"),
    [((), "the resistance raised no alarm"), ((0.41, 0.7), "resistance in 2 episodes, up to 0.70 m/s²")],
)
def test_resistance_is_shown_where_it_is_all_there_is(sizes, said):
    """The BMW i3 without wheel speeds."""
    alone = [
        Episode("single_detector", 9.0 * i, 9.0 * i + 5.0, (), None, None, "partial", 20.0, ("resistance",), x, math.nan,
                math.nan, 100.0, (i,)) for i, x in enumerate(sizes)
    ]  # fmt: skip
    blind = Judgement("cannot_be_judged", ("omega_fl", "omega_fr"), ("resistance",), tuple(alone))
    assert judged_by(blind, 100.0) == ("Ran:", f"Resistance; no single detector decides by itself; {said}")
    assert "resistance" not in judged_by(replace(blind, ran=("spin_down",)), 100.0)[1]


@pytest.mark.parametrize(("judged_s", "part"), [(15.0, " in the 15.0 of 40.0 s that can be judged"), (38.0, "")])
def test_the_first_sentence_says_if_much_of_the_drive_is_not_judged(judged_s, part):
    found = Judgement("none", (), ("joint_criteria",), (), judged_s)
    assert headline(found, duration_s=40.0) == f"No aquaplaning{part}"


def test_no_episode_says_what_was_judged_and_what_was_not(short):
    look, words = card(fake.with_events(short, ()))
    assert look == "none"
    assert words.startswith("No aquaplaning Judged: 30.0 of 30.0 s, by Spin-down, Minor spin-down")
    assert "Not judged:" in words
    page = drive_page(fake.with_events(short, ()), title="t")
    assert not any(f'id="{table}"' in page for table in ("events", "episodes", "more-episodes"))


def test_a_warning_without_an_episode_is_in_the_verdict(short):
    margin = Margin(15.4 / 3.6, (3.0 / 3.6, 41.8 / 3.6), 42.2, 40.8)
    warned = drive_report(replace(fake.with_events(short, ()), margin=margin))
    first = "No aquaplaning, but a warning from 40.8 s on: at the least 15 km/h (3 ... 42) to full aquaplaning"
    assert report_text(warned).splitlines()[0] == first
    assert card(replace(fake.with_events(short, ()), margin=margin))[0] == "partial"
    calm = drive_report(replace(fake.with_events(short, ()), margin=replace(margin, warned_s=math.nan)))
    assert report_text(calm).splitlines()[0] == "No aquaplaning"
    assert "warning" not in report_text(drive_report(replace(short, margin=margin))).splitlines()[0]


def test_lock_ups_are_folded(short):
    """D6: a drive with many lock-ups says in one line that none of them is aquaplaning."""
    lock = replace(short.events[0], evidence={"braking": True, "braking_at_start": True, "v_x": 20.0})
    drive = fake.with_events(short, [replace(lock, start_s=5.0 * k, end_s=5.0 * k + 1.0) for k in range(40)])
    look, words = card(drive)
    assert look == "none"
    assert "Braking slip: 40 episodes, 40 detections" in words
    page = drive_page(drive, title="t")
    assert '<details class="fold"><summary>Braking slip: 40 episodes, 40 detections</summary>' in page
    assert '<details class="fold"><summary>40 detections, one by one</summary>' in page
    assert detections_line(drive.judgement, 43) == "43 detections, one by one, 3 in no episode"
    text = report_text(drive_report(drive))
    assert text.startswith("No aquaplaning\n")
    assert "Braking slip: 40 episodes, 40 detections; --json lists them" in text
    assert "Spin-down  FL" not in text


def test_problems_are_in_a_box(short):
    words = Reader(drive_page(short, title="t")).words
    assert "5 samples were not used. The time jumps once. a_x: 3 samples out of range" in words
    quality = Quality(truncated=True, dropped_samples=9, lost_in_files=4)
    cut = replace(short, signals=replace(short.signals, quality=quality))
    words = Reader(drive_page(cut, title="t")).words
    assert "The log is cut off or damaged: a part of it is missing." in words
    assert "9 samples were not used, 4 of them lost in damaged files." in words
    blank = {"omega_fl": replace(short.signals.origins["omega_fl"], not_finite=300)}
    origins = {**short.signals.origins, **blank}
    words = Reader(drive_page(replace(short, signals=replace(short.signals, origins=origins)), title="t")).words
    assert "5 samples were not used; without a value: omega_fl 300." in words
    good = replace(short, signals=replace(short.signals, quality=Quality()))
    assert 'id="problems"' not in drive_page(good, title="t")


def test_tables_of_detectors_signals_and_time_stamps(page):
    words = Reader(page).words
    assert "Spin-up limited RL, RR 1 judged without torque_rl, torque_rr" in words
    assert "Tie-rod force unavailable – – needs tie_rod_fl, tie_rod_fr" in words
    assert "a_x ESC accelerometer, forward" in words
    assert "ESP_19.a_x drive.mf4 km/h 100 3000 4.00 3 out of range" in words
    assert "a_x 2 0 0 0 1" in words
    assert "slip −30.9" in words or "slip down to −30.9 %" in words


def test_figure_is_valid_and_complete(page):
    data = data_of(page)
    figure = go.Figure(_plain(data["figure"]["data"]), _plain(data["figure"]["layout"]))
    titles = [a.text for a in figure.layout.annotations if a.text.startswith("<b>")]
    rows = [re.match(r"<b>(.*?)</b>", t)[1] for t in titles]
    assert rows[:4] == ["Speed", "Detections", "Speed difference", "Acceleration difference"]
    assert rows[4:] == [
        "Spin-down", "Minor spin-down", "Spin-up", "Resistance", "Joint criteria", "Resistance measure", "Acceleration",
        "Water depth",
    ]  # fmt: skip
    units = [figure.layout[r["axis"]].title.text for r in data["rows"] if r["has_lines"]]
    assert units == ["km/h", "km/h", "m/s²", "m/s", "(m/s²)²", "m/s", "m/s", "–", "m/s²", "m/s²", "mm"]
    colours = {}
    for trace in figure.data:
        if trace.legendgroup:
            colours.setdefault(trace.legendgroup, set()).add(trace.line.color)
    assert all(len(colours[w]) == 1 for w in ("fl", "fr", "rl", "rr"))


def _plain(figure):
    """With a colour in place of the names of colours that the script replaces."""
    return json.loads(re.sub(r'"@\w+"', '"#000"', json.dumps(figure)))


def test_raw_signals_have_panels_in_units_of_the_road(short):
    names = ("torque_fl", "torque_rr", "a_y", "yaw_rate", "steer_angle")
    frame = short.signals.frame.with_columns(**{n: pl.lit(0.5) for n in names}, brake_pressure=pl.lit(2e6))
    data = data_of(drive_page(replace(short, signals=replace(short.signals, frame=frame)), title="t"))
    rows = {r["title"]: [] for r in data["rows"]}
    titles = list(rows)
    for line in data["lines"]:
        rows[titles[line["row"]]].append(float(decode(line)["full"][0]))
    raw = {t: rows[t] for t in ("Wheel torque", "Yaw rate", "Steering angle", "Brake pressure")}
    degrees = pytest.approx([np.degrees(0.5)])
    assert raw == {"Wheel torque": [0.5, 0.5], "Yaw rate": degrees, "Steering angle": degrees, "Brake pressure": [20.0]}
    assert len(rows["Acceleration"]) == 2


def test_absent_signals_leave_no_row(short):
    features = short.features.drop("delta_a_x").with_columns(a_w_delta_fl=pl.lit(None, dtype=pl.Float64))
    bare = replace(
        short, features=features.drop("a_w_delta_fr", "a_w_delta_rl", "a_w_delta_rr"), tracks=(), events=(),
        signals=replace(short.signals, frame=short.signals.frame.drop("^water_.*$", "on_water", "a_x")),
    )  # fmt: skip
    text = drive_page(bare, title="t")
    assert len(data_of(text)["rows"]) == 2


def test_empty_drive_is_still_a_page(short):
    signals = replace(short.signals, frame=short.signals.frame.head(0), origins={})
    result = replace(
        short, signals=signals, features=short.features.head(0), tracks=(), events=(),
        unavailable=(Unavailable("spin_down", ("omega_fl",)),),
    )  # fmt: skip
    assert "plotly.js v" not in drive_page(result, title="t")


def test_short_drive_holds_every_sample_and_its_gaps(page, short):
    data = data_of(page)
    assert data["windows"] == [[0, 3000]]
    assert "Every sample is in this page" in page
    index = next(i for i, t in enumerate(data["figure"]["data"]) if t["yaxis"] == "y3" and t["name"] == "RL")
    values = decode(data["lines"][index])["full"]
    expected = 3.6 * short.features["v_w_delta_rl"].to_numpy()
    np.testing.assert_allclose(values, expected, rtol=1e-6)
    assert np.isnan(values).sum() == 120


def test_a_bit_of_one_sample_has_its_bar(page):
    data = data_of(page)
    names = [t["name"] for t in data["figure"]["data"] if t.get("meta") == "bars"]
    lane = data["lanes"][names.index("Spin-down RL")]
    assert np.frombuffer(base64.b64decode(lane["spans"]), dtype="<u4").tolist() == [2800, 2801]


def test_two_thousand_events_go_into_columns_and_stay_small(short):
    events = tuple(sorted((replace(e, start_s=e.start_s + 1e-3 * k) for k in range(140) for e in short.events),
                          key=lambda e: e.start_s))  # fmt: skip
    assert len(events) > 2000
    bare = replace(short, judgement=Judgement())
    many, few = replace(bare, events=events), replace(bare, events=events[:MOST_ROWS])
    text = drive_page(many, title="t")
    rows = [a["data-row"] for t, a in Reader(text).elements if "data-row" in a]
    assert rows == [str(i) for i in range(FIRST_EVENTS)]
    assert f"The first {FIRST_EVENTS} rows; the other {len(events) - FIRST_EVENTS} need JavaScript" in text
    table = data_of(text)["table"]
    assert {len(table[c]) for c in ("detector", "place", "severity", "peak", "ratio", "speed", "evidence")} == {
        len(events)
    }
    row = event_cells(events[777])
    assert [table["detectors"][table["detector"][777]], table["evidence"][777]] == [row[0].text, row[-1].text]
    assert table["peak"][777].startswith(row[6].text)
    short_text = drive_page(few, title="t")
    assert "table" not in data_of(short_text)
    assert short_text.count("data-row=") == MOST_ROWS
    assert "events.json" not in short_text
    assert len(text) - len(drive_page(short, title="t")) < 300 * len(events)


def test_an_hour_is_reduced_said_so_and_small(hour):
    text = drive_page(hour, title="t")
    assert len(text) < 15e6
    data = data_of(text)
    assert "The page holds about 4000 minima and maxima per line over the whole drive" in text
    assert f"Every sample is kept from 3 s before to 3 s after each of the {len(hour.events)} events" in text
    index = next(i for i, t in enumerate(data["figure"]["data"]) if t["yaxis"] == "y4" and t["name"] == "RL")
    line = decode(data["lines"][index])
    assert line["index"].size <= POINTS + 200
    assert line["full"].size == sum(b - a for a, b in data["windows"])
    assert np.nanmax([np.nanmax(line["full"]), np.nanmax(line["value"])]) == pytest.approx(fake.SPIKE * 1000)
    inside = np.zeros(data["n"], dtype=bool)
    for a, b in data["windows"]:
        inside[a:b] = True
    assert not inside[line["index"]].any()
