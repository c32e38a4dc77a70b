"""Criterion 4: the slope against its history (C56, C68), on scripted estimates and on simulated drives."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aqualog.align.load import load_signals
from aqualog.config.history import load_history, save_history
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.core.records import SlopeSummary
from aqualog.core.vehicle import Vehicle
from aqualog.detect.slip_slope import drop
from aqualog.detect.slip_slope.history import History, Period, reference, remembered
from aqualog.detect.slip_slope.watch import Memory, pairs, remarks
from aqualog.detect.stream import DriveStream, detect_drive
from aqualog.model.scenario import SURFACES, Excitation, Lane, Scenario
from aqualog.model.simulate import simulate
from aqualog.report.drive.panels import drive_rows
from aqualog.report.drive.report import drive_report
from aqualog.report.text import report_text

DT = 0.01
RWD = Vehicle(name="rwd", given=frozenset({"drivetrain", "mass", "tyre.slip_slope_r"}))
AWD = Vehicle(name="awd", drivetrain="awd", torque_split_rear=0.5, given=frozenset({"drivetrain", "mass"}))


def judge(slope, sd=0.5, valid=True, alarm=0.0, periods=(), rule="robust", fallback=np.nan):
    slope = np.asarray(slope, dtype=float)
    state = drop.initial_state(tuple(periods), rule=rule, fallback=fallback)
    return drop.scan(
        drop.DropParams.make(DT, rule), state, slope, np.broadcast_to(np.asarray(sd, dtype=float), slope.shape),
        np.broadcast_to(valid, slope.shape), np.broadcast_to(alarm, slope.shape),
    )  # fmt: skip


def seconds(value, s):
    return np.full(round(s / DT), float(value))


def test_half_of_the_reference_and_back():
    """C68: "the actual slip slope decreases below half of the maximum historic value"."""
    slope = np.concatenate([seconds(30, 5), seconds(15.1, 1), seconds(14.9, 1), seconds(17.9, 1), seconds(18.1, 1)])
    loss, active, refs, _ = judge(slope, fallback=30.0)
    assert not active[:600].any()
    assert active[600:800].all()
    assert not active[800:].any()
    assert loss[650] == pytest.approx(1 - 14.9 / 30)
    assert refs == pytest.approx(30.0)


def test_an_uncertain_estimate_is_not_judged_and_a_detection_outlasts_it_by_two_seconds():
    slope = np.concatenate([seconds(30, 1), seconds(10, 1), seconds(10, 4)])
    sd = np.where(np.arange(slope.size) >= 200, 3.0, 0.5)
    state = drop.initial_state((), rule="robust", fallback=30.0)
    args = (np.ones(slope.size, dtype=bool), np.zeros(slope.size))
    loss, active, _, _ = drop.scan(drop.DropParams.make(DT, "robust"), state, slope, sd, *args)
    assert np.isnan(loss[200:]).all()
    assert np.flatnonzero(active)[[0, -1]].tolist() == [100, 398]
    _, never, _, _ = judge(seconds(10, 3), valid=False, fallback=30.0)
    assert not never.any()


def test_a_rise_of_the_slope_ends_it_at_once():
    slope, alarm = seconds(10, 3), np.zeros(300)
    alarm[200] = -1.0
    _, active, _, _ = judge(slope, sd=np.where(np.arange(300) >= 200, 5.0, 0.5), alarm=alarm, fallback=30.0)
    assert np.flatnonzero(active)[[0, -1]].tolist() == [0, 199]
    _, active, _, _ = judge(slope, alarm=alarm, fallback=30.0)
    assert active.all()  # still low and known: it goes on


def test_a_drive_without_any_reference_makes_its_own_after_five_seconds():
    slope = np.concatenate([seconds(28, 6), seconds(10, 1)])
    _, active, refs, _ = judge(slope)
    assert np.isnan(refs[:499]).all()
    assert refs[550] == pytest.approx(28.0)
    assert active[600:].all()


def test_what_has_dropped_teaches_nothing():
    """A long drive on snow after a dry one stays detected."""
    slope = np.concatenate([seconds(30, 70), seconds(10, 200)])
    _, active, refs, state = judge(slope)
    assert active[-1]
    assert refs[-1] == pytest.approx(30.0)
    assert len(drop.completed(state)) == 3  # two full ones, and the ten seconds left


def test_nothing_is_learnt_while_an_estimate_settles():
    slope, alarm = seconds(30, 40), np.zeros(4000)
    slope[1000:1400] = 55.0  # overshoot after an alarm
    alarm[1000] = -1.0
    *_, state = judge(slope, alarm=alarm)
    assert max(p.largest for p in drop.completed(state)) == 30.0
    *_, state = judge(slope)
    assert max(p.largest for p in drop.completed(state)) == 55.0


def test_largest_and_robust_reference():
    """C56 with the thesis' maximum, and what one outlier does to both."""
    periods = [Period(31.0, 29.0, 30.0), Period(33.0, 30.0, 30.0), Period(70.0, 30.5, 30.0), Period(31.0, 28.0, 30.0)]
    assert reference(periods, rule="max") == 70.0
    assert reference(periods) == pytest.approx(np.quantile([29, 30, 30.5, 28], 0.75))
    assert np.isnan(reference([]))
    for rule in ("max", "robust"):
        _, active, refs, _ = judge(seconds(30, 1), periods=periods, rule=rule)
        assert refs[0] == pytest.approx(reference(periods, rule=rule))
        assert active.all() == (rule == "max")


def test_kept_periods_are_the_newest_twenty_and_the_same_in_the_recursion():
    slope = np.concatenate([seconds(20 + i, 30.005) for i in range(25)])
    *_, refs, state = judge(slope, rule="max")
    done = drop.completed(state)
    history = History().with_periods("c", "left", done)
    assert len(history.of("c", "left")) == 20
    assert history.of("c", "left")[-1].mean == pytest.approx(44.0, abs=0.5)
    assert refs[-1] == pytest.approx(reference(history.of("c", "left"), rule="max"), abs=1.0)


@pytest.mark.parametrize("cut", [1, 17, 2999, 3000, 3001, 3777])
def test_pieces_are_the_whole(cut):
    rng = np.random.default_rng(3)
    slope = np.repeat(rng.uniform(8, 35, 80), 100) + rng.normal(0, 1, 8000)
    sd = rng.uniform(0, 8, 8000)
    valid = rng.random(8000) < 0.9
    alarm = np.where(rng.random(8000) < 0.001, 1.0, 0.0)
    p, state = drop.DropParams.make(DT, "robust"), drop.initial_state((), rule="robust")
    whole = drop.scan(p, state, slope, sd, valid, alarm)
    *first, middle = drop.scan(p, state, slope[:cut], sd[:cut], valid[:cut], alarm[:cut])
    *second, _ = drop.scan(p, middle, slope[cut:], sd[cut:], valid[cut:], alarm[cut:])
    for a, b, c in zip(whole[:3], first, second, strict=True):
        assert np.array_equal(a, np.concatenate([b, c]), equal_nan=True)


def test_history_file_and_back(tmp_path):
    history = History().with_periods("summer, 1.9 bar", "left", [Period(31.5, 30.2, 30.0)])
    save_history(tmp_path / "h.json", history)
    assert load_history(tmp_path / "h.json") == history
    assert load_history(tmp_path / "none.json") == History()


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{}", '{"schema_version": 2, "slip_slope_history": {}}', '{"slip_slope_history": {}}',
        '{"schema_version": 1, "slip_slope_history": {"a": 3}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [3]}}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [{"max": 3, "mean": "x", "seconds": 1}]}}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [{"max": NaN, "mean": 1, "seconds": 1}]}}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [{"max": -3, "mean": 1, "seconds": 1}]}}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [{"max": 30, "mean": 31, "seconds": 1}]}}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [{"max": 301, "mean": 30, "seconds": 1}]}}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [{"max": 30, "mean": 0.9, "seconds": 1}]}}}',
        '{"schema_version": 1, "slip_slope_history": {"a": {"left": [{"max": 1%s, "mean": 9, "seconds": 1}]}}}' % (400 * "0"),
        '{"schema_version": 1, "slip_slope_history": {"a": {"roof": [{"max": 30, "mean": 30, "seconds": 1}]}}}',
        '{"schema_version": 1, "slip_slope_history": {"\\ud800": {"left": []}}}',
        '{"schema_version": true, "slip_slope_history": {}}',
    ],
)  # fmt: skip
def test_a_file_that_is_no_history(tmp_path, text):
    path = tmp_path / "h.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"h\.json"):
        load_history(path)


def test_a_history_of_endless_brackets_is_told_in_our_words(tmp_path):
    path = tmp_path / "h.json"
    path.write_text("[" * 100_000)
    with pytest.raises(ConfigError) as caught:
        load_history(path)
    assert caught.value.line() == f"{path}: is nested deeper than 100 levels"


def test_a_drive_that_is_looked_at_again_counts_once():
    first = History().with_periods("c", "left", [Period(31.0, 30.0, 30.0, "a"), Period(33.0, 32.0, 30.0, "b")])
    summary = SlopeSummary("left", None, 30.0, 1.0, 30.0, None, 0.0, 0, {}, {}, periods=((29.5, 29.0, 30.0),))
    again = remembered(first, "c", [summary], drive="a")
    assert [p.drive for p in again.of("c", "left")] == ["b", "a"]
    assert remembered(again, "c", [summary], drive="a") == again
    assert [p.drive for p in again.without("a").of("c", "left")] == ["b"]
    assert again.without("z") == again


def test_a_history_behind_a_link_and_one_too_large(tmp_path, monkeypatch):
    history = History().with_periods("c", "left", [Period(31.0, 30.0, 30.0)])
    (tmp_path / "link.json").symlink_to(tmp_path / "real.json")
    save_history(tmp_path / "link.json", history)
    assert (tmp_path / "link.json").is_symlink()
    assert load_history(tmp_path / "real.json") == history
    before = (tmp_path / "real.json").read_bytes()
    monkeypatch.setattr("aqualog.config.history.MAX_BYTES", 100)
    with pytest.raises(ConfigError, match="grow beyond"):
        save_history(tmp_path / "link.json", history)
    with pytest.raises(ConfigError, match="larger than"):
        load_history(tmp_path / "real.json")
    assert (tmp_path / "real.json").read_bytes() == before


def test_runs_side_by_side_lose_nothing(tmp_path):
    """Four processes, each adding its configurations to the same file."""
    path = tmp_path / "h.json"
    code = (
        "import sys; from pathlib import Path; from aqualog.config.history import update_history\n"
        "from aqualog.detect.slip_slope.history import Period\n"
        "for i in range(10): update_history(Path(sys.argv[1]), lambda h: h.with_periods("
        "f'{sys.argv[2]}-{i}', 'left', [Period(30.0, 30.0, 30.0)]))"
    )
    runs = [subprocess.Popen([sys.executable, "-c", code, str(path), str(k)]) for k in range(4)]
    assert [r.wait() for r in runs] == [0] * 4
    assert len(load_history(path).periods) == 40


def test_pairs_of_each_drivetrain():
    """C87: at the driven axle with one driven axle; per side, or the axles' means."""
    assert [(p.place, p.wheel, p.i, p.j) for p in pairs(RWD)] == [
        ("left", "rl", ("rl",), ("fl",)),
        ("right", "rr", ("rr",), ("fr",)),
    ]
    fwd = Vehicle(drivetrain="fwd", torque_split_rear=0.0)
    assert [(p.wheel, p.i, p.j) for p in pairs(fwd)] == [("fl", ("fl",), ("rl",)), ("fr", ("fr",), ("rr",))]
    assert [(p.wheel, p.i, p.j) for p in pairs(AWD)] == [(None, ("fl",), ("rl",)), (None, ("fr",), ("rr",))]
    assert [(p.i, p.j) for p in pairs(AWD, form="r")] == [(("rl",), ("fl",)), (("rr",), ("fr",))]
    assert [(p.i, p.j) for p in pairs(AWD, per_axle=True)] == [(("fl", "fr"), ("rl", "rr"))]


def drive(vehicle, seed=5, memory=None, **kw):
    base = {"duration_s": 40.0, "seed": seed, "speed": ((0.0, 25.0), (10.0, 28.0), (20.0, 25.0), (40.0, 28.0))}
    scenario = Scenario(vehicle=vehicle, **(base | kw))
    grid = np.arange(round(scenario.duration_s * 100)) / 100
    columns = {
        n: np.interp(grid, g.t, x)
        for g in simulate(scenario).measured
        if g.name != "truth"
        for n, x in g.columns.items()
    }
    stream = DriveStream(vehicle, 10_000_000, [c for c in columns if c != "v_x"], memory=memory)
    piece = stream.push(columns)
    events = [e for e in (*piece.events, *stream.finish()) if e.detector == "slip_slope_drop"]
    return events, stream


SINE = Excitation("sine", 0.05, "mu", 8.0)
SNOW = (Lane(20.0, 40.0, surface=SURFACES["snow"]),)


def test_an_excited_all_wheel_drive_notices_snow_and_not_dry_road():
    dry, stream = drive(AWD, excitation=SINE)
    assert dry == []
    for summary in stream.slopes:
        assert summary.slope == pytest.approx(31.0, rel=0.1)
    events, _ = drive(AWD, excitation=SINE, lanes=SNOW)
    assert {e.side for e in events} == {"left", "right"}
    assert {e.wheel for e in events} == {None}
    for event in events:
        assert 20.0 < event.start_s < 26.0
        assert event.end_s == pytest.approx(40.0)
        assert event.evidence["slope_min"] < 0.5 * event.evidence["slope_ref"]
        assert event.threshold == 0.5
        assert event.peak == pytest.approx(1 - 10 / 31, abs=0.1)


def test_at_the_load_share_it_is_blind_and_says_so():
    """C95: equal slips on both axles; no alarm, and a reported blindness."""
    even = replace(AWD, torque_split_rear=AWD.l_f / (AWD.l_f + AWD.l_r))
    events, stream = drive(even, lanes=SNOW)
    assert events == []
    for summary in stream.slopes:
        assert summary.seconds["blind"] > 0.95 * sum(summary.seconds.values())
        assert summary.alarms == 0
    (note,) = remarks(stream.slopes)
    assert "left, right" in note
    assert "both axles slip alike" in note


def test_one_driven_axle_notices_snow_while_it_is_driven():
    pulls = ((0.0, 22.0), (6.0, 26.0), (12.0, 22.0), (18.0, 26.0), (24.0, 23.0), (40.0, 30.0))
    assert drive(RWD, speed=pulls)[0] == []
    events, _ = drive(RWD, speed=pulls, lanes=SNOW)
    assert {e.wheel for e in events} == {"rl", "rr"}
    assert all(e.start_s > 20.0 for e in events)


def test_history_goes_from_drive_to_drive():
    """A car that starts on snow knows from the last drive what dry road is."""
    _, stream = drive(AWD, excitation=SINE, duration_s=60.0)
    slopes = stream.slopes
    history = remembered(History(), "summer", slopes)
    assert set(history.periods["summer"]) == {"left", "right"}
    all_snow = (Lane(0.0, 40.0, surface=SURFACES["snow"]),)
    without, _ = drive(AWD, excitation=SINE, lanes=all_snow)
    assert without == []
    events, _ = drive(AWD, excitation=SINE, lanes=all_snow, memory=Memory(history, "summer"))
    assert {e.side for e in events} == {"left", "right"}
    other, _ = drive(AWD, excitation=SINE, lanes=all_snow, memory=Memory(history, "winter"))
    assert other == []


def test_text_and_page_of_a_drive():
    """Seconds of each state in the text, the slope beside its dry value as a row of the page."""
    samples = Path(__file__).parents[3] / "sample_logs"
    car = load_vehicle(samples / "vehicle.toml")
    result = detect_drive(load_signals([samples / "lane_drive.parquet"], vehicle=car), car)
    told = [x.split("  ") for x in report_text(drive_report(result)).splitlines() if x.startswith(("RL  ", "RR  "))]
    assert len(told) == 2
    for cells in told:
        name, _, dry, source, *seconds = [c.strip() for c in cells if c.strip()]
        assert (dry, source) == ("31.0", "vehicle file"), name
        assert sum(map(float, seconds)) == pytest.approx(24.0, abs=1.0)
    row = next(r for r in drive_rows(result) if r.title == "Slip slope")
    assert [x.label for x in row.lines] == ["RL", "RL, dry", "RR", "RR, dry"]
    assert np.nanmin(row.lines[0].values) < 15.0 < 30.0 < np.nanmax(row.lines[1].values)


def test_history_of_the_command(tmp_path):
    from typer.testing import CliRunner

    from aqualog.cli.main import app

    samples = Path(__file__).parents[3] / "sample_logs"
    path = tmp_path / "slopes.json"
    save_history(path, History().with_periods("worn, 1.9 bar", "left", [Period(62.0, 60.0, 30.0)]))
    args = ["--vehicle", samples / "vehicle.toml", "--history", path, "--configuration", "worn, 1.9 bar", "--json"]

    def run(*more):
        command = ["detect", samples / "lane_drive.mf4", *args, *more]
        return CliRunner().invoke(app, [str(c) for c in command])

    result = run()
    assert result.exit_code == 0, result.stderr
    left, right = json.loads(result.stdout)["slip_slope"]
    assert left["reference"] == pytest.approx(60.0)
    assert right["reference"] == pytest.approx(31.0)  # the vehicle file's
    assert "worn, 1.9 bar" in json.loads(path.read_text())["slip_slope_history"]
    kept = json.loads(path.read_text())["slip_slope_history"]["worn, 1.9 bar"]
    assert run().exit_code == 0
    assert json.loads(path.read_text())["slip_slope_history"]["worn, 1.9 bar"] == kept
    assert run("--reference", "median").exit_code == 2
    for bad in ("a\nb", 201 * "x"):
        assert run("--configuration", bad).exit_code == 2
    failed = run("-o", path / "out")
    assert failed.exit_code == 2
    assert "slopes.json" in failed.stderr
    path.write_text("{}")
    failed = run()
    assert failed.exit_code == 2
    assert "slopes.json" in failed.stderr
    assert path.read_text() == "{}"
