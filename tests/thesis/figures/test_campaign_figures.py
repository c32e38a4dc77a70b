"""Figures of a campaign: which runs they choose, what they draw, and verdicts that follow the runs."""

import csv
import io
import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.campaign.slip_slope import SlopeRow
from aqualog.campaign.spin_downs import Pass
from aqualog.core.errors import ConfigError
from aqualog.core.intervals import half_width
from aqualog.core.regression import ByRun
from aqualog.thesis import image
from aqualog.thesis.catalogue import OF_CAMPAIGN, Wish
from aqualog.thesis.claims import DIFFERENCE, NEEDS_DATA, NOT_REPRODUCED, REPRODUCED
from aqualog.thesis.draw import panel_figure
from aqualog.thesis.evidence import measures
from aqualog.thesis.evidence.measures import Effect
from aqualog.thesis.evidence.selection import Level, NotInCampaign, choose, label, pairs, value_of, wear_rank
from aqualog.thesis.export import figure_csv, figures_document
from aqualog.thesis.figures import joint, resistance, slip_slopes, spin_downs
from aqualog.thesis.page import render_figures
from aqualog.thesis.run import make
from tests.thesis.small_campaign import evidence, folder, made_of_campaign

KMH = 1 / 3.6
MADE = (*OF_CAMPAIGN, "2.2", "2.8", "2.9", "2.25")


def run_info(index, drivetrain="rwd", **values):
    return SimpleNamespace(
        index=index, name=f"r{index}", is_done=True, vehicle=SimpleNamespace(drivetrain=drivetrain),
        run=SimpleNamespace(vehicle=SimpleNamespace(stem="vehicle_car"), values=values),
    )  # fmt: skip


def chosen(runs, wish, is_of_use=lambda r: ""):
    return choose(runs, wish, campaign="c", number="2.0", is_of_use=is_of_use, needs="something")


def test_the_configuration_like_the_thesis_is_chosen_though_another_has_more_runs():
    like = [run_info(i, tyre="worn_summer", pressure_rear_bar=1.9, water_depth_mm=d) for i, d in enumerate((0.6, 1.3))]
    more = [
        run_info(10 + i, tyre="other", pressure_rear_bar=1.9, water_depth_mm=d) for i, d in enumerate((1.0, 2.0) * 9)
    ]
    found = chosen([*more, *like], Wish(("depth",), ("worn_summer",)))
    assert [x.name for x in found.levels] == ["0.6 mm", "1.3 mm"]
    assert found.is_thesis
    assert found.left_out == {"in another configuration": 18}
    # without the thesis' tyre the largest group is taken, and that it is another one is said
    other = chosen(more, Wish(("depth",), ("worn_summer",)))
    assert len(other.runs) == 18
    assert not other.is_thesis


def test_keys_that_are_not_given_are_a_value_of_their_own_and_no_load_is_no_load():
    runs = [
        run_info(0, pressure_rear_bar=1.9),
        run_info(1, pressure_rear_bar=2.5),
        run_info(2, pressure_rear_bar=2.5, load_front_kg=0.0),
    ]
    found = chosen(runs, Wish(("pressure",)))
    assert [(x.name, len(x.runs)) for x in found.levels] == [("1.9 bar", 1), ("2.5 bar", 2)]
    assert "any tyre" in found.fixed
    assert "water depth not given" in found.fixed
    assert label("load", value_of(runs[0], "load")) == "no load"


def test_pairs_need_a_common_water():
    def run(i, tyre, depth):
        return run_info(i, tyre=tyre, water_depth_mm=depth)

    wish = Wish(("tyre", "depth"), only_tyres=(("worn_summer",), ("new_winter",)))
    apart = [run(0, "worn_summer", 1.3), run(1, "new_winter", 2.0)]
    with pytest.raises(
        NotInCampaign, match=r"needs something: 2 of 2 runs have the data, but with tyre: new winter, worn"
    ):
        chosen(apart, wish)
    runs = [*apart, run(2, "new_winter", 1.3), run(3, "other", 1.3)]
    found = chosen(runs, wish)
    assert [x.name for x in found.levels] == ["new winter, 1.3 mm", "worn summer, 1.3 mm"]
    ((words, worn, new),) = pairs(found.levels, wish)
    assert (words, worn.name, new.name) == ("1.3 mm", "worn summer, 1.3 mm", "new winter, 1.3 mm")


def test_why_runs_are_left_out():
    runs = [run_info(i, water_depth_mm=d) for i, d in enumerate((1.0, 2.0, 2.0))]
    found = chosen(runs, Wish(("depth",)), lambda r: "too short" if r.index == 2 else "")
    assert found.left_out == {"too short": 1}
    with pytest.raises(NotInCampaign, match=r"none of 3 runs \(3 too short\)"):
        chosen(runs, Wish(("depth",)), lambda r: "too short")


def test_wear_by_tread_by_word_by_name():
    assert wear_rank(("x", "new", 1.6)) == 1.6
    assert wear_rank((None, "very_worn", None)) < wear_rank((None, "worn", None)) < wear_rank(("new_x", None, None))
    assert wear_rank(("blue", None, None)) is None


@pytest.mark.parametrize("number", MADE)
def test_figure_names_its_runs_and_its_numbers(number):
    figure = made_of_campaign(number)
    assert figure.number == number
    assert figure.panels
    names = {r.name for r in evidence().data.runs}
    assert figure.runs.used
    assert {r for r, _ in figure.runs.used} <= names
    assert len(figure.runs.used) + sum(n for _, n in figure.runs.left_out) == len(names)
    for panel in figure.panels:
        titles = [line.name for line in panel.lines]
        assert len(titles) == len(set(titles))
        assert panel_figure(panel)["data"]
        for line in panel.lines:
            assert line.x.shape == line.y.shape
            if line.low is not None:
                told = np.isfinite(line.low)
                assert (line.low[told] <= line.y[told]).all()
                assert (line.y[told] <= line.high[told]).all()
    for c in figure.checks:
        assert all((c.statement, c.criterion, c.found))
        assert "nan" not in re.split(r"\W+", c.found + c.reason)
        assert c.verdict == REPRODUCED or c.reason
        if c.ci95 is not None:
            assert c.ci95[0] <= c.value <= c.ci95[1]
            assert c.unit
    rows = list(csv.reader(io.StringIO(figure_csv(figure))))
    at = rows[0].index("run used [-]")
    assert [r[at] for r in rows[1:] if r[at]] == [r for r, _ in figure.runs.used]


def test_a_figure_without_its_runs_says_what_it_needs():
    with pytest.raises(NotInCampaign, match=r"figure 2\.21: needs .*\[tie_rod\].*none of \d+ runs has it"):
        make("2.21", evidence())


def test_page_and_document_have_runs_and_intervals():
    figures = [made_of_campaign(n) for n in ("2.11", "2.14", "2.15")]
    page = render_figures(figures, title="x")
    assert page.count('<details class="runs">') == 3
    for run, _ in figures[0].runs.used:
        assert run in page
    back = json.loads(json.dumps(figures_document(figures, [], {"2.13": "why"}), allow_nan=False))
    assert back["not_made"] == [{"figure": "2.13", "reason": "why"}]
    c39 = next(c for c in back["figures"][0]["findings"] if c["claim"] == "C39")
    assert c39["ci95"][0] < c39["value"] < c39["ci95"][1]
    assert c39["unit"] == "m/s^2 per 10 km/h"
    assert back["figures"][0]["runs"]["used"][0]["run"].startswith("logs/")


def test_constants_are_the_runs_own_dry_level():
    """The measure on water is what it is there, less the mean before it."""
    e = evidence()
    info = next(r for r in e.data.done if not e.has_resistance(r))
    samples = e.data.samples(info)
    which, y = measures.resistance_of()(info, samples)
    delta = samples.array("delta_a_x")
    before = (samples.on_water == 0) & samples.is_usable & np.isfinite(delta) & (samples.t < e.of(info).entry)
    assert before.sum() > 10
    assert y[which] == pytest.approx(delta[which] - delta[before].mean(), nan_ok=True)


def level(name, *value):
    return Level(name, tuple(value), ())


class Found:
    """Resistances with made-up differences."""

    def __init__(self, levels, wish, effects):
        self.levels = levels
        self.selected = SimpleNamespace(wish=wish)
        self.effects = effects
        self.pools = dict.fromkeys(x.name for x in levels)

    def difference(self, a, b):
        return self.effects[a.name, b.name]


def effect(value, half):
    return Effect(value, value - half, value + half, 9)


@pytest.mark.parametrize(
    ("flat", "rise", "verdict"),
    [(0.0, 0.3, REPRODUCED), (0.2, 0.3, DIFFERENCE), (0.0, 0.01, DIFFERENCE), (0.2, 0.01, NOT_REPRODUCED),
     # an interval that holds 0 because it is wide is no evidence that nothing changes
     ((0.1, 0.15), 0.3, DIFFERENCE), ((0.1, 0.15), 0.01, NOT_REPRODUCED)],
)  # fmt: skip
def test_c38_by_hand(flat, rise, verdict):
    levels = [level(f"{d} mm", (d, None)) for d in (0.6, 1.3, 2.0)]
    small = effect(0.0, 0.01)
    found = Found(levels, Wish(("depth",)), {
        ("0.6 mm", "1.3 mm"): (effect(*flat) if isinstance(flat, tuple) else effect(flat, 0.02), small),
        ("1.3 mm", "2.0 mm"): (effect(rise, 0.02), effect(0.1, 0.05)),
    })  # fmt: skip
    c38 = resistance._c38(found)
    assert c38.verdict == verdict
    assert c38.ci95 == pytest.approx((rise - 0.02, rise + 0.02))
    assert resistance._c38(Found(levels[:2], Wish(("depth",)), {})) is None


@pytest.mark.parametrize(
    ("a", "b", "share", "verdicts"),
    [
        (-0.3, -0.1, 0.2, (REPRODUCED, REPRODUCED)),
        (-0.3, -0.1, 0.8, (REPRODUCED, DIFFERENCE)),
        (0.0, 0.0, 0.2, (NOT_REPRODUCED, NOT_REPRODUCED)),
    ],
)
def test_c42_by_hand(monkeypatch, a, b, share, verdicts):
    wish = Wish(("tyre", "depth"))
    levels = [level("old", ("w", "worn", 1.6), (1.3, None)), level("deep", ("n", "new", 8.0), (1.3, None))]
    found = Found(levels, wish, {("old", "deep"): (effect(a, 0.02), effect(b, 0.02))})
    made = [SimpleNamespace(columns={"y": np.array([v])}) for v in (1.0, share)]
    monkeypatch.setattr(measures, "common", lambda x, y: made)
    assert (resistance.treads_differ("C40", found).verdict, resistance._c42(found).verdict) == verdicts


def over_water(kmh, *, minor=0, full=0, deepest=-0.01):
    info = SimpleNamespace(index=0)
    v, slip = np.full(40, kmh * KMH), {w: np.full(40, x) for w, x in (("fl", -0.001), ("fr", deepest))}
    return Pass(info, 0.1, v, slip, {"fl": (), "fr": (v[0],) * minor}, {"fl": (), "fr": (v[0],) * full})


@pytest.mark.parametrize(("first", "verdict"), [(90, REPRODUCED), (70, NOT_REPRODUCED)])
def test_speeds_at_which_spin_downs_begin(first, verdict):
    found = [over_water(v, minor=int(v >= first), full=int(v >= 110)) for v in range(50, 131, 2) for _ in range(4)]
    c17 = spin_downs.before_full(found)
    assert c17.value == pytest.approx(110 - first, abs=2.0)
    assert c17.verdict == verdict
    assert spin_downs.before_full([over_water(v) for v in range(60, 100, 5)]) is None


def test_exponential_slip_is_told_from_a_straight_one():
    v = np.linspace(60, 110, 26)
    rng = np.random.default_rng(3)
    noise = np.exp(0.05 * rng.standard_normal(v.size))
    curve = spin_downs.exponential(
        [over_water(x, deepest=-d) for x, d in zip(v, 1e-3 * np.exp((v - 60) / 10) * noise, strict=True)]
    )
    line = spin_downs.exponential([over_water(x, deepest=-d) for x, d in zip(v, 1e-3 * (v - 55) * noise, strict=True)])
    assert curve.verdict == REPRODUCED
    assert curve.value == pytest.approx(100 * math.expm1(1.0), rel=0.05)
    assert line.verdict == DIFFERENCE


def test_more_spin_downs_with_speed():
    rising = [over_water(v, minor=(v - 80) // 5, deepest=-0.002 * (v - 70)) for v in range(80, 120, 2)]
    c15 = spin_downs.rising_number(rising)
    assert c15.verdict == REPRODUCED
    assert c15.value == pytest.approx(2.0 / 4.0, rel=0.15)  # two more in 10 km/h, over 4 s
    flat = [over_water(v, minor=1 + v % 4 // 2, deepest=-0.02 - 0.01 * (v % 4 // 2)) for v in range(80, 120, 2)]
    assert spin_downs.rising_number(flat).verdict == NOT_REPRODUCED


def rows(wheel, kmh, slopes, half=0.03):
    return [
        SlopeRow((), wheel, "wet", v - 5, v + 5, 6, 100, (0.0, 0.1), v * KMH, s, (s * (1 - half), s * (1 + half)),
                 dof=5.0, reliable=True)
        for v, s in zip(kmh, slopes, strict=True)
    ]  # fmt: skip


def test_fall_and_ratio_of_slopes_by_hand():
    v = np.arange(65.0, 116.0, 10.0)
    a = rows("rl", v, 30 * 0.9 ** np.arange(6))
    fall = measures.fall(a)
    assert fall.value == pytest.approx(-10.0, abs=0.1)
    assert fall.is_below
    b = rows("rl", v, 24 * 0.95 ** np.arange(6))
    over, flatter = measures.ratio(a, b)
    middle = 0.8 * (0.95 / 0.9) ** 2.5
    assert over.value == pytest.approx(middle, rel=0.01)
    assert flatter.value == pytest.approx(100 * (0.95 / 0.9 - 1), rel=0.05)
    assert flatter.is_above
    assert measures.fall(a[:2]) is None
    assert measures.ratio(a[:1], b) is None
    assert measures.uneven(a) == pytest.approx(0.0, abs=1e-9)


def of_runs(runs, errors, kmh=(65.0, 75.0, 85.0, 95.0)):
    """Bins of both rear wheels: `errors` of the logarithm (wheels, bins, runs) in runs of equal length."""
    n, out = len(runs), []
    for wheel, of_wheel in zip(("rl", "rr"), errors, strict=True):
        for v, x in zip(kmh, of_wheel, strict=True):
            se = x.std(ddof=1) / np.sqrt(n)
            by_run = ByRun(np.asarray(runs), (x - x.mean()) / n / np.sqrt(1 - 1 / n) / se, np.full(n, 1 / n))
            half = half_width(se, n - 1.0)
            mid, ends = np.exp(x.mean()), np.exp(x.mean() + np.array([-half, half]))
            out.append(
                SlopeRow(
                    (),
                    wheel,
                    "wet",
                    v - 5,
                    v + 5,
                    n,
                    100,
                    (0.0, 0.1),
                    v * KMH,
                    25 * mid,
                    tuple(25 * ends),
                    dof=n - 1.0,
                    reliable=True,
                    by_run=by_run,
                )
            )
    return out  # fmt: skip


def test_bins_of_the_same_runs_err_together():
    rng = np.random.default_rng(3)
    one, two = rng.normal(0.0, 0.05, (2, 5))
    a, b = (of_runs(range(f, f + 5), np.tile(x, (2, 4, 1))) for f, x in ((0, one), (10, two)))
    over, _ = measures.ratio(a, b)
    # eight bins say no more than one: two means of five runs
    sd = math.sqrt((one.var(ddof=1) + two.var(ddof=1)) / 5.0)
    assert math.log(over.high / over.low) / 2.0 == pytest.approx(half_width(sd, 8.0), rel=0.01)
    # what all bins of a run share is not in the ratio of two wheels of the same runs
    same, _ = measures.ratio(a[:4], [replace(r, wheel="rl") for r in a[4:]])
    assert (same.low, same.high) == pytest.approx((1.0, 1.0), abs=1e-3)
    held, draws = 0, 200
    for _ in range(draws):
        a, b = (of_runs(range(f, f + 4), rng.normal(0.0, 0.05, 4) + rng.normal(0.0, 0.02, (2, 4, 4))) for f in (0, 10))
        e = measures.ratio(a, b)[0]
        held += e.low <= 1.0 <= e.high
    assert held >= 0.89 * draws  # 0.945 of 600; 0.55 as if the bins were independent


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [(0.93, 1.05, REPRODUCED), (0.72, 1.06, NEEDS_DATA), (0.80, 0.97, NOT_REPRODUCED), (0.91, 0.99, REPRODUCED)],
)
def test_c50_no_influence_is_shown_and_not_left_open(monkeypatch, low, high, verdict):
    levels = (level("0.6 mm", (0.6, None)), level("2 mm", (2.0, None)))
    found = SimpleNamespace(levels=levels, wheels=("rl",), of=lambda level, wheel=None: level)
    monkeypatch.setattr(slip_slopes, "usable", lambda rows: rows)
    monkeypatch.setattr(slip_slopes, "ratio", lambda a, b: (Effect(math.sqrt(low * high), low, high, 3), None))
    c50 = slip_slopes._c50(found)
    assert c50.verdict == verdict
    assert (c50.reason == measures.TOO_FEW) is (verdict == NEEDS_DATA)


def test_scatter_beyond_the_errors_widens_the_interval():
    v = np.arange(65.0, 116.0, 10.0)
    even = measures.fall(rows("rl", v, 30 * 0.9 ** np.arange(6)))
    rough = measures.fall(rows("rl", v, 30 * 0.9 ** np.arange(6) * np.array([1.3, 0.7, 1.3, 0.7, 1.3, 0.7])))
    assert rough.high - rough.low > 3 * (even.high - even.low)


def test_differences_of_pools_are_those_put_in():
    rng = np.random.default_rng(11)

    def pool(level, gradient, first):
        parts = []
        for r in range(8):
            v = np.linspace(60, 110, 60) * KMH
            y = (
                level
                + gradient * (v - 85 * KMH) / (10 * KMH)
                + 0.05 * rng.standard_normal()
                + 0.02 * rng.standard_normal(60)
            )
            parts.append((first + r, np.arange(60), {"v_x": v, "y": y}))
        return measures.pooled(parts)

    hits = np.zeros(3)
    for _ in range(40):
        a, b = pool(0.2, 0.05, 0), pool(0.5, 0.15, 100)
        level, gradient = measures.difference(a, b)
        trend = measures.trend(a)
        assert gradient.is_above
        hits += [level.low < 0.3 < level.high, gradient.low < 0.1 < gradient.high, trend.low < 0.05 < trend.high]
    assert (hits >= 34).all()  # 38 on average, fewer than 34 once in a hundred
    few = a.part(a.run < 2)
    assert measures.difference(few, b)[0].ci is None
    assert np.isnan(measures.bin_means(few).low).all()


def test_the_diagram_tells_the_detector_as_it_is(monkeypatch):
    assert joint._c64()[0].verdict == REPRODUCED

    class Wrong(joint.Criteria):
        def behind(self, gate, slope):
            return dict(self.met)

    monkeypatch.setattr(joint, "Criteria", Wrong)
    assert joint._c64()[0].verdict == NOT_REPRODUCED


def test_command_on_a_campaign(tmp_path):
    from typer.testing import CliRunner

    from aqualog.cli.main import app

    evidence()  # results are there
    words = ["figures", "2.14", "2.21", "-o", tmp_path, "--campaign", folder() / "campaign.toml", "--json"]
    result = CliRunner().invoke(app, [str(w) for w in words])
    assert result.exit_code == 3, result.stderr
    found = json.loads(result.stdout)
    assert [f["figure"] for f in found["figures"]] == ["2.14"]
    assert found["not_made"][0]["figure"] == "2.21"
    assert "figure 2.21 is not made: needs" in result.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["figure_2_14.csv", "figure_2_14.html"]


def test_pictures(tmp_path, monkeypatch):
    pytest.importorskip("kaleido")
    if image.browser() is None:
        pytest.skip("no browser")
    figure = replace(made_of_campaign("2.14"), panels=made_of_campaign("2.14").panels * 2)
    assert image.image_names(figure, "svg") == ["figure_2_14_a.svg", "figure_2_14_b.svg"]
    assert "@" not in json.dumps(image.picture_of(figure, 0))
    with image.Pictures() as pictures:
        svg = pictures.draw(made_of_campaign("2.14"), "svg")[0]
        png = pictures.draw(made_of_campaign("2.14"), "png")[0]
    assert svg.lstrip().startswith(b"<svg")
    assert b"1.9 bar" in svg
    assert png.startswith(b"\x89PNG")


def test_pictures_without_a_browser_say_what_is_needed(monkeypatch):
    from aqualog.core.errors import AqualogError

    pytest.importorskip("kaleido")
    monkeypatch.setenv("BROWSER_PATH", "/nowhere/chrome")
    with pytest.raises(AqualogError, match=r"Chromium or Chrome.*aqualog\[images\]"), image.Pictures():
        pass


def test_a_campaign_figure_needs_a_campaign():
    with pytest.raises(ConfigError, match="--campaign"):
        make("2.17")


def test_passes_over_time_are_those_of_the_thesis_on_one_scale():
    for number in ("2.3", "2.5"):
        panels = made_of_campaign(number).panels
        assert len({p.y.limits for p in panels}) == 1
        low, high = panels[0].y.limits
        assert all(np.nanmin(line.y) >= low and np.nanmax(line.y) <= high for p in panels for line in p.lines)
    assert "nearest to 89, 98, 106, 118 km/h" in made_of_campaign("2.3").caption


def test_slips_of_the_free_wheels_are_those_of_3_13():
    (panel,) = made_of_campaign("2.4").panels
    slips = np.concatenate([line.y for line in panel.lines])
    assert slips.min() >= -10.0
    assert panel.y.limits == (-10.5, 0.5)


@pytest.mark.parametrize(
    ("worn", "deep", "verdict"),
    [(-6.0, (-0.3, -0.9, 0.2), REPRODUCED), (-6.0, (-1.3, -2.2, -0.4), DIFFERENCE), (1.0, (0.5, -0.9, 1.2), DIFFERENCE),
     (-3.0, (-1.2, -1.9, -0.5), NOT_REPRODUCED),
     # too wide to say that nothing falls
     (-9.0, (-1.0, -9.0, 7.0), DIFFERENCE), (-9.0, (-5.0, -15.0, 5.0), NEEDS_DATA)],
)  # fmt: skip
def test_c54_new_winter_tyres_do_not_fall_and_worn_ones_do(monkeypatch, worn, deep, verdict):
    found = SimpleNamespace(levels=(), wheels=("rl",), selected=SimpleNamespace(wish=None), of=lambda level, _: level)
    monkeypatch.setattr(
        slip_slopes, "pairs", lambda *_: [("2 mm", Effect(worn, worn - 7.0, worn + 5.0, 9), Effect(*deep, 9))]
    )
    monkeypatch.setattr(slip_slopes, "fall", lambda level: level)
    assert slip_slopes._c54(found).verdict == verdict
