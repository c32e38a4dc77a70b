"""What `aqualog doctor` finds in sound and in damaged logs."""

import json
import re
import shlex

import numpy as np
import pytest

from aqualog.align.freezes import longest_stop
from aqualog.align.load import load_signals
from aqualog.align.mapping import SignalMap, SourceClock
from aqualog.cli.main import app
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.doctor import examine as examination
from aqualog.doctor.examine import examine
from aqualog.doctor.findings import Examination, FileState, Finding
from aqualog.face.inspect import exit_code
from aqualog.io.write_mdf import MdfGroup, write_mf4
from tests.commands import run
from tests.conftest import ROOT

SAMPLES = ROOT / "sample_logs"
CAR = load_vehicle(SAMPLES / "vehicle.toml")


WHEELS = "t [s],omega_fl [rad/s],omega_fr [rad/s]"


def table(rows, header="t [s],omega_fl [rad/s],omega_fr [rad/s],v_x [m/s]"):
    return "\n".join([header, *(",".join(f"{c:.6g}" for c in r) for r in rows)]) + "\n"


def drive(n=3000):
    rng = np.random.default_rng(1)
    t = np.arange(n) * 0.01
    v = 20.0 + np.sin(t) + rng.normal(0, 0.01, n)
    return np.column_stack([t, v / 0.31, v / 0.31, v])


def kinds(tmp_path, text):
    path = tmp_path / "x.csv"
    path.write_text(text)
    found = examine([path], vehicle=CAR, signal_map=SignalMap())
    return {(f.level, f.kind): f for f in found.findings}, found


def test_sound_log():
    found = examine([SAMPLES / "lane_drive.parquet"], vehicle=CAR, signal_map=SignalMap())
    assert not found.has_loss
    assert not [f for f in found.findings if f.kind in ("frozen", "code", "signal")]
    assert set(found.ready) >= {"spin_down", "minor_spin_down", "resistance", "joint_cusum"}
    assert dict(found.missing)["tie_rod"]


@pytest.mark.filterwarnings("error")
def test_values_that_have_no_mean(tmp_path):
    x = drive()
    x[::2, 1:] = 1.7e308
    found = kinds(tmp_path, table(x))[1]
    assert found.files[0].samples == 9000


def reset(x):
    x[1500:, 0] -= 14.0
    return x


def wrapped(x):
    x[:, 0] += 2**32 * 1e-6 - 12.0
    x[1200:, 0] -= 2**32 * 1e-6
    return x


def doubled(x):
    x[100:200, 0] = x[100, 0]
    return x


def swapped(x):
    x[[700, 701]] = x[[701, 700]]
    return x


def pause(x):
    x[2000:, 0] += 30.0
    return x


@pytest.mark.parametrize(
    ("change", "expected", "told"),
    [(reset, ("mended", "resets"), "1 resets of the clock (first at 14.99 s); what follows is put"),
     (wrapped, ("mended", "wraps"), "1 overflows of the time counter (first at 11.99 s); undone"),
     (doubled, ("lost", "duplicates"), "99 time stamps doubled (first at 1.00 s); the last sample"),
     (swapped, ("mended", "back_steps"), "1 time stamps out of order (first at 7.01 s); samples are sorted"),
     (pause, ("doubt", "pauses"), "1 pauses of the recording (first at 19.99 s); nothing is judged")],
)  # fmt: skip
def test_time_faults(change, expected, told, tmp_path):
    found, _ = kinds(tmp_path, table(change(drive())))
    assert expected in found
    assert found[expected].what.startswith(told)
    assert f"{found[expected].first_s:.2f}" in told


@pytest.mark.parametrize(("ppm", "is_told"), [(0.0, False), (1000.0, True)])
def test_two_files_whose_clocks_run_apart(tmp_path, ppm, is_told):
    rng = np.random.default_rng(3)
    t = np.arange(12000) * 0.05
    v = 20.0 + np.convolve(rng.normal(0.0, 1.0, t.size + 200), np.hanning(201) / 12.0, mode="valid")
    noise = rng.normal(0.0, 0.01, (2, t.size))
    (tmp_path / "wheels.csv").write_text(table(np.column_stack([t, *[(v + noise[0]) / 0.317] * 2]), header=WHEELS))
    late = t * (1.0 + 1e-6 * ppm)
    (tmp_path / "gps.csv").write_text(table(np.column_stack([late, v + noise[1]]), header="t [s],v_x [m/s]"))
    found = examine([tmp_path / "wheels.csv", tmp_path / "gps.csv"], vehicle=CAR, signal_map=SignalMap())
    told = [f for f in found.findings if f.kind == "drifts"]
    assert len(told) == is_told
    if is_told:
        assert (told[0].level, told[0].file) == ("doubt", "gps.csv")
        assert re.match(r"its clock drifts by \+(9[89]\d|100\d|101\d) ppm .* against wheels.csv", told[0].what)
        fixed = SignalMap(clocks={"gps.csv": SourceClock(0.0, 1000.0 / 1.001, 0.0)})
        again = examine([tmp_path / "wheels.csv", tmp_path / "gps.csv"], vehicle=CAR, signal_map=fixed)
        assert not [f for f in again.findings if f.kind == "drifts"]


@pytest.mark.parametrize(("late_s", "is_told"), [(0.2, False), (0.7, True), (-0.7, True)])
def test_two_files_whose_clocks_stand_apart(tmp_path, late_s, is_told):
    rng = np.random.default_rng(4)
    t = np.arange(4000) * 0.05
    v = 20.0 + np.convolve(rng.normal(0.0, 1.0, t.size + 200), np.hanning(201) / 12.0, mode="valid")
    noise = rng.normal(0.0, 0.01, (2, t.size))
    other = np.column_stack([t + 5.0 + late_s, v + noise[1]])
    (tmp_path / "gps.csv").write_text(table(other[20:], header="t [s],v_x [m/s]"))
    (tmp_path / "wheels.csv").write_text(
        table(np.column_stack([t + 5.0, *[(v + noise[0]) / 0.317] * 2]), header=WHEELS)
    )
    found = examine([tmp_path / "wheels.csv", tmp_path / "gps.csv"], vehicle=CAR, signal_map=SignalMap())
    told = [f for f in found.findings if f.kind == "offset"]
    assert len(told) == is_told
    if is_told:
        assert f"comes 0.70 s {'after' if late_s > 0 else 'before'} the same in wheels.csv" in told[0].what


def test_a_file_that_was_not_finalised_is_told_once(tmp_path):
    data = bytearray((SAMPLES / "lane_drive.mf4").read_bytes())
    data[:8] = b"UnFinMF "
    path = tmp_path / "a.mf4"
    path.write_bytes(data)
    found = examine([path], vehicle=CAR, signal_map=SignalMap())
    assert [(f.level, f.kind) for f in found.findings if "finalised" in f.what] == [("mended", "unfinalised")]
    assert load_signals([path], vehicle=CAR, signal_map=SignalMap()).quality.unfinalised
    assert not load_signals([SAMPLES / "lane_drive.mf4"], vehicle=CAR, signal_map=SignalMap()).quality.unfinalised


def test_values(tmp_path):
    x = drive()
    x[500:1900, 1] = x[500, 1]
    x[10:20, 3] = np.nan
    found, _ = kinds(tmp_path, table(x))
    frozen = found["left_out", "frozen"]  # once, and not as worth a look, too
    assert ("doubt", "frozen") not in found
    assert (frozen.channel, frozen.file) == ("omega_fl", "x.csv")
    assert "1399 samples (first at 5.00 s) only repeat the one before, for up to 14.0 s" in frozen.what
    assert found["doubt", "not_finite"].count == 10


@pytest.mark.parametrize(("top", "is_code"), [(1022.0, True), (1021.0, False)])
def test_the_last_but_one_of_a_width_is_a_code(top, is_code, tmp_path):
    x = drive()
    x[:, 1] = np.arange(3000) % 476
    x[500:555, 1] = top
    found, _ = kinds(tmp_path, table(x, header="t [s],torque_raw,omega_fr [rad/s],v_x [m/s]"))
    assert (("doubt", "code") in found) is is_code
    if is_code:
        assert found["doubt", "code"].advice == "invalid = [1022] in the map"


def test_a_channel_that_is_no_signal_is_worth_a_look(tmp_path):
    x = drive()
    x[:, 1] = np.where((np.arange(3000) > 500) & (np.arange(3000) < 1900), x[500, 1], x[:, 1])
    found, _ = kinds(
        tmp_path, table(x[:, [0, 2, 2, 3, 1]], header="t [s],omega_fl [rad/s],omega_fr [rad/s],v_x [m/s],other")
    )
    assert found["doubt", "frozen"].channel == "other"
    assert "for 14 s (from 5 s)" in found["doubt", "frozen"].what


def stop_of(values, standing=()):
    t_ns = np.arange(len(values), dtype=np.int64) * 10**8
    return longest_stop(t_ns, np.asarray(values, dtype=float), [(a * 10**9, b * 10**9) for a, b in standing])


def test_a_coarse_signal_and_a_car_at_rest_are_not_frozen():
    noise = np.random.default_rng(0).normal(size=3000)
    coarse = np.repeat(np.arange(10.0), 300)
    at_rest = np.where(np.arange(3000) < 1000, 0.0, noise)
    stuck = np.where((np.arange(3000) >= 1000) & (np.arange(3000) < 2000), 1.5, noise)
    slow = np.where((np.arange(3000) // 20) % 2 == 0, 3.0 + np.arange(3000) // 40, noise)  # stops of 2 s all the time
    slow[1000:1150] = 7.5
    assert stop_of(slow) is None
    assert stop_of(coarse) is None
    assert stop_of(at_rest) is None
    assert stop_of(stuck) == pytest.approx((99.9, 100.0, 1.5, 99.9, 1.0))
    assert stop_of([]) is None
    assert stop_of([1.0]) is None


def test_what_rests_while_the_car_stands_is_not_frozen():
    noise = np.random.default_rng(0).normal(size=3000)
    creep = np.where((np.arange(3000) >= 1000) & (np.arange(3000) < 1300), 7.5, noise)
    assert stop_of(creep).length_s == pytest.approx(29.9)
    assert stop_of(creep, [(98, 131)]) is None
    assert stop_of(creep, [(10, 20), (98, 128)]) is None  # it drives off with it
    assert stop_of(creep, [(115, 131)])[3:] == pytest.approx((15.0, 1.0))
    dead = np.where((np.arange(3000) >= 2000) & (np.arange(3000) < 2200), 1.5, creep)  # behind a longer rest
    assert stop_of(dead, [(98, 131)])[:3] == pytest.approx((19.9, 200.0, 1.5))


def test_a_value_to_which_a_signal_comes_back_is_where_it_rests():
    noise = np.random.default_rng(0).normal(size=30_000)
    noise[1000:1300] = 2.0
    assert stop_of(noise) is not None
    for at in (5000, 9000, 13_000):
        noise[at : at + 30] = 2.0
    assert stop_of(noise) is None


@pytest.mark.parametrize("is_standing", [True, False])
def test_a_torque_of_a_car_that_stands(is_standing, tmp_path):
    x = drive(6000)
    torque = 50.0 + np.random.default_rng(2).normal(0.0, 5.0, 6000)
    torque[2000:4000] = 7.5
    if is_standing:
        x[:, 1:] *= np.interp(np.arange(6000), [0, 1500, 2000, 4000, 4500, 6000], [1, 1, 0, 0, 1, 1])[:, None]
    header = "t [s],omega_fl [rad/s],omega_fr [rad/s],v_x [m/s],Motor Torque"
    found, _ = kinds(tmp_path, table(np.column_stack([x, torque]), header=header))
    assert (("doubt", "frozen") in found) is not is_standing
    if not is_standing:
        told = found["doubt", "frozen"].what
        assert told == "stands at 7.5 for 20 s (from 20 s); elsewhere it changes in 100 % of the samples"


def test_nobody_saw_a_signal_stand_over_a_pause_or_at_a_stamp_from_elsewhere():
    values = np.random.default_rng(2).normal(7.0, 1.0, 600)
    values[300] = values[299]
    t_ns = np.arange(600, dtype=np.int64) * 10**8
    t_ns[300:] += 60 * 10**9
    assert longest_stop(t_ns, values) is None
    slow = np.arange(600, dtype=np.int64) * 2 * 10**9  # a slow channel has no pause between its samples
    values[300:310] = 7.5
    stop = longest_stop(slow, values)
    assert stop is not None
    assert stop.length_s == pytest.approx(18.0)


@pytest.mark.parametrize("is_found", [True, False])
def test_a_damaged_group_of_an_mdf_costs_that_group_only(tmp_path, capsys, monkeypatch, is_found):
    if not is_found:  # a group that cannot be decoded for any other reason
        monkeypatch.setattr("aqualog.io.mdf.reader.damaged_blocks", lambda *_: frozenset())
    t = np.arange(2000) * 0.01
    rng = np.random.default_rng(3)
    omega = {f"omega_{w}": ("rad/s", "", 60.0 + rng.normal(0.0, 0.1, t.size)) for w in ("fl", "fr", "rl", "rr")}
    other = {f"other_{k}": ("-", "", rng.normal(0.0, 1.0, t.size)) for k in range(4)}
    path = tmp_path / "drive.mf4"
    write_mf4(path, [MdfGroup("wheels", t, omega), MdfGroup("more", t, other)], None, "")
    data = bytearray(path.read_bytes())
    where = [m.start() for m in re.finditer(b"##DZ", data)][-1]
    data[where + 200 : where + 300] = bytes(100)
    path.write_bytes(data)
    found = examine([path], vehicle=CAR, signal_map=SignalMap())
    told = f"its DZ block at byte {where} is damaged" if is_found else "more.other_2 and 1 more: cannot be decoded"
    kind = "note" if is_found else "lost_group"
    (lost,) = (f for f in found.findings if f.kind == kind and told in f.what)
    assert lost.level == "lost"
    assert is_found == any(f.what == "2000 records could not be read" for f in found.findings)
    assert "spin_down" in found.ready
    for command in ("doctor", "inspect"):
        with pytest.raises(SystemExit) as leave:
            app([command, str(path)])
        assert leave.value.code == 3
        out = capsys.readouterr().out
        assert told in out
        assert "omega_rr" in out or command == "doctor"


def test_what_no_detector_can_work_with_says_what_to_try(tmp_path, capsys):
    path = tmp_path / "x.csv"
    path.write_text(table(drive()[:, [0, 3]], header="t [s],v_x [m/s]"))
    with pytest.raises(SystemExit):
        app(["doctor", str(path)])
    out = capsys.readouterr().out
    assert "no detector can run\n    try: `aqualog init LOG -o FOLDER`" in out
    (tmp_path / "map.toml").write_text('[signals]\nv_x = "v_x"\n')
    mapped = run("doctor", path, "--signals", tmp_path / "map.toml").stdout
    assert "no detector can run\n    try: `aqualog inspect LOG` lists what the log has" in mapped
    assert "resistance: missing torque of the driven wheels, vehicle.drivetrain, " in out


def test_a_mounting_names_its_file_once(tmp_path, capsys):
    path = tmp_path / "imu.csv"
    n = np.arange(300)
    rows = np.column_stack([n * 0.01, 9.8 + 0.01 * np.sin(n), np.sin(n), np.cos(n)])
    path.write_text(table(rows, header="t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]"))
    with pytest.raises(SystemExit):
        app(["doctor", str(path)])
    (line,) = (x for x in capsys.readouterr().out.splitlines() if "gravity is on x" in x)
    assert line.count("imu.csv") == 1


@pytest.mark.parametrize(("keep", "code"), [(1.0, 0), (0.5, 3), (0.0, 1)], ids=["sound", "cut in half", "empty"])
def test_exit_code_and_document(keep, code, tmp_path, capsys):
    data = (SAMPLES / "lane_drive.csv").read_bytes()
    path = tmp_path / "drive.csv"
    path.write_bytes(data[: int(keep * len(data)) - (7 if 0 < keep < 1 else 0)])
    with pytest.raises(SystemExit) as leave:
        app(["doctor", str(path), "--signals", str(SAMPLES / "map_csv.toml"), "--json"])
    document = json.loads(capsys.readouterr().out)
    assert leave.value.code == code
    assert document["healthy"] is (code == 0)
    assert {f["level"] for f in document["findings"]} >= ({"unreadable"} if code == 1 else {"lost"} if code else set())


@pytest.mark.parametrize(
    ("texts", "code"),
    [
        ({"a.csv": "t [s],temp [degC]\n0,1\n1,2\n2,3\n"}, 4),
        ({"a.csv": "t [s],temp [degC]\n0,1\n1,2\n2,3\n3"}, 3),
        ({"a.csv": "t [s],v_x [m/s]\n0,1\n1,2\n2,3\n", "b.csv": ""}, 3),
        ({"a.csv": "", "b.csv": ""}, 1),
    ],
    ids=["no signal", "a loss and no signal", "one of two", "none of two"],
)
def test_exit_codes_of_what_is_of_little_use(texts, code, tmp_path, capsys):
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(SystemExit) as leave:
        app(["doctor", *(str(tmp_path / n) for n in texts), "--json"])
    assert leave.value.code == code, capsys.readouterr().out
    document = json.loads(capsys.readouterr().out)
    assert document["healthy"] is (code == 4)


def test_a_loss_of_which_nothing_is_left_is_nothing_usable():
    lost = Finding("lost", "truncated", "a.mcap", "", "is cut off")
    none = Finding("doubt", "no_signals", "", "", "holds no channel")
    assert exit_code(Examination((FileState("a.mcap", "mcap", 100),), (lost, none))) == 4
    assert exit_code(Examination((FileState("a.mcap", "mcap", 100, 1, 7),), (lost, none))) == 3


def test_a_log_that_changes_while_it_is_looked_at_is_a_loss(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text(table(drive()))
    real = examination.load_signals

    def grows(paths, **kw):
        with path.open("a") as file:
            file.write("30.0,1,1,1\n")
        return real(paths, **kw)

    monkeypatch.setattr(examination, "load_signals", grows)
    found = examine([path], vehicle=CAR, signal_map=SignalMap())
    assert [(f.kind, f.file) for f in found.findings if f.kind == "changed"] == [("changed", "a.csv")]
    assert found.has_loss


@pytest.mark.parametrize("change", ["none", "frozen", "spike", "doubled", "cut", "no wheels", "no name"])
def test_doctor_and_detect_end_with_the_same_code(change, tmp_path):
    """3 where a log lost data; what is left out of a whole log is no loss."""
    x = drive()
    if change == "frozen":
        x[500:1900, 1] = x[500, 1]
    if change == "spike":
        x[700:720, 1] = 5000.0
    if change == "doubled":
        x = doubled(x)
    header = {"no wheels": "t [s],v_x [m/s],brake_pressure [bar],a_x [m/s^2]", "no name": "t [s],a,b,c"}
    path = tmp_path / "x.csv"
    path.write_text(table(x, **{"header": header[change]} if change in header else {}))
    if change == "cut":
        path = tmp_path / "x.mcap"
        whole = (SAMPLES / "lane_drive.mcap").read_bytes()
        path.write_bytes(whole[: len(whole) * 3 // 4])
    log = [path, "--signals", SAMPLES / "map_mcap.toml"] if change == "cut" else [path]
    codes = {name: run(name, *log).exit_code for name in ("doctor", "detect")}
    expected = {"doubled": 3, "cut": 3, "no wheels": 4, "no name": 4}.get(change, 0)
    assert codes == dict.fromkeys(codes, expected)
    document = json.loads(run("doctor", *log, "--json").stdout)
    assert document["healthy"] == (change in ("none", "no name"))
    assert change != "no name" or "`aqualog init LOG" in document["findings"][-1]["advice"]


def test_without_a_map_doctor_guesses_as_detect_does(tmp_path):
    rows = drive(4000)
    rows = np.column_stack([rows, rows[:, 1:3]])
    names = ["t [s]", "Wheel Speed FL [rad/s]", "Wheel Speed FR [rad/s]", "Speed [m/s]", "Wheel Speed RL [rad/s]",
             "Wheel Speed RR [rad/s]"]  # fmt: skip
    path = tmp_path / "x.csv"
    path.write_text(table(rows, header=",".join(names)))
    done = run("doctor", path, "--json")
    found = json.loads(done.stdout)
    assert done.exit_code == 0
    (guess,) = [f for f in found["findings"] if f["kind"] == "guessed"]
    assert guess["what"].startswith("no signal map: ")
    assert "omega_fl = Wheel Speed FL" in guess["what"]
    assert "aqualog init" in guess["advice"]
    assert "spin_down" in found["detectors"]["ready"]
    detected = json.loads(run("detect", path, "--json").stdout)
    assert any(n.startswith(guess["what"]) for n in detected["quality"]["notes"])


def test_a_drive_with_names_that_are_known_has_no_guess(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(table(drive()))
    assert not [f for f in json.loads(run("doctor", path, "--json").stdout)["findings"] if f["kind"] == "guessed"]


def test_clocks_that_disagree_are_answered_with_what_to_type(tmp_path):
    rng = np.random.default_rng(4)
    t = np.arange(4000) * 0.05
    v = 20.0 + np.convolve(rng.normal(0.0, 1.0, t.size + 200), np.hanning(201) / 12.0, mode="valid")
    wheels, gps = tmp_path / "wheels.csv", tmp_path / "my gps.csv"
    wheels.write_text(table(np.column_stack([t + 5.0, *[v / 0.317] * 2]), header=WHEELS))
    gps.write_text(table(np.column_stack([t + 5.7, v + rng.normal(0.0, 0.01, t.size)]), header="t [s],v_x [m/s]"))
    found = examine([wheels, gps], vehicle=CAR, signal_map=SignalMap())
    (told,) = [f for f in found.findings if f.kind == "offset"]
    typed = told.advice.split("`")[1]
    assert typed == f"aqualog align {wheels} '{gps}' --write-map map.toml"
    assert told.advice.endswith("then the command again with --signals map.toml")
    mapped = examine([wheels, gps], vehicle=CAR, signal_map=SignalMap(path="map.toml"))
    (told,) = [f for f in mapped.findings if f.kind == "offset"]
    assert "--signals map.toml --write-map clocks.toml" in told.advice
    dbc = tmp_path / "car.dbc"
    dbc.write_text('VERSION ""\nNS_ :\nBS_:\nBU_: A\n')
    (told,) = [
        f for f in examine([wheels, gps], vehicle=CAR, signal_map=SignalMap(), dbc=[dbc]).findings if f.kind == "offset"
    ]
    assert f"'{gps}' --dbc {dbc} --write-map map.toml" in told.advice
    assert run(*shlex.split(typed)[1:-1], tmp_path / "map.toml").exit_code == 0
    again = examine([wheels, gps], vehicle=CAR, signal_map=load_signal_map(tmp_path / "map.toml"))
    assert not [f for f in again.findings if f.kind == "offset"]


def test_a_log_without_any_number_says_of_which_channel(tmp_path):
    x = drive(500)
    x[:, 1:] = np.nan
    path = tmp_path / "x.csv"
    path.write_text(table(x))
    done = run("detect", path)
    assert done.exit_code == 4
    err = done.stderr
    assert "x.csv: no usable signal: " in err
    assert "omega_fl (x.csv:omega_fl [rad/s]): of 500 samples 500 no numbers" in err
    assert "aqualog inspect" in err


def test_a_wrong_name_in_a_map_has_its_line_and_what_the_log_has(tmp_path):
    path, signal_map = tmp_path / "x.csv", tmp_path / "map.toml"
    path.write_text(table(drive(500)))
    signal_map.write_text('[signals]\n# wheels\nomega_rl = "omega_f"\na_x = "Beschleunigung"\n')
    for name in ("detect", "doctor"):
        done = run(name, path, "--signals", signal_map)
        assert done.exit_code == 4
        assert 'line 3: omega_rl: no channel "omega_f" (nearest: "omega_f' in done.output
        assert 'line 4: a_x: no channel "Beschleunigung" in x.csv, which has omega_fl, omega_fr, v_x' in done.output
        assert "map.toml: line 3" in done.output
