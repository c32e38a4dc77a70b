"""Campaign and labels files: what they say, and all that is wrong with them at once."""

from pathlib import Path

import pytest

from aqualog.campaign.definition import group_keys
from aqualog.config.campaign import load_campaign, read_campaign
from aqualog.config.labels import load_labels
from aqualog.core.errors import ConfigError
from aqualog.evaluate.labels import Label


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "car.toml").write_text('name = "car"\n')
    (tmp_path / "other.toml").write_text('name = "other"\n')
    (tmp_path / "map.toml").write_text("[signals]\n")
    (tmp_path / "lane.csv").write_text("start_s,end_s,effect,wheel\n")
    return tmp_path


def written(folder, text, runs=None):
    path = folder / "campaign.toml"
    path.write_text(text, encoding="utf-8")
    if runs is not None:
        (folder / "runs.csv").write_text(runs, encoding="utf-8")
    return path


HEAD = 'name = "wet lane"\nvehicle = "car.toml"\nsignals = "map.toml"\n'


def test_tables_and_a_csv_say_the_same(folder):
    tables = load_campaign(written(folder, HEAD + """
[[run]]
log = "logs/a.mf4"
tyre = "summer"
wear = "worn"
tread_depth_mm = 3
pressure_rear_bar = 1.9
water_depth_mm = 1.3
lane_start_s = 4.0
lane_end_s = 9.5
x_driver = "A"
[[run]]
log = "logs/b.mf4"
vehicle = "other.toml"
labels = "lane.csv"
"""))  # fmt: skip
    csv = load_campaign(written(folder, HEAD + 'runs = "runs.csv"\n', """\
log,tyre,wear,tread_depth_mm,pressure_rear_bar,water_depth_mm,lane_start_s,lane_end_s,x_driver,vehicle,labels
logs/a.mf4,summer,worn,3,1.9,1.3,4.0,9.5,A,,

logs/b.mf4,,,,,,,,,other.toml,lane.csv
"""))  # fmt: skip
    assert tables == csv
    first, second = tables.runs
    assert tables.name == "wet lane"
    assert tables.signals == folder / "map.toml"
    assert (first.logs, first.vehicle, first.labels) == ((folder / "logs/a.mf4",), folder / "car.toml", None)
    assert first.lane == (4.0, 9.5)
    assert first.values["tread_depth_mm"] == 3.0
    assert first.groups["x_driver"] == "A"
    assert first.groups["water_depth_mm"] == "1.3"
    assert (second.vehicle, second.labels, second.lane) == (folder / "other.toml", folder / "lane.csv", None)


def test_a_drive_of_several_files(folder):
    tables = load_campaign(written(folder, HEAD + '[[run]]\nlog = ["a.csv", "b.csv"]\n'))
    csv = load_campaign(written(folder, HEAD + 'runs = "runs.csv"\n', "log\na.csv; b.csv\n"))
    assert tables.runs[0].logs == csv.runs[0].logs == (folder / "a.csv", folder / "b.csv")
    assert "names no log" in faults(written(folder, HEAD + '[[run]]\nlog = ["a.csv", 3]\n'))


def faults(path):
    with pytest.raises(ConfigError) as caught:
        load_campaign(path)
    return str(caught.value)


def test_all_faults_of_the_tables_are_named_at_once(folder):
    text = faults(written(folder, """\
name = "x"
vehicel = "car.toml"
[[run]]
log = "a.mf4"
vehicle = "missing.toml"
tire = "summer"
tread_depth_mm = "deep"
[[run]]
log = "b.mf4"
vehicle = "car.toml"
wear = "used"
pressure_front_bar = 230
lane_start_s = 4.0
[[run]]
vehicle = "car.toml"
lane_start_s = 4.0
lane_end_s = 2.0
labels = "none.csv"
"""))  # fmt: skip
    for part in (
        'line 2: unknown key "vehicel" (did you mean "vehicle"?)', "line 5: vehicle = 'missing.toml'",
        'line 6: unknown key "tire" (did you mean "tyre"?)', "line 7: tread_depth_mm = 'deep' is not a number",
        "line 11: wear = 'used'", "line 12: pressure_front_bar = 230 is outside 0.2 ... 20 bar",
        "line 13: lane_start_s and lane_end_s go together", "a run names no log", "line 18: labels = 'none.csv'",
    ):  # fmt: skip
        assert part in text, text
    assert text.count("campaign.toml") == 1


def test_all_faults_of_the_csv_are_named_with_those_of_the_file(folder):
    text = faults(written(folder, 'nam = "x"\nruns = "runs.csv"\nvehicle = "gone.toml"\n', """\
log,tyer,water_depth_mm,x_free
a.mf4,s,thick,1
,s,1,1
b.mf4,s,1
c.mf4,s,999,1
"""))  # fmt: skip
    for part in (
        'unknown key "nam"', "vehicle = 'gone.toml'", "runs.csv", 'line 1: unknown column "tyer" (did you mean "tyre"?)',
        "line 2: water_depth_mm = 'thick' is not a number", "line 3: a run names no log", "line 4: 3 cells",
        "line 5: water_depth_mm = 999 is outside",
    ):  # fmt: skip
        assert part in text, text


@pytest.mark.parametrize(
    ("text", "part"),
    [('vehicle = "car.toml"\n', "no runs"),
     ('vehicle = "car.toml"\nruns = "runs.csv"\n[[run]]\nlog = "a"\n', "both [[run]] and runs"),
     ('vehicle = "car.toml"\nruns = 3\n', "runs = '3' is not a text"),
     ('vehicle = "car.toml"\nrun = 3\n', "run is not a list"), ('[[run]]\nlog = "a.mf4"\n', "no vehicle"),
     ('vehicle = "car.toml"\nruns = "empty.csv"\n', "no run in it"),
     ('vehicle = "car.toml"\nruns = "gone.csv"\n', "gone.csv: table of runs not found"),
     ("run = [\n", "not valid TOML")],
)  # fmt: skip
def test_what_is_no_campaign_is_told(folder, text, part):
    (folder / "empty.csv").write_text("log,tyre\n\n")
    assert part in faults(written(folder, text))


def test_many_faults_are_counted(folder):
    rows = "".join(f"a{i}.mf4,thick{i}\n" for i in range(50))
    text = faults(written(folder, HEAD + 'runs = "runs.csv"\n', "log,water_depth_mm\n" + rows))
    assert text.count("is not a number") == 20
    assert "and 30 more" in text


def test_group_names():
    known = ("tyre", "water_depth_mm", "pressure_front_bar", "pressure_rear_bar", "x_driver")
    assert group_keys(["tyre", "depth", "x_driver"], known) == ("tyre", "water_depth_mm", "x_driver")
    assert group_keys(["pressure", "water-depth"], known) == (
        "pressure_front_bar",
        "pressure_rear_bar",
        "water_depth_mm",
    )
    with pytest.raises(ConfigError, match=r'"tyres" \(did you mean "tyre"\?\), "load"'):
        group_keys(["tyres", "load"], known)


def labels(tmp_path, text):
    path = Path(tmp_path) / "labels.csv"
    path.write_text(text, encoding="utf-8")
    return load_labels(path)


def test_labels_file(tmp_path):
    got = labels(
        tmp_path, "start_s, end_s,effect,wheel\n1.0,2.5,full,fl\n2.0,3.0,full,fl\n\n 5, 6 ,snow,\n-1,4,water,\n"
    )
    assert got == (
        Label(1.0, 3.0, "full", "fl"),
        Label(5.0, 6.0, "snow"),
        Label(0.0, 4.0, "water"),
        Label(1.0, 3.0, "partial", "fl"),
    )
    assert labels(tmp_path, "start_s,end_s,effect,wheel\n") == ()
    assert labels(tmp_path, "effect,start_s,end_s\nwater,1,2\n") == (Label(1.0, 2.0, "water"),)


def test_all_faults_of_a_labels_file_are_named_at_once(tmp_path):
    with pytest.raises(ConfigError) as caught:
        labels(tmp_path, "start_s,end_s,effect,wheel\n1,x,full,fl\n3,2,full,fl\n1,2,full,front\n1,2,,\n1,2,3,4,5\n")
    text = str(caught.value)
    for part in ("line 2: end_s = 'x'", "line 3: end_s = 2 is not after", 'unknown wheel "front"', "line 5: no effect",
                 "line 6: 5 cells"):  # fmt: skip
        assert part in text
    with pytest.raises(ConfigError, match="no column end_s"):
        labels(tmp_path, "start_s,end,effect\n")
    with pytest.raises(ConfigError, match="no column start_s"):
        labels(tmp_path, "")


def partial(tmp_path, lines):
    return [x for x in labels(tmp_path, "start_s,end_s,effect,wheel\n" + lines) if x.effect == "partial"]


def test_full_aquaplaning_is_partial_too(tmp_path):
    assert partial(tmp_path, "1,2,full,fl\n4,5,full,\n") == [
        Label(1.0, 2.0, "partial", "fl"),
        Label(4.0, 5.0, "partial"),
    ]
    # a partial label on both sides of a full one: one episode, as the truth has it
    assert partial(tmp_path, "1,2,partial,fl\n2,3,full,fl\n3,4,partial,fl\n") == [Label(1.0, 4.0, "partial", "fl")]
    # partial labels of the car alone do not become labels of some wheels
    assert partial(tmp_path, "1,4,partial,\n2,3,full,fl\n") == [Label(1.0, 4.0, "partial")]
    assert partial(tmp_path, "2,3,water,\n") == []


@pytest.mark.parametrize(
    ("text", "parts"),
    [("start_s,end_s,effect\n1,2,water\n-5,-1,water\n-5,0,water\n", ("line 3: end_s = -1 is not", "line 4: end_s = 0 is")),
     ("start_s,end_s,effect,end_s\n1,2,water,3\n", ("line 1: column end_s stands twice",)),
     ("start_s;end_s;effect;wheel\n1;2;water;\n", ("line 1: labels file has semicolons", "expected commas")),
     ("1,0;2,0;water;\n", ("labels file has semicolons", "points in numbers")),
     ("start_s\tend_s\teffect\n1\t2\twater\n", ("labels file has tabs",)),
     ("1.0,2.0,water,\n", ("labels file has no heading; expected start_s,end_s,effect,wheel",)),
     ("start_s,end_s,effect,wheel\n1,2,full,front\n", ('unknown wheel "front"; expected fl, fr, rl, rr',))],
)  # fmt: skip
def test_faults_of_labels_are_told_once(tmp_path, text, parts):
    with pytest.raises(ConfigError) as caught:
        labels(tmp_path, text)
    told = str(caught.value)
    for part in parts:
        assert part in told, told
    assert told.count("line 1") <= 1
    assert "did you mean" not in told


PLAIN = "log,tyre,pressure_rear_bar,lane_start_s,lane_end_s,x_driver\na.mf4,s,1.9,1,2.5,Jörg\nb.mf4,,,,,\n"
GERMAN = PLAIN.replace(",", ";").replace("1.9", "1,9").replace("2.5", "2,5")


@pytest.mark.parametrize(
    "data",
    [
        GERMAN.encode(),
        GERMAN.replace("\n", "\r\n").encode("utf-8-sig"),
        GERMAN.encode("cp1252"),
        GERMAN.replace(";", "\t").encode("utf-16"),
        ("sep=;\r\n" + GERMAN).encode(),
        GERMAN.replace("\n", ";;\n").encode(),
        GERMAN.replace("1,9", "1.9").replace("2,5", "2.5").encode(),
        PLAIN.replace("1.9", '"1,9"').replace("2.5", '"2,5"').encode(),
        ("\n" + PLAIN + ",,,,,\n\n").encode(),
    ],
    ids=[
        "german",
        "mark",
        "code page",
        "utf-16 tabs",
        "sep=",
        "cells behind",
        "points",
        "quoted commas",
        "blank lines",
    ],
)
def test_tables_of_spreadsheets_say_the_same(folder, data):
    path = written(folder, HEAD + 'runs = "runs.csv"\n', PLAIN)
    expected = load_campaign(path)
    (folder / "runs.csv").write_bytes(data)
    assert load_campaign(path) == expected
    assert expected.runs[0].values["pressure_rear_bar"] == 1.9
    assert expected.runs[0].values["x_driver"] == "Jörg"


@pytest.mark.parametrize(
    ("table", "parts"),
    [("log;pressure_rear_bar\na;1,9\nb;2.2\n", ["some numbers have a decimal comma, others a point"]),
     ('log,load_rear_kg\na,"1,200"\n', ["some numbers have a decimal comma"]),
     ("log,pressure_rear_bar\na,1,9\n", ["line 2: 3 cells, the heading has 2 (a decimal comma?"]),
     ("log,pressure_rear_bar\na,1.9 bar\n", ["'1.9 bar' is not a number (in bar, without the unit)"]),
     ("log,load_rear_kg\na,1_9\n", ["'1_9' is not a number"]),
     ("log,load_rear_kg\na,inf\n", ["outside -5000 ... 50000 kg"]),
     ("LOG,Tyre\na,s\n", ['unknown column "LOG" (did you mean "log"?)', 'unknown column "Tyre"', "no column log"]),
     ("log,zzz\na,1\n", ['unknown column "zzz" (columns of your own begin with x_)']),
     ("log,labels\na,lanes.csv\n", ['there is no such file (did you mean "lane.csv"?)']),
     ("log,labels\na,.\n", ["'.': is a folder; a file is needed"]),
     ("log,,tyre\na,1,s\n", ["line 1: column 2 has no name"]),
     ("log,x_,tyre\na,1,s\n", ["column x_ has no name behind x_"]),
     ("log,tyre,tyre\na,1,s\n", ["column tyre stands twice"]),
     ('log,x_a\n"a\n.mf4",1\nb.mf4,2,3\n', ["line 2: log = ", "line 4: 3 cells"]), ('log\n"a\n', ["is not CSV"]),
     ("PK\x03\x04", ["is a spreadsheet"]), ("log\n\0\n", ["is not text"]),
     ("log,tyre\na,Worn_Summer\nb,worn_summer\nc,worn_summer\nd,worn summer\ne,Worn_Summer\nf,Q 1-1\ng,Q-11\nh,worn_summer\ni,\n",
      ["lines 2, 6: tyre = 'Worn_Summer': another tyre differs in case, blanks or hyphens only (did you mean "
       '"worn_summer"?); line 5: tyre = \'worn summer\': another tyre differs in case, blanks or hyphens only (']),
     ("log,lane_start_s,lane_end_s\na,-9,-1\n", ["lane_end_s = -1 is before the log's first sample"])],
)  # fmt: skip
def test_faults_of_tables(folder, table, parts):
    text = faults(written(folder, HEAD + 'runs = "runs.csv"\n', table))
    for part in parts:
        assert part in text, text


def test_the_files_that_a_campaign_names_are_checked_with_it(folder):
    (folder / "bad.toml").write_text("mas = 1500.0\n")
    (folder / "bad_map.toml").write_text('[signals]\nomega_f = { channel = "x" }\n')
    (folder / "bad.csv").write_text("start_s,end_s,effect\n2,1,water\n")
    text = faults(written(folder, """\
vehicle = "bad.toml"
signals = "bad_map.toml"
runs = "runs.csv"
""", "log,labels,vehicle\na.mf4,bad.csv,bad.toml\nb.mf4,bad.csv,gone.toml\nc.mf4,,gone.toml\n"))  # fmt: skip
    for part in (
        'line 1: vehicle = \'bad.toml\'', 'unknown key "mas" (did you mean "mass"?)', "line 2: signals =",
        'unknown key "omega_f"', "line 2: labels = 'bad.csv'", "end_s = 1 is not after", "line 3: vehicle = 'gone.toml'",
    ):  # fmt: skip
        assert part in text, text
    # each file's faults stand once, where it is named first
    assert text.count("bad.csv'") == text.count('unknown key "mas"') == text.count("gone.toml") == 1


def test_text_in_place_of_numbers_and_paths_of_windows(folder):
    (folder / "logs").mkdir()
    (folder / "logs" / "a.mf4").write_text("")
    text = faults(written(folder, HEAD + '[[run]]\nlog = "logs\\temp.mf4"\npressure_rear_bar = "1,9"\n'))
    assert "a \\ in quotes is an escape, write / in paths" in text
    assert 'line 6: pressure_rear_bar = "1,9" is a text, not a number' in text
    assert "Try: / in place of \\ in paths" in faults(written(folder, HEAD + '[[run]]\nlog = "D:\\logs\\a.mf4"\n'))
    table = load_campaign(written(folder, HEAD + 'runs = "runs.csv"\n', "log\nlogs\\a.mf4\n"))
    assert table.runs[0].logs == (folder / "logs/a.mf4",)


@pytest.mark.parametrize(
    ("log", "part"),
    [("*.mf4", "is a pattern; a run names its files one by one"), ("@list.txt", "is a list"),
     ("logs", "is a folder without a ROS 2 bag"),
     ("x/a.csv;y/a.csv", "two files of one drive are both called 'a.csv'"), (";", "a run names no log")],
)  # fmt: skip
def test_names_that_are_no_logs(folder, log, part):
    (folder / "logs").mkdir()
    assert part in faults(written(folder, HEAD + 'runs = "runs.csv"\n', f"log\n{log}\n"))
    assert part in faults(written(folder, HEAD + f'[[run]]\nlog = "{log}"\n'))


def test_a_drive_counts_once(folder):
    def told(rows):
        return written(folder, HEAD + 'runs = "runs.csv"\n', "log,lane_start_s,lane_end_s\n" + rows)

    assert "line 3: log 'a.mf4' stands in runs.csv: line 2 too" in faults(told("a.mf4,,\n./a.mf4,,\n"))
    assert "stands in runs.csv: line 2 too" in faults(told("a.mf4,1,2\na.mf4,,\n"))
    assert "line 3: log 'a.csv' stands" in faults(told("a.csv;b.csv,,\nb.csv;a.csv,,\n"))
    assert "line 2: the lane overlaps with that in runs.csv: line 3" in faults(told("a.mf4,3,6\na.mf4,1,4\n"))
    assert len(load_campaign(told("a.mf4,4,6\na.mf4,1,4\n")).runs) == 2
    # one GNSS log of a day may stand in many drives
    assert len(load_campaign(told("a.csv;day.csv,,\nb.csv;day.csv,,\n")).runs) == 2
    text = faults(written(folder, HEAD + '[[run]]\nlog = "a.mf4"\n[[run]]\nlog = "a.mf4"\n'))
    assert "line 7: log 'a.mf4' stands in campaign.toml: line 4 too" in text


def test_where_runs_stand_and_values_of_keys_of_ones_own(folder):
    read = read_campaign(
        written(folder, HEAD + '[[run]]\nlog = "a"\nx_v = 60.0\nx_d = 2024-05-01\n[[run]]\nlog = "b"\n')
    )
    assert read.places == ("campaign.toml: line 4", "campaign.toml: line 8")
    assert read.campaign.runs[0].values == {"x_v": "60", "x_d": "2024-05-01"}
    read = read_campaign(written(folder, HEAD + 'runs = "runs.csv"\n', "log,x_a\n\na,1\nb,2\n"))
    assert read.places == ("runs.csv: line 3", "runs.csv: line 4")
