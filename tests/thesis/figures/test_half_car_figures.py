"""Figures of chapters 2 and 3: they hold data, and what they find is what a second computation finds."""

import re
from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.errors import ConfigError
from aqualog.detect.slip_slope.estimator import initial_state, scan
from aqualog.detect.slip_slope.tuning import TUNING, Params
from aqualog.model.half_car import HalfCarRun, SurfaceChange, simulate_half_car
from aqualog.model.scenario import Excitation
from aqualog.physics.tyre_brush import brush_force, brush_slip
from aqualog.thesis import catalogue
from aqualog.thesis.catalogue import rows
from aqualog.thesis.claims import DIFFERENCE, NOT_REPRODUCED, REPRODUCED, VERDICTS
from aqualog.thesis.evidence import brush, half_car
from aqualog.thesis.evidence.half_car import GATE_OFF, SUV, Case
from aqualog.thesis.figures import amplitudes, brush_curves, change_input, periods, timeline, waveforms
from aqualog.thesis.figures.brush_curves import DRY
from aqualog.thesis.record import seconds, stem_of
from aqualog.thesis.run import make
from tests.thesis.made import all_made, check, made


def test_rows_of_all_figures():
    assert len(catalogue.NUMBERS) == 36 + 1  # W.1 is not of the thesis
    assert set(catalogue.NUMBERS) == {*catalogue.WITHOUT, *catalogue.OF_CAMPAIGN}
    for number, row in rows().items():
        assert all((row.title, row.caption))
        assert bool(row.claims) == (number != "W.1")
        assert bool(row.needs) == ("campaign" in row.made_from)
        assert bool(row.log) == ("logs" in row.made_from)


@pytest.mark.parametrize("number", catalogue.WITHOUT)
def test_figure_holds_data_and_checks(number):
    figure = made(number)
    assert figure.number == number
    assert {c.claim for c in figure.checks} == set(rows()[number].claims)
    assert figure.panels
    for panel in figure.panels:
        assert panel.lines
        names = [line.name for line in panel.lines]
        assert len(names) == len(set(names))
        for line in panel.lines:
            parts = [line.x, line.y, *([line.z] if panel.z else [])]
            assert len({p.shape for p in parts}) == 1
            assert not any(np.isinf(p).any() for p in parts)
            # a triangle under the doubled drift, or a threshold doubled, finds nothing at all: those curves are empty;
            # so is a criterion that is never met
            is_bit = panel.title in ("Detection bits", "Criteria of joint detector 1")
            if "Detection time" not in panel.title and "not estimating" not in line.name and not is_bit:
                assert all(np.isfinite(p).any() for p in parts), line.name
        for sheet in panel.sheets:
            assert sheet.z.shape == (sheet.y.size, sheet.x.size)
            assert np.isfinite(sheet.z).all()
    for c in figure.checks:
        assert all((c.statement, c.criterion, c.found))
        assert "nan" not in re.split(r"\W+", c.found + c.reason)
        assert c.verdict in VERDICTS[:3]
        assert c.value is None or np.isfinite(c.value)
        # where a claim does not come out, the reason is told
        assert c.verdict == REPRODUCED or c.reason
    for t in figure.tables:
        assert t.rows
        assert {len(r) for r in t.rows} == {len(t.header)}


def test_no_change_is_found_before_there_is_one():
    cases = [waveforms._case(w, a) for w in waveforms.WAVES for a in (0.0, 1.0)]
    cases += [waveforms._gated(w) for w in waveforms.WAVES]
    cases += [replace(c, period=p) for c in periods.PANELS.values() for p in periods.OCTAVES]
    cases += [c for w in amplitudes.WAVES for k in ("relative", "mu") for c in amplitudes.cases(w, k).values()]
    assert timeline.false_alarms_of(cases) == 0


def test_words():
    assert seconds(float("nan")) == "–"
    assert seconds(1.234) == "1.23"
    assert stem_of("3.6") == "figure_3_06"
    assert timeline.is_falling([float("nan"), float("nan"), 3.0, 2.0])
    assert not timeline.is_falling([3.0, 3.0])
    assert not timeline.is_falling([float("nan"), float("nan")])
    assert not timeline.is_falling([2.0, float("nan")])


def test_numbers_that_are_asked_for():
    assert catalogue.chosen(["3.11", "3.2", "3.2"]) == ("3.2", "3.11")
    assert catalogue.chosen(["3.06"]) == ("3.6",)
    assert catalogue.chosen(["all"]) == catalogue.chosen(["W", "3", "2"]) == catalogue.NUMBERS
    assert catalogue.chosen(["W.1"]) == ("W.1",)
    assert catalogue.chosen(["3"]) == tuple(f"3.{n}" for n in range(1, 12))
    assert catalogue.chosen(["2"]) == tuple(f"2.{n}" for n in range(1, 26))
    assert catalogue.chosen(["2.09", "2.8"]) == ("2.8", "2.9")
    for wrong in ("2.26", "2.0"):
        with pytest.raises(ConfigError, match=rf"no figure '{wrong}'.*2\.1 to 2\.25, 3\.1 to 3\.11 and W\.1"):
            catalogue.chosen([wrong])
    with pytest.raises(ConfigError, match=r"2\.3: needs the runs of a campaign.*--campaign"):
        make("2.3")
    for wrong in ("3.12", "3.", "", "4", "3.0006", "3.6;", "3.\u0666"):
        with pytest.raises(ConfigError, match=r"expected all, 2, 3 or one of 2\.1 to"):
            catalogue.chosen([wrong])


@pytest.mark.parametrize(("slope", "mu_max"), [(30.0, 1.0), (10.0, 0.4)])
def test_brush_solved_for_slip_and_its_tangent(slope, mu_max):
    mu = np.linspace(-0.9, 0.9, 37) * mu_max
    s = brush_slip(mu, slope=slope, mu=mu_max)
    assert brush_force(s, np.ones_like(s), mu=mu_max, C_s=slope) == pytest.approx(mu, abs=1e-12)
    h = 1e-7
    up, down = (brush_force(s + d, np.ones_like(s), mu=mu_max, C_s=slope) for d in (h, -h))
    assert brush.tangent(mu, slope=slope, mu_max=mu_max) == pytest.approx((up - down) / (2 * h), rel=1e-5)


def test_lines_of_a_split_lie_on_the_surface():
    p = brush.split(DRY, np.linspace(-0.2, 0.2, 9), 0.3)
    for s_f, s_delta, mu_delta in zip(p.s_f, p.s_delta, p.mu_delta, strict=True):
        assert brush.surface(DRY, np.array([s_f]), np.array([s_delta]))[0, 0] == pytest.approx(mu_delta, abs=1e-12)
    assert p.s_delta == pytest.approx(p.s_f - (1.0 - p.s_delta) * p.s_r, abs=1e-15)


def test_blind_split_by_hand():
    """Slips are alike where (1 - nu) / 0.4 = nu / 0.6; small forces show [(1 - nu) / 0.4 - nu / 0.6] / 30."""
    assert brush_curves.blind_split(0.1) == pytest.approx(0.6, abs=1e-8)
    nu = np.array([0.0, 0.3, 0.6, 1.0])
    expected = ((1 - nu) / 0.4 - nu / 0.6) / 30.0
    assert brush_curves.slip_per_force(nu, 1e-6) == pytest.approx(expected, abs=1e-6)
    assert check("3.5", "C95").value == pytest.approx(0.6, abs=1e-6)


def test_slopes_of_projected_lines():
    rows = made("3.4").tables[0].rows
    assert [float(r[2]) for r in rows] == pytest.approx([30.0, 10.0], rel=1e-3)


def by_hand(wave, period, a_x, mu_min, amplitude=250.0, kind="force"):
    """Detection time and slope 2 s after the change, with nothing of the study but the car's numbers."""
    run = HalfCarRun(
        30.0, dt=1e-3, v0=20.0 - 10.0 * a_x, a_x=a_x, nu=0.6, excitation=Excitation(wave, amplitude, kind, period),
        surface=(SurfaceChange(0.0, 10.0, 10.0, 0.4),), t_start=-10.0,
    )  # fmt: skip
    r = simulate_half_car(SUV, run)
    t, mu_f, mu_r = r.t[::10], r.mu_f[::10], r.mu_r[::10]
    v_f, v_r = 0.4 * r.omega_f[::10], 0.4 * r.omega_r[::10]
    tuning = TUNING._replace(mu_min=mu_min)
    e, _ = scan(
        Params.make(tuning, 0.01), initial_state(tuning, slope=30.0), 1.0 - v_r / v_f, mu_f, v_r / v_f * mu_r,
        np.ones(t.size, dtype=bool),
    )  # fmt: skip
    found = [a for a, b in zip(t, e.alarm, strict=True) if b > 0 and a > 0]
    return (found[0] if found else np.nan), e.slope[np.argmin(np.abs(t - 2.0))]


def test_car_of_the_study():
    assert SUV.l_r / (SUV.l_f + SUV.l_r) == pytest.approx(0.4)
    d = half_car.drive(Case("", a_x=1.0))
    assert (d.t[0], d.t[-1]) == pytest.approx((-10.0, 20.0))
    assert d.v_x[np.argmin(np.abs(d.t))] == pytest.approx(20.0, abs=0.05)


def test_times_of_figure_3_6_by_hand():
    times = {w: by_hand(w, 8.0, 1.0, 0.0)[0] for w in ("step", "ramp", "sine", "triangle")}
    c = check("3.6", "C104")
    assert c.value == pytest.approx(times["step"], abs=1e-9)
    for w, t in times.items():
        assert f"{w} {t:.2f} s" in c.found
    ordered = times["step"] < times["ramp"] < min(times["sine"], times["triangle"])
    whole = ordered and 0.75 <= times["step"] <= 1.35 and times["ramp"] > 2.0
    assert c.verdict == (REPRODUCED if whole else DIFFERENCE if ordered else NOT_REPRODUCED)


def test_times_of_figure_3_10_by_hand():
    table = next(
        t for t in made("3.10").tables if t.title.startswith("Detection time [s], sine") and t.header[0] == "mu_Amp"
    )
    row = next(r for r in table.rows if r[0] == "0.07")
    hand = [by_hand("sine", 8.0, a, 0.01, 0.07, "mu") for a in (0.0, 0.5, 1.0)]
    assert list(row[1:]) == [f"{t:.2f}" for t, _ in hand]
    assert " / ".join(f"{s:.1f}" for _, s in hand) in check("3.10", "C113").found


def test_causes_of_the_influence_of_acceleration_are_all():
    """Without load transfer and with a straight tyre curve nothing of it is left; each alone leaves some."""
    for table in (t for t in made("3.10").tables if t.header[0] == "half-car"):
        ratio = {r[0]: float(r[-1]) for r in table.rows}
        assert ratio["neither"] < 1.03
        assert ratio["as it is"] > max(ratio["no load transfer"], ratio["straight tyre curve"]) > 1.1


def test_estimate_under_acceleration_is_the_tangent():
    for number in ("3.6", "3.10"):
        table = next(t for t in made(number).tables if t.title.startswith("Slope reached"))
        for name, mu, slope, estimate, _ in table.rows:
            assert float(slope) == pytest.approx(10.0 * (1 - float(mu) / 0.4) ** (2 / 3), rel=0.01), name
            assert float(estimate) == pytest.approx(float(slope), rel=0.05), name


@pytest.mark.parametrize("adapted", [False, True])
def test_sums_of_figure_3_2_are_those_of_the_estimator(adapted):
    d = half_car.drive(change_input._CASE)
    tuning = change_input._HELD._replace(adapted=adapted, rest=1.0)
    s_delta, mu_i, rho_mu_j = half_car.inputs(d)
    e, _ = scan(
        Params.make(tuning, 0.01),
        initial_state(tuning, slope=30.0),
        s_delta,
        mu_i,
        rho_mu_j,
        np.ones(d.t.size, dtype=bool),
    )
    _, innovation, _, _, mu_delta, used = change_input._held_filter(0.0)
    nu = np.sign(mu_delta) * innovation if adapted else innovation
    # the estimator lets less than one sample of drift fade to nothing where it is blind
    assert change_input.sums(nu, used) == pytest.approx(e.g_drop, abs=1.1 * TUNING.zeta * 0.01)
    if adapted:
        name = "sgn(mu_delta) epsilon"
        row = next(r for r in made("3.2").tables[0].rows if r[0] == name)
        k = np.argmin(np.abs(d.t - 8.0))
        assert float(row[1]) == pytest.approx(1e3 * e.g_drop[k], abs=0.006)


def test_density_at_the_extremes_by_hand():
    rows = {r[0]: [float(v) for v in r[1:]] for r in made("3.8").tables[0].rows}
    expected = {"triangle": 10.0, "sine": 100.0 * (1 - 2 / np.pi * np.arcsin(0.9)), "ramp": 40.0, "step": 100.0}
    for w, percent in expected.items():
        assert rows[w] == pytest.approx([percent] * 3, abs=1.0)
    for panel in made("3.8").panels[:4]:
        for line in panel.lines:
            assert line.count.sum() == 800


def test_rates_and_availability():
    assert waveforms.felt_of("triangle").rate == pytest.approx(100.0)
    assert waveforms.felt_of("sine").rate == pytest.approx(50.0 * np.pi)
    assert waveforms.felt_of("ramp").rate == pytest.approx(150.0)
    table = next(t for t in made("3.7").tables if t.title == "Comfort")
    assert {r[0]: float(r[2]) for r in table.rows} == pytest.approx(
        {"triangle": 1.0, "sine": 1.57, "ramp": 1.5, "step": 500.0}, abs=0.1
    )
    assert waveforms.used_share(Case("", a_x=0.0)) == (0.0, 0.0)


def test_adaption_time_of_a_made_up_estimate():
    d = half_car.drive(Case("", a_x=0.0))
    e = half_car.estimate(Case("", a_x=0.0))
    slope = np.where(d.t < 3.0, 20.0, np.where(d.t < 3.5, 12.0, 10.0))
    alarm = (np.abs(d.t - 2.5) < 1e-6).astype(float)
    e = replace(e, slope=slope, alarm=alarm)
    assert half_car.first_alarm(d, e) == pytest.approx(2.5)
    assert half_car.adaption_time(d, e) == pytest.approx(1.0)
    assert half_car.false_alarms(d, replace(e, alarm=(np.abs(d.t + 1.0) < 1e-6).astype(float))) == 1
    assert np.isnan(half_car.adaption_time(d, replace(e, alarm=0.0 * alarm)))


def test_thin_lines_are_where_the_estimator_is_idle():
    case = Case("sine", period=10.0)
    bold, thin, dot = timeline.estimate_lines("sine", case, is_split=True, t_end=12.0)
    idle = half_car.estimate(case).status > 1
    idle = idle[(half_car.drive(case).t >= -2.0 - 1e-9) & (half_car.drive(case).t <= 12.0 + 1e-9)]
    assert idle.any()
    assert np.array_equal(np.isnan(bold.y), idle)
    assert not (np.isnan(bold.y) & np.isnan(thin.y)).any()
    assert dot.x[0] == timeline.detected_s(case)


OF_TIMES = {"3.6": waveforms, "3.9": periods, "3.10": amplitudes, "3.11": periods}


def times_of(monkeypatch, number, times):
    """Verdicts of a figure where drops are found after such times."""
    monkeypatch.setattr(OF_TIMES[number], "detected_s", times)
    return {c.name: c.verdict for c in make(number).checks}


def test_verdict_of_figure_3_6_follows_the_times(monkeypatch):
    good = {"step": 1.0, "ramp": 2.1, "sine": 2.3, "triangle": 2.6}
    assert times_of(monkeypatch, "3.6", lambda c: good[c.waveform]) == dict.fromkeys(
        ("C104", "C104 (phase)"), REPRODUCED
    )
    early = good | {"ramp": 1.9}
    assert times_of(monkeypatch, "3.6", lambda c: early[c.waveform]) == dict.fromkeys(
        ("C104", "C104 (phase)"), DIFFERENCE
    )
    late = good | {"ramp": 2.4}
    assert times_of(monkeypatch, "3.6", lambda c: late[c.waveform]) == dict.fromkeys(
        ("C104", "C104 (phase)"), NOT_REPRODUCED
    )
    never = good | {"step": float("nan")}
    assert times_of(monkeypatch, "3.6", lambda c: never[c.waveform]) == dict.fromkeys(
        ("C104", "C104 (phase)"), NOT_REPRODUCED
    )


def test_verdict_of_figure_3_9_follows_the_times(monkeypatch):
    assert times_of(monkeypatch, "3.9", lambda c: 1.0 + abs(np.log2(c.period / 8.0)))["C108"] == REPRODUCED
    gap = {64.0: 4.0, 32.0: float("nan"), 16.0: 2.0, 8.0: 1.0, 4.0: 3.0, 2.0: 2.5}
    assert times_of(monkeypatch, "3.9", lambda c: gap.get(c.period, 9.0))["C108"] == DIFFERENCE
    assert times_of(monkeypatch, "3.9", lambda c: 1.0 + abs(np.log2(c.period / 4.0)))["C108"] == NOT_REPRODUCED
    assert times_of(monkeypatch, "3.9", lambda c: 0.1 * c.period)["C108"] == NOT_REPRODUCED


def test_verdicts_of_figure_3_10_follow_the_times(monkeypatch):
    def times(c):
        if c.kind == "relative":
            return 3.0 - c.amplitude - 0.5 * c.a_x
        return 1.0 if c.amplitude > 0.05 else 1.5

    verdicts = times_of(monkeypatch, "3.10", times)
    assert verdicts["C110"] == verdicts["C111"] == verdicts["C112"] == REPRODUCED
    slower = times_of(monkeypatch, "3.10", lambda c: times(c) * (1.6 if c.a_x == 0.0 else 1.0))
    assert slower["C111"] == slower["C112"] == DIFFERENCE
    rising = times_of(monkeypatch, "3.10", lambda c: 1.0 + c.amplitude + c.a_x)
    assert rising["C110"] == NOT_REPRODUCED


@pytest.mark.parametrize("number", OF_TIMES)
def test_nothing_found_at_all_is_no_crash(monkeypatch, number):
    verdicts = times_of(monkeypatch, number, lambda c: float("nan"))
    first = next(iter(verdicts))
    assert verdicts[first] == NOT_REPRODUCED
    for c in make(number).checks:
        assert c.value is None or np.isfinite(c.value)


def test_the_phase_moves_the_change_and_nothing_else():
    case = half_car.Case("sine", period=8.0)
    late = replace(case, phase=0.25)
    d, q = half_car.drive(case), half_car.drive(late)
    assert q.t == pytest.approx(d.t)
    zero = np.searchsorted(d.t, 0.0)
    assert d.v_x[zero] == pytest.approx(q.v_x[zero], abs=0.02)
    # a quarter of a period later the excitation is at its peak when the road changes
    assert d.F_x_f[zero - 1] - q.F_x_f[zero - 1] == pytest.approx(-250.0, abs=10.0)


def test_gates():
    assert TUNING._replace(mu_min=0.0) == GATE_OFF
    assert all_made()[0].stem == "figure_2_01"
