"""A folder under watch: copies in progress, damaged logs, the same log twice, a folder away, a changed campaign."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

import aqualog as aq
from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import vehicle_toml
from aqualog.face import watch as face
from aqualog.face.campaign_inputs import CampaignInputs
from aqualog.face.trade import TyreTest
from aqualog.report.trade.watching import problems, run_lines, status, watch_page
from aqualog.trade import watching
from aqualog.trade.arrivals import Arrivals
from aqualog.trade.evaluation import Options
from aqualog.trade.limits import defaults
from aqualog.trade.logs import Request
from aqualog.trade.watching import AGAIN_S, Watching
from tests import commands
from tests.trade.made import FWD, signals, straight

SETTLE_S = 2.0
CAMPAIGN = 'name = "monday"\nvehicle = "car.toml"\nruns = "runs.csv"\n'


@pytest.fixture(scope="module")
def stock(tmp_path_factory):
    """Six runs as bytes: 74, 75, ... km/h."""
    folder = tmp_path_factory.mktemp("stock")
    for i in range(6):
        aq.convert(signals(straight(v_15=74.0 + i)), folder / f"{i}.parquet", FWD)
    return [(folder / f"{i}.parquet").read_bytes() for i in range(6)]


class Track:
    """A folder, its campaign, and a clock of its own."""

    def __init__(self, base, plan=("a,Alpha", "b,Alpha", "c,Beta")):
        self.base, self.logs, self.now, self.measured, self.last = base, base / "logs", 0.0, [], None
        self.logs.mkdir()
        (base / "car.toml").write_text(vehicle_toml(FWD), encoding="utf-8")
        (base / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
        self.plan(*plan)
        own = CampaignInputs(base / "campaign.toml").configured
        self.watching = Watching(Arrivals(self.logs, SETTLE_S), own, *self.asked())

    def plan(self, *rows):
        lines = [f"logs/{r.replace(',', '.parquet,')}" for r in rows]
        (self.base / "runs.csv").write_text("log,tyre\n" + "\n".join(lines) + "\n", encoding="utf-8")

    def asked(self):
        return Options("straight", defaults(), ("tyre",)), Request("straight", defaults(), whole_only=True)

    def put(self, name, data):
        (self.logs / name).write_bytes(data)

    def do(self, work, run, *task):
        self.measured.append(run.logs[0].name)
        return work(run, *task)

    def settle(self, name, data):
        """What is said of a log once it has not changed for a while."""
        self.put(name, data)
        self.look()
        return self.look(SETTLE_S)

    def look(self, seconds=0.0):
        """All lines of a look, and what is known then."""
        self.now += seconds
        lines = []
        while True:
            found = self.watching.step(self.now, self.do)
            lines, self.last = lines + run_lines(found, self.last), found
            if not found.new:
                return lines, found


@pytest.fixture
def track(tmp_path):
    return Track(tmp_path)


def test_a_log_is_measured_when_it_has_settled_and_once(track, stock):
    track.put("a.parquet", stock[0])
    assert track.look()[0] == []
    lines, found = track.look(1.9)
    assert lines == []
    assert [p.name for p in found.look.growing] == ["a.parquet"]
    lines, found = track.look(0.2)
    assert lines == [
        "a.parquet: 74.0 km/h, valid; Alpha: valid: 1 of 1; still missing: 1 planned run and 1 more valid (3 are "
        "needed)"
    ]
    assert track.look(5.0)[0] == []
    assert track.measured == ["a.parquet"]
    assert found.test.valid == 1


def test_a_verdict_that_later_runs_change_gets_a_line(track, stock, tmp_path):
    aq.convert(signals(straight(v_15=74.0, a=1.0)), tmp_path / "part.parquet", FWD)
    track.settle("a.parquet", (tmp_path / "part.parquet").read_bytes())
    track.settle("b.parquet", stock[1])
    track.plan("a,Alpha", "b,Alpha", "c,Alpha")
    track.watching.reconfigured(CampaignInputs(track.base / "campaign.toml").configured, track.asked()[0])
    lines, _ = track.settle("c.parquet", stock[2])
    assert [x.partition(";")[0] for x in lines] == [
        "c.parquet: 76.0 km/h, valid",
        "a.parquet: now 74.0 km/h, not valid: the acceleration before 15 % is 1.00 m/s², more than 10 % from the "
        "1.30 m/s² of its set at this speed",
    ]
    assert "Alpha: valid: 2 of 3" in lines[1]
    assert track.look(5.0)[0] == []


def test_a_copy_in_progress_waits_for_its_last_piece(track, stock):
    data = stock[1]
    for i in range(1, 5):
        track.put("b.parquet", data[: len(data) * i // 4])
        lines, _ = track.look(1.5)
        assert lines == []
    assert track.measured == []
    assert "75.0 km/h, valid" in track.look(SETTLE_S)[0][0]


def test_a_copy_that_paused_is_damaged_first_and_measured_when_it_is_whole(track, stock):
    track.put("a.parquet", stock[0][: len(stock[0]) // 2])
    track.look()
    lines, found = track.look(3.0)
    assert lines == []
    assert list(found.failed) == ["a.parquet"]
    assert problems(found)[0].startswith("a.parquet: ")
    assert len(found.missing) == 3  # its run is still to be driven, or copied
    lines, found = track.settle("a.parquet", stock[0])
    assert "74.0 km/h, valid" in lines[0]
    assert found.failed == {}


def test_a_copy_that_changed_behind_its_size_and_time(track, stock):
    """Some systems set size and time before the content is there."""
    path = track.logs / "a.parquet"
    path.write_bytes(bytes(len(stock[0])))
    os.utime(path, ns=(10**18, 10**18))
    track.look()
    assert list(track.look(SETTLE_S)[1].failed) == ["a.parquet"]
    path.write_bytes(stock[0])
    os.utime(path, ns=(10**18, 10**18))
    assert track.look(AGAIN_S - 1.0)[0] == []
    assert "74.0 km/h, valid" in track.look(2.0)[0][0]


def test_damaged_logs_are_named_and_others_go_on(track, stock):
    track.put("a.parquet", b"PAR1 nothing")
    track.put("b.parquet", stock[1])
    lines, found = track.settle("c.parquet", stock[2])
    assert len(lines) == 2
    assert [e.log for e in found.test.entries] == ["b.parquet", "c.parquet"]
    assert len(track.measured) == 3
    track.look(AGAIN_S + 1.0)
    track.look(AGAIN_S + 1.0)
    assert len(track.measured) == 3  # the same content is not tried again


def test_empty_and_unreadable_logs_are_named_after_the_usual_time(track, stock, monkeypatch):
    track.put("a.parquet", b"")
    track.put("x.parquet", b"")
    track.look()
    assert track.look(SETTLE_S - 0.5)[1].failed == {}
    _, found = track.look(0.5)
    assert [x.partition("; ")[0] for x in problems(found)[1:]] == ["a.parquet: is empty", "x.parquet: is empty"]
    assert (found.same, found.look.growing, len(found.missing)) == ({}, (), 3)
    assert "74.0 km/h, valid" in track.settle("a.parquet", stock[0])[0][0]

    def refused(*_, **__):
        raise PermissionError(13, "Permission denied", "b.parquet")

    with monkeypatch.context() as m:
        m.setattr(watching.Contents, "of", refused)
        m.setattr("aqualog.trade.logs.load_signals", refused)
        assert track.settle("b.parquet", stock[1])[1].failed["b.parquet"] == "b.parquet: Permission denied"
    assert "75.0 km/h, valid" in track.look(AGAIN_S)[0][0]


def test_the_same_log_twice_counts_once(track, stock):
    track.settle("copy of it.parquet", stock[0])
    _, found = track.settle("a.parquet", stock[0])
    # the copy that the campaign names has the row
    assert [e.log for e in found.test.entries] == ["a.parquet"]
    assert found.same == {"copy of it.parquet": "a.parquet"}
    assert found.unplanned == ()
    assert "copy of it.parquet: the same log as a.parquet, counts once" in problems(found)
    _, found = track.settle("a.parquet", stock[3])
    assert sorted(e.log for e in found.test.entries) == ["a.parquet", "copy of it.parquet"]
    assert found.same == {}


def test_a_copy_that_comes_later_does_not_take_the_row(track, stock):
    track.settle("a.parquet", stock[0])
    lines, found = track.settle("x again.parquet", stock[0])
    assert lines == []
    assert [e.log for e in found.test.entries] == ["a.parquet"]
    assert found.same == {"x again.parquet": "a.parquet"}
    assert track.measured == ["a.parquet"]


def test_a_log_that_can_be_read_in_part_is_no_run(track, tmp_path):
    """An MCAP that ends in the middle gives its first part; a test needs all of it."""
    aq.convert(signals(straight(v_15=74.0)), tmp_path / "whole.mcap", FWD)
    data = (tmp_path / "whole.mcap").read_bytes()
    (track.logs / "a.mcap").write_bytes(data[: len(data) * 4 // 5])
    assert aq.doctor(track.logs / "a.mcap").has_loss
    track.look()
    lines, found = track.look(SETTLE_S)
    assert lines == []
    assert "a.mcap is cut (" in found.failed["a.mcap"]
    (track.logs / "a.mcap").write_bytes(data)
    track.look()
    assert "74.0 km/h, valid" in track.look(SETTLE_S)[0][0]


def test_a_folder_that_is_away_and_comes_back(track, stock):
    track.settle("a.parquet", stock[0])
    track.logs.rename(track.base / "elsewhere")
    _, found = track.look(1.0)
    assert found.look.away
    assert found.test.valid == 1
    assert problems(found) == ["the folder is away: No such file or directory"]
    track.logs.mkdir()  # a place where nothing is mounted is an empty folder
    _, found = track.look(1.0)
    assert (found.look.away, found.test.valid) == ("", 1)
    track.logs.rmdir()
    (track.base / "elsewhere").rename(track.logs)
    lines, found = track.look(1.0)
    assert lines == []
    assert track.measured == ["a.parquet"]
    assert found.test.valid == 1


def test_a_folder_that_vanishes_while_a_log_is_read_is_no_damaged_log(track, stock):
    track.put("a.parquet", stock[0])
    track.look()
    track.now += SETTLE_S

    def gone(work, run, *task):
        track.logs.rename(track.base / "elsewhere")
        return work(run, *task)

    found = track.watching.step(track.now, gone)
    assert found.failed == {}
    assert found.new == ""
    (track.base / "elsewhere").rename(track.logs)
    assert "74.0 km/h, valid" in track.look(1.0)[0][0]


def test_a_process_that_ends_is_one_log(track, stock):
    track.put("a.parquet", stock[0])
    track.put("b.parquet", stock[1])
    track.look()
    track.now += SETTLE_S
    found = track.watching.step(track.now, lambda *_: watching.Crashed(1.0))
    assert list(found.failed) == ["a.parquet"]
    assert "75.0 km/h" in track.look()[0][0]


@pytest.mark.parametrize("plan", [("a,Alpha", "b,Alpha"), ("a,", "b,"), ("a,", "b,Alpha")])
def test_a_log_that_no_run_names_is_in_no_mean_of_a_planned_set(tmp_path, stock, plan):
    """Runs of one tyre are one set, and so are runs without a tyre; a stray log may have any."""
    track = Track(tmp_path, plan)
    for name, data in (("x17", stock[5]), ("a", stock[0]), ("b", stock[1])):
        track.settle(f"{name}.parquet", data)
    assert [len(s.members) for s in track.last.test.sets if s.group == watching.UNPLANNED] == [1]
    assert sum(len(s.members) for s in track.last.test.sets) == 3
    own = Options("straight", defaults(), ())
    track.watching.reconfigured(CampaignInputs(track.base / "campaign.toml").configured, own)
    _, found = track.look(1.0)
    assert [round(s.summary.mean, 1) for s in found.test.sets] == [79.0, 74.5]
    row = TyreTest(found.test, "monday").document["sets"][0]
    assert (row["x_run"], row["tyre"]) == ("in no run of the campaign", None)
    track.plan(*plan, "x17,")
    track.watching.reconfigured(CampaignInputs(track.base / "campaign.toml").configured, own)
    assert track.look(1.0)[0][0].startswith("x17.parquet: 79.0 km/h, valid; all runs: valid: 3 of 3")


def test_logs_that_no_run_names_and_runs_to_come(track, stock):
    lines, found = track.settle("x17.parquet", stock[0])
    assert lines == ["x17.parquet: 74.0 km/h, valid; in no run of the campaign: valid: 1 of 1"]
    assert found.unplanned == ("x17.parquet",)
    assert "in no run of the campaign: x17.parquet" in problems(found)
    assert "still missing: 3 planned runs" in status(found)
    track.plan("a,Alpha", "b,Alpha", "x17,Beta")
    own = CampaignInputs(track.base / "campaign.toml").configured
    track.watching.reconfigured(own, track.asked()[0])
    lines, found = track.look(1.0)
    assert "; Beta: valid: 1 of 1" in lines[0]
    assert found.unplanned == ()


def test_a_run_of_two_files_waits_for_both(tmp_path, stock):
    track = Track(tmp_path)
    (tmp_path / "runs.csv").write_text("log,tyre\nlogs/a.parquet;logs/gps.csv,Alpha\n", encoding="utf-8")
    track.watching.reconfigured(CampaignInputs(tmp_path / "campaign.toml").configured, track.asked()[0])
    track.put("a.parquet", stock[0])
    track.look()
    assert track.look(SETTLE_S)[0] == []
    lines, found = track.settle("gps.csv", b"t [s],latitude [deg]\n0,48\n1,48\n2,48\n")
    assert "74.0 km/h, valid" in lines[0]
    assert found.missing == ()


def test_hidden_and_half_named_files_are_no_logs(track, stock):
    for name in (".a.parquet", "~a.parquet", "a.parquet.part", "notes.txt"):
        track.put(name, stock[0])
    (track.logs / "below").mkdir()
    (track.logs / "below" / "b.parquet").write_bytes(stock[1])
    track.look()
    _, found = track.look(SETTLE_S)
    assert [e.log for e in found.test.entries] == [os.path.join("below", "b.parquet")]  # noqa: PTH118


def test_the_page_renews_itself_and_holds_what_counts(track, stock):
    track.put("a.parquet", stock[0])
    _, found = track.settle("c.parquet", b"PAR1 nothing")
    page = watch_page(found, title="monday", clock="14:03:21", refresh_s=3)
    assert '<meta http-equiv="refresh" content="3">' in page
    assert "at 14:03:21" in page
    assert "valid: 1 of 1" in page
    assert "c.parquet" in page
    assert len(page) < 60_000
    assert "refresh" not in watch_page(found, title="m", clock="14:03, ended", refresh_s=0)


def test_once(tmp_path, stock, monkeypatch):
    monkeypatch.setattr(face, "SETTLE_S", 0.2)
    track = Track(tmp_path)
    track.put("a.parquet", stock[0])
    track.put("c.parquet", stock[2])
    given = ("watch", track.logs, "--campaign", tmp_path / "campaign.toml", "--once", "--every", "0.1")
    done = commands.run(*given, "--json", "-q")
    assert done.exit_code == 0, done.stderr
    d = json.loads(done.stdout)
    assert [r["log"] for r in d["runs"]] == ["a.parquet", "c.parquet"]
    whole = commands.run("test", "straight", tmp_path / "campaign.toml", "--json", "-q")
    theirs = json.loads(whole.stdout)
    assert [r["v_15_kmh"] for r in d["runs"]] == [r["v_15_kmh"] for r in theirs["runs"]]
    page = (tmp_path / "campaign.watch.html").read_text()
    assert ", ended" in page
    above = commands.run("watch", tmp_path, *given[2:])  # where the table of its runs lies: no log
    assert above.exit_code == 0, above.stderr
    track.put("b.parquet", b"PAR1")
    done = commands.run(*given)  # its own page is in nobody's way
    assert done.exit_code == 3
    assert commands.one_error_line(done).startswith("error: b.parquet: ")
    assert done.stdout.startswith("a.parquet: 74.0 km/h, valid")
    track.put("b.parquet", b"")
    done = commands.run(*given)
    assert (done.exit_code, commands.one_error_line(done)) == (3, "error: b.parquet: is empty; expected a log")
    (tmp_path / "mine.html").write_text("mine")
    refused = commands.one_error_line(commands.run(*given, "-o", tmp_path / "mine.html"))
    assert refused.endswith("mine.html: exists already. Try: another name for the page")
    assert (tmp_path / "mine.html").read_text() == "mine"


def test_errors(tmp_path, monkeypatch):
    track = Track(tmp_path)
    assert "no --campaign" in commands.run("watch", track.logs).stderr
    with pytest.raises(ConfigError, match="is no folder"):
        aq.watch(tmp_path / "nowhere", tmp_path / "campaign.toml", once=True)
    with pytest.raises(ConfigError, match='no test "sideways"'):
        aq.watch(track.logs, tmp_path / "campaign.toml", "sideways")
    given = ("watch", track.logs, "--campaign", tmp_path / "campaign.toml", "--once")
    empty = commands.run(*given)
    assert empty.exit_code == 4
    assert "the page is" in empty.stderr
    monkeypatch.setattr("aqualog.report.page.write_page", lambda *_: (tmp_path / "gone").stat())  # an OSError
    assert "the page is" not in commands.run(*given).stderr


def test_ctrl_c_ends_it_cleanly(tmp_path, stock):
    track = Track(tmp_path)
    given = ["watch", str(track.logs), "--campaign", str(tmp_path / "campaign.toml"), "--every", "0.2"]
    watch = subprocess.Popen(
        [sys.executable, "-m", "aqualog", *given], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, **commands.PLAIN},
    )  # fmt: skip
    track.put("a.parquet", stock[0])
    assert "74.0 km/h, valid" in watch.stdout.readline()
    track.plan("a,Alpha", "b,Gamma")
    track.put("b.parquet", stock[1])
    assert "75.0 km/h, valid; Gamma: valid: 1 of 1" in watch.stdout.readline()
    deadline = time.monotonic() + 20.0
    page = tmp_path / "campaign.watch.html"
    while "b.parquet" not in page.read_text() and time.monotonic() < deadline:
        time.sleep(0.1)
    watch.send_signal(signal.SIGINT)
    out, err = watch.communicate(timeout=30)
    assert watch.returncode == 130, err
    assert "Traceback" not in err
    assert "2 of 2 runs valid" in out
    assert "Gamma" in out
    assert "refresh" not in page.read_text()
    assert [p.name for p in tmp_path.iterdir() if p.suffix == ".html"] == ["campaign.watch.html"]
