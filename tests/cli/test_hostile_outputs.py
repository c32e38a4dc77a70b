"""Names that mean harm, in channels, units, groups, topics and file names, through what commands print and write."""

import csv
import io
import json
import re
from pathlib import Path

import asammdf
import numpy as np
import pytest
from typer.testing import CliRunner

from aqualog.cli.main import app
from aqualog.report.campaign.folder import safe_cell
from tests import commands
from tests.mcap_log import writing

CAR = Path(__file__).resolve().parents[2] / "sample_logs" / "vehicle.toml"
LONG = "y" * 100_000  # more than MOST
NAMES = {
    "markup": "</script><script>alert(1)</script><img src=x onerror=alert(1)>",
    "terminal": "[bold]red[/] \x1b[31mred\x1b[0m \x07 \u202eback\u2066 \x9b31m",
    "newline": "x\nerror: no such log\r\x1b]0;title\x07",
    "formula": '=cmd|" /C calc"!A0',
    "path": "../../x",
    "long": LONG,
}
OBEYED = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
MOST = 60_000  # characters that a command may print of a log with a few channels, whatever their names
N = 600


def columns():
    t = np.arange(N) / 100.0
    wheels = {f"omega_{w}": np.full(N, 80.0) + 0.1 * np.sin(t + i) for i, w in enumerate(("fl", "fr", "rl", "rr"))}
    return t, {"v_x": np.full(N, 25.0) + 0.01 * np.sin(t), "a_x": 0.01 * np.cos(t), **wheels}


def mf4(path, name):
    t, found = columns()
    log = asammdf.MDF(version="4.10")
    for symbol, x in found.items():
        own = name if symbol == "v_x" else symbol
        log.append(
            asammdf.Signal(x, t, name=own, unit="m/s" if symbol == "v_x" else ""), acq_name=name, common_timebase=True
        )  # fmt: skip
    log.append(asammdf.Signal(t, t, name=f"{name} too", unit=name[:200]), comment=name[:50])
    log.save(path, overwrite=True)
    log.close()


def table(path, name):
    t, found = columns()
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["t", *(name if s == "v_x" else s for s in found), f"{name} too"])
        writer.writerows([*row, 1] for row in zip(t, *found.values(), strict=True))


def mcap(path, name):
    t, found = columns()
    with writing(path) as writer:
        schema = writer.register_schema(name, "jsonschema", b'{"type": "object"}')
        topics = [writer.register_channel(topic, "json", schema) for topic in (f"/{name}", "car")]
        for i, second in enumerate(t):
            row = {s: float(x[i]) for s, x in found.items()}
            slow = {name: row.pop("v_x")}
            for topic, values in zip(topics, (slow, row), strict=True):
                ns = round(second * 1e9)
                if topic == topics[1] or i % 20 == 0:  # a long name is in every message
                    writer.add_message(topic, ns, json.dumps(values).encode(), ns)


REFUSED = {("terminal", ".csv"), ("newline", ".csv")}  # no text, by its control characters
MAKERS = {".mf4": mf4, ".csv": table, ".mcap": mcap}


def run(*arguments):
    """Exit code and what is printed, with what is wrong with it."""
    done = commands.run(*arguments)
    for text in (done.stdout, done.stderr):
        assert not OBEYED.search(text)
        assert not re.search(r"^error: no such log", text, re.MULTILINE)
    return done


def same_folder(folder, before):
    return sorted(p.name for p in folder.iterdir()) == sorted(before)


@pytest.mark.parametrize("suffix", MAKERS)
@pytest.mark.parametrize("kind", NAMES)
def test_commands_print_and_write_names_as_text(kind, suffix, tmp_path):
    work = tmp_path / "a" / "b" / "work"
    work.mkdir(parents=True)
    log = work / f"drive{suffix}"
    MAKERS[suffix](log, NAMES[kind])
    if (kind, suffix) in REFUSED:
        code, out, told = run("detect", log)
        assert (code, out) == (1, "")
        assert "unknown format" in told
        return
    for command in (["inspect"], ["doctor"]):
        code, out, told = run(*command, log)
        assert code in (0, 3, 4), (command, told)
        assert len(out) + len(told) < MOST, command
    found = json.loads(run("inspect", log, "--json")[1])["channels"]
    channel = next(c["path"] for c in found if NAMES[kind].strip() in c["path"])
    (work / "map.toml").write_text(f"[signals]\nv_x = {json.dumps(channel)}\n", encoding="utf-8")
    out = work / "out"
    code, text, told = run("detect", log, "--signals", work / "map.toml", "--vehicle", CAR, "-o", out, "-v")
    assert code in (0, 3), told
    assert len(text) + len(told) < MOST
    document = json.loads((out / "events.json").read_text(encoding="utf-8"))
    assert document["signals"]["v_x"]["channel"] == channel  # as the log has it, in data that programs read
    assert same_folder(out, ["events.json", "report.html", "signals.parquet"])
    written = work / "aligned.csv"
    assert run("convert", log, "--signals", work / "map.toml", "-o", written)[0] in (0, 3)
    assert not re.search(r"(^|[,;])[=@]", written.read_text(encoding="utf-8"), re.MULTILINE)
    assert same_folder(work, [log.name, "map.toml", "out", "aligned.csv"])
    assert same_folder(work.parent, ["work"])


@pytest.mark.parametrize("kind", ["markup", "terminal", "newline", "formula"])
def test_a_batch_takes_files_of_any_name(kind, tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    name = NAMES[kind].replace("/", "\u2215")
    mf4(logs / f"{name}.mf4", "v_x")
    (logs / f"{name} broken.mf4").write_bytes(b"MDF     4.10" + bytes(40))
    store = tmp_path / "store"
    code, out, told = run("batch", logs, "--vehicle", CAR, "-o", store, "--jobs", 1)
    assert code == 3, told
    assert len(out) + len(told) < MOST
    for path in store.rglob("*"):
        assert re.fullmatch(r"[\w.+-]+", path.name), path
    assert same_folder(tmp_path, ["logs", "store"])


def test_tables_hold_no_formulas():
    risky = ("=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", " =1", "x;=1", 'x"\t=1', "＝1+1")
    text = io.StringIO()
    csv.writer(text).writerows([safe_cell(c)] for c in risky)
    cells = re.split(r"[;\t\r\n]+", text.getvalue().replace('"', ""))
    assert not [c for c in cells if re.match(r"\s*[=+\-@＝]", c)]
    assert [safe_cell(c) for c in ("-1.5", "-", "a-b", "wet, 3 mm")] == ["-1.5", "-", "a-b", "wet, 3 mm"]


def test_a_link_that_leads_nowhere_is_not_replaced_without_force(tmp_path):
    table(tmp_path / "drive.csv", "v_x")
    (tmp_path / "out.csv").symlink_to(tmp_path / "nowhere" / "x.csv")
    result = CliRunner().invoke(app, ["convert", str(tmp_path / "drive.csv"), "-o", str(tmp_path / "out.csv")])
    assert result.exit_code == 2
    assert "out.csv: exists already" in result.stderr
    assert (tmp_path / "out.csv").is_symlink()
    (tmp_path / "out").symlink_to(tmp_path / "nowhere")
    result = CliRunner().invoke(app, ["detect", str(tmp_path / "drive.csv"), "-o", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert "expected a folder" in result.stderr
    assert not (tmp_path / "nowhere").exists()


def test_a_log_without_channels_says_what_was_left_out(tmp_path):
    with writing(tmp_path / "a.mcap", profile="ros2") as writer:
        schema = writer.register_schema("pkg/msg/A", "ros2msg", b"float64[1000000000] a\nfloat64 v_x\n")
        topic = writer.register_channel("/t", "cdr", schema)
        for i in range(20):
            writer.add_message(topic, i * 10**7, b"\0\1\0\0" + bytes(64), i * 10**7)
    result = CliRunner().invoke(app, ["detect", str(tmp_path / "a.mcap"), "--vehicle", str(CAR)])
    assert result.exit_code == 4
    assert "holds no channel (" in result.stderr
    assert "1000000000 elements" in result.stderr
