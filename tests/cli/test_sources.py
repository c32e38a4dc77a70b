"""What a command reads is not written over, not even by force; no two results have one name."""

import os

import pytest
from typer.testing import CliRunner

from aqualog.cli.main import app
from aqualog.core.errors import ConfigError
from aqualog.face import arguments as files
from aqualog.face.arguments import expand, refuse_existing
from tests.commands import run

LABELS = "start_s,end_s,effect,wheel\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "car.toml": 'name = "car"\n', "map.toml": "[signals]\n", "other.toml": "[signals]\n", "bus.dbc": 'VERSION ""\n',
        "lane.csv": LABELS, "a.csv": "t [s],v_x [m/s]\n0,1\n", "logs.txt": "a.csv\n", "runs.csv": "log,labels\na.csv,lane.csv\n",
        "campaign.toml": 'vehicle = "car.toml"\nsignals = "map.toml"\nruns = "runs.csv"\n', "labels/a.csv": LABELS,
        "labels/b.csv": LABELS, "slopes.json": '{"schema_version": 1, "slip_slope_history": {}}',
    }.items():  # fmt: skip
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def refused(args, said):
    result = run(*args, "--force")
    assert result.exit_code == 2, result.stderr
    assert result.stderr.count("error:") == 1
    assert said in result.stderr
    return result.stderr


CAMPAIGN = ("evaluate", "campaign.toml", "--signals", "other.toml", "--dbc", "bus.dbc")
LOGS = ("evaluate", "@logs.txt", "--vehicle", "car.toml", "--signals", "map.toml", "--dbc", "bus.dbc")


@pytest.mark.parametrize(
    "target", ["campaign.toml", "runs.csv", "lane.csv", "car.toml", "a.csv", "other.toml", "bus.dbc"]
)
@pytest.mark.parametrize("option", ["-o", "--tune"])
def test_sources_of_a_campaign(folder, target, option):
    before = (folder / target).read_bytes()
    refused([*CAMPAIGN, option, target], "source of this very run")
    assert (folder / target).read_bytes() == before


def test_signal_map_of_the_campaign_itself(folder):
    refused(["evaluate", "campaign.toml", "-o", "map.toml"], "source of this very run")


@pytest.mark.parametrize(
    "target", ["logs.txt", "a.csv", "car.toml", "map.toml", "bus.dbc", "labels/a.csv", "labels/b.csv"]
)
def test_sources_of_logs(folder, target):
    refused([*LOGS, "--labels", "labels", "-o", target], "source of this very run")


@pytest.mark.parametrize(
    "args",
    [
        ("calibrate", "@logs.txt", "--vehicle", "car.toml", "-o", "logs.txt"),
        ("calibrate", "@logs.txt", "--vehicle", "car.toml", "--page", "logs.txt"),
        ("inspect", "@logs.txt", "--write-map", "logs.txt"),
    ],
)
def test_a_list_is_a_source_as_its_logs_are(folder, args):
    refused(args, "source of this very run")
    assert (folder / "logs.txt").read_text() == "a.csv\n"


@pytest.mark.parametrize("args", [("@slopes.json",), ("a.csv", "--dbc", "slopes.json")])
def test_a_history_is_no_source(folder, args):
    refused(["detect", *args, "--history", "slopes.json"], "source of this very run")


@pytest.mark.parametrize(
    "args",
    [
        ("calibrate", "a.csv", "--vehicle", "car.toml", "-o", "x.html", "--page", "./x.html"),
        ("evaluate", "campaign.toml", "--tune", "x.html", "-o", "x.html"),
        ("detect", "a.csv", "-o", "out", "--write", "out/signals.parquet"),
    ],
)
def test_two_results_of_one_name(folder, args):
    refused(args, "named for two results")
    assert not (folder / "x.html").exists()
    assert not (folder / "out").exists()


def test_two_names_of_one_result_behind_a_link(folder):
    (folder / "link").symlink_to(folder / "x")
    with pytest.raises(ConfigError, match="two results"):
        refuse_existing([folder / "x", folder / "link"], force=True)
    refuse_existing([folder / "x", folder / "y"], force=True)


def test_files_of_a_folder_that_is_one_log(folder):
    with pytest.raises(ConfigError, match="source"):
        refuse_existing([folder / "labels" / "a.csv"], force=True, sources=[folder / "labels"])


@pytest.mark.parametrize(
    ("args", "named"),
    [
        (("detect", "a.csv", "-o", ""), "-o"),
        (("detect", "a.csv", "--write", " "), "--write"),
        (("detect", "a.csv", "--out="), "--out"),
        (("convert", "-o", "", "a.csv"), "-o"),
        (("batch", "a.csv", "--vehicle", "", "-o", "s"), "--vehicle"),
        (("campaign", "init", "logs", "-o", ""), "-o"),
        (("campaign", "init", ""), "a name"),
    ],
)
def test_an_empty_result_is_not_the_folder_one_is_in(folder, args, named):
    before = sorted(folder.rglob("*"))
    result = CliRunner().invoke(app, args)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {named} is empty; expected a f")
    assert result.stderr.count("\n") == 1
    assert sorted(folder.rglob("*")) == before


def test_an_empty_text_is_no_name(folder):
    result = run("detect", "a.csv", "--configuration", "", "--vehicle", "none.toml")
    assert "none.toml: vehicle file not found" in result.stderr


@pytest.mark.parametrize("command", ["detect", "batch", "inspect"])
def test_an_empty_name_is_not_the_folder_one_is_in(folder, command):
    result = CliRunner().invoke(
        app, [command, "", *(("--vehicle", "car.toml", "-o", "s") if command == "batch" else ())]
    )
    assert result.exit_code == 2
    assert "a name is empty" in result.stderr


def test_lists_without_an_end(folder, monkeypatch):
    os.mkfifo(folder / "pipe")
    for name in ("@pipe", "@/dev/zero", "@/dev/null"):
        with pytest.raises(ConfigError, match="is a device or a pipe"):
            expand([name])
    monkeypatch.setattr(files, "_LARGEST_LIST", 10)
    (folder / "long.txt").write_text("a.csv\n" * 3)
    with pytest.raises(ConfigError, match="list of logs is larger"):
        expand(["@long.txt"])


def test_a_list_from_the_shell_may_come_through_a_pipe(folder):
    out, into = os.pipe()
    os.write(into, f"{folder / 'a.csv'}\n".encode())
    os.close(into)
    assert expand([f"@/dev/fd/{out}"]) == [folder / "a.csv"]
    os.close(out)
