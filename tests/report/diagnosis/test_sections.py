"""The page of a diagnosis: every sentence comes from the document, pictures from the views, names stay names."""

import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from aqualog.report.diagnosis.figures import gain_bars, isolability, remainder
from aqualog.report.diagnosis.sections import diagnosis_report
from aqualog.report.diagnosis.views import binned, view_data
from aqualog.report.diagnosis.words import by_sharpness, sentences
from aqualog.report.page import report_page
from aqualog.report.values import readable
from tests.report.diagnosis.test_document import VERDICTS, document_of, round_trip
from tests.report.diagnosis_case import cases, view, views_of


def render_page(document, views, title):
    return report_page(diagnosis_report(document, views), title=title)


def body(page):
    """Text that a reader sees: without scripts, styles and tags."""
    text = re.sub(r"<(script|style)\b.*?</\1>", " ", page, flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


@pytest.fixture(scope="module")
def pages():
    return {v: render_page(round_trip(document_of(v)), views_of(v), "car, drive") for v in VERDICTS}


@pytest.mark.parametrize("verdict", VERDICTS)
def test_all_sentences_are_on_the_page(pages, verdict):
    text = body(pages[verdict])
    said = sentences(round_trip(document_of(verdict)))
    for key, lines in said.items():
        if key not in ("untested", "causes_confused"):
            for line in lines:
                assert readable(" ".join(line.split())) in text, key
    assert text.index(said["headline"][0]) < 700
    assert pages[verdict].startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_is_a_function_of_the_document(pages, verdict):
    assert render_page(document_of(verdict), views_of(verdict), "car, drive") == pages[verdict]


def test_what_the_page_tells_changes_with_the_document():
    d = round_trip(document_of("cannot_tell"))
    for place, key, value, said in (
        (d["gain"], "heldout_log_score_gain", 555.0, "555 natural units"),
        (d["next_manoeuvre"], "sentence", "Weigh it in 7.25 min.", "Weigh it in 7.25 min."),
        (d["significance"], "achieved_level", 0.0444, "achieved 0.0444"),
        (d["limits"][0], "size", 17.0, "17 kg"),
        (d["limits"][1], "size", 0.47, "47 %"),
        (d["gain"]["channel"]["kinematic"], "rmse_after", 0.77, "speed stays 0.77 m/s² off"),
        (d["untested"], "relaxation_length", "because of 11", "because of 11"),
        (d["causes"][1]["parameters"]["gain"], "value", 0.8777, "0.878"),
    ):
        assert said not in body(render_page(d, (), "t"))
        place[key] = value
        assert said in body(render_page(d, (), "t"))


def test_bins_hold_median_and_spread():
    x = np.repeat([0.5, 1.5, 2.5], [100, 100, 3])
    y = np.concatenate([np.linspace(-1, 1, 100), np.full(100, 5.0), np.zeros(3)])
    y[100] = 1e9  # one wild sample is no effect
    x[0] = np.nan
    middle, low, high = binned(x, y, np.array([0.0, 1.0, 2.0, 3.0]))
    assert middle[0] == pytest.approx(0.01, abs=0.02)
    assert (low[0], high[0]) == (pytest.approx(-0.68, abs=0.03), pytest.approx(0.68, abs=0.03))
    assert middle[1] == 5.0
    assert np.isnan([middle[2], low[2], high[2]]).all()


def test_views_are_thinned_and_shared():
    views = views_of("named")
    data = view_data(views, ["force_balance"])
    assert data["start"] == "torque"
    assert [c[0] for c in data["coordinates"]] == ["t", "v_x", "torque", "position", "a_x"]
    assert len(data["tables"]) == 2  # one for all channels of a drive
    assert all(len(v["before"]) <= 1200 for v in data["views"])
    first = data["views"][0]
    assert first["title"] == "Force balance [m/s²]"
    assert first["every_s"] == 0.5
    assert None in first["before"]
    assert first["limits"][1] < 0.5  # the wild sample of 10 m/s^2 does not set the axis
    assert len(json.dumps(data)) < 600_000


def test_explained_channels_come_first():
    data = view_data(views_of("named"), ["slip_rr"])
    assert [v["title"] for v in data["views"][:3]] == ["Slip RR [–]", "Slip RR [–]", "Force balance [m/s²]"]
    both = view_data(views_of("named"), ["slip_rr", "force_balance"])["views"]
    assert [v["title"][:7] for v in both[:4]] == ["Slip RR", "Slip RR", "Force b", "Force b"]
    assert view_data(views_of("named"), ["force_balance", "slip_rr"])["views"][0]["title"] == "Force balance [m/s²]"


def test_the_page_opens_over_what_explains_most_of_all_channels():
    force, slip, rod = view("a", "force_balance"), view("a", "slip_rr"), view("a", "slip_rl", gain=0.0)
    steer = np.sin(force.coordinates["t"])
    rod.before[:] = rod.after + 9.0 * steer  # the most reduced channel alone depends on the steer angle
    for v in (force, slip, rod):
        v.coordinates["steer_angle"] = steer
    assert view_data([rod], ["slip_rl"])["start"] == "steer_angle"
    assert view_data([force, slip, rod], ["slip_rl", "force_balance", "slip_rr"])["start"] in ("torque", "a_x")


def test_the_page_opens_over_the_place_of_a_road():
    assert view_data(views_of("named"), ["force_balance"], "position")["start"] == "position"
    assert view_data(views_of("named"), ["force_balance"], "altitude")["start"] == "torque"


def test_speed_is_in_kmh_and_a_coordinate_without_change_has_no_bins():
    v = view("a", "kinematic")
    v.coordinates["v_x"][:] = 20.0
    data = view_data([v])
    assert data["tables"][0]["v_x"][0] == 72.0
    assert data["views"][0]["bins"]["v_x"] is None
    assert data["start"] == "t"


def test_what_was_not_changed_has_no_after(pages):
    assert all(v["after"] is None for v in view_data(views_of("no_effect"))["views"])
    assert view_data([])["views"] == []
    assert 'id="views-section"' not in pages["not_testable"]


def test_gain_bars_are_relative_to_before():
    bars = gain_bars(document_of())
    before, after = bars["data"]
    assert set(before["x"]) == {100.0}
    assert after["x"][0] == pytest.approx(38.16, abs=0.01)
    assert after["text"][0] == "0.045 m/s²"
    assert before["y"][:2] == ["force balance, next sample", "force balance, free simulation"]
    assert gain_bars(document_of("no_effect")) is None


def test_isolability_fills_both_sides_and_causes_come_first():
    heat = isolability(document_of())["data"][0]
    assert heat["x"][0] == "payload mass"
    i, j = heat["x"].index("aero drag"), heat["x"].index("head wind")
    assert heat["z"][i][j] == heat["z"][j][i] == 0.591
    assert heat["z"][0][0] is None
    k = heat["x"].index("torque gain")
    assert (heat["z"][0][k], heat["z"][k][0]) == (0.674, 0.7)
    assert isolability(document_of("not_testable")) is None


def test_remainders_over_one_and_two_coordinates():
    d = round_trip(document_of("unexplained"))
    band, line = remainder(d["unexplained"][0], d)["data"]
    assert line["x"][0] == pytest.approx(15.0 * 3.6)
    assert max(line["y"]) == pytest.approx(0.08, abs=2e-3)
    assert len(band["x"]) == 80
    (dots,) = remainder(d["unexplained"][1], d)["data"]
    assert len(dots["x"]) == 107  # one has no value
    assert max(dots["y"]) == 2.0  # mm
    d["unexplained"][0]["f"] = []
    assert remainder(d["unexplained"][0], d) is None


def test_cases_cover_all_verdicts():
    from typing import get_args

    from aqualog.diagnose.records import Verdict

    assert set(cases()) == set(get_args(Verdict))


def test_limits_have_one_line_of_each_effect_and_places_apart():
    d = document_of()
    more = [dict(d["limits"][5], key=f"tyre_radius@{w}", where=w, size=s, ratio=s / 1e-3)
            for w, s in (("fr", 0.0001), ("rl", 0.5))]  # fmt: skip
    chosen, elsewhere = by_sharpness(d | {"limits": d["limits"] + more})
    assert [x["key"] for x in chosen if x["effect"] == "tyre_radius"] == ["tyre_radius@fr"]
    assert [x["key"] for x in elsewhere] == ["tyre_radius@fl", "tyre_radius@rl"]
    whole = dict(more[1], key="tyre_radius", where=None)
    chosen, _ = by_sharpness(d | {"limits": [*d["limits"], *more, whole]})
    assert [x["key"] for x in chosen if x["effect"] == "tyre_radius"] == ["tyre_radius"]
    assert chosen[-1]["key"] == "road_grade"  # not shown at any size


def test_long_lists_are_folded():
    d = document_of()
    one = next(c for c in d["isolability"] if c["relation"])
    d["isolability"] = [dict(one, relation=f"relation {i}") for i in range(30)]
    d["notes"] = []
    page = render_page(d, (), "t")
    assert page.index(" exactly like ") < page.index("<summary>30 sizes that look the same</summary>")
    assert page.index("<summary>30") < page.index("relation 0<") < page.index("relation 29<")


def test_runs_of_a_campaign_have_no_step_and_wide_bins():
    v = view("c", "kinematic", n=120)
    data = view_data([replace(v, dt=float("nan"), title="slip of rl on the water", channel="slip_slope_rl")])
    shown = data["views"][0]
    assert shown["every_s"] is None
    assert shown["title"] == "Slip of rl on the water [m/s²]"
    assert len(shown["bins"]["v_x"][0]) == 8
    assert sum(x is not None for x in shown["bins"]["v_x"][1][0]) >= 5
    json.dumps(data, allow_nan=False)
