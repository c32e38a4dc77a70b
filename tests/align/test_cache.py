"""Signals that were kept are those that were read, to the bit; and whatever is wrong with the folder costs time only."""

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest
from typer.testing import CliRunner

import aqualog
from aqualog.align import cache as module
from aqualog.align import load
from aqualog.align.cache import SignalCache
from aqualog.align.load import load_signals
from aqualog.align.mapping import SignalMap, SourceClock
from aqualog.align.signals_file import from_parquet, to_parquet
from aqualog.cli.main import app
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.records import Origin, Quality, Signals, TimeFaults
from tests.conftest import ROOT

SAMPLES = ROOT / "sample_logs"
CAR = load_vehicle(SAMPLES / "vehicle.toml")
MAPS = {".csv": SAMPLES / "map_csv.toml", ".mcap": SAMPLES / "map_mcap.toml"}
LOGS = [SAMPLES / f"lane_drive{s}" for s in (".mf4", ".csv", ".mcap")]
READ = (load, "read_signals")


@pytest.fixture
def log(tmp_path):
    return Path(shutil.copy(SAMPLES / "lane_drive.parquet", tmp_path / "drive.parquet"))


@pytest.fixture
def place(tmp_path):
    return SignalCache(tmp_path / "cache", limit=10**9)


@pytest.fixture
def not_read(monkeypatch):
    """After it is called, whoever reads a log fails."""
    return lambda: monkeypatch.setattr(*READ, lambda *_, **__: pytest.fail("read again"))


def run(*arguments, **environment):
    env = {"AQUALOG_CACHE": None, "AQUALOG_CACHE_MB": None, **environment}
    return CliRunner().invoke(app, [str(a) for a in arguments], env=env)


def assert_same(a: Signals, b: Signals):
    assert a.frame.schema == b.frame.schema
    assert a.frame.equals(b.frame, null_equal=True)
    assert not any(s.is_nan().any() for s in b.frame.select(pl.col(pl.Float64)))  # else equal would not mean the same
    assert a.frame.null_count().equals(b.frame.null_count())
    assert (a.dt_ns, a.start_ns, a.origins, a.quality, a.files) == (b.dt_ns, b.start_ns, b.origins, b.quality, b.files)
    assert list(a.origins) == list(b.origins)


@pytest.mark.parametrize("path", LOGS, ids=lambda p: p.suffix[1:])
def test_signals_are_the_same_to_the_bit(path, place, not_read):
    given = {"vehicle": CAR, "signal_map": load_signal_map(MAPS[path.suffix]) if path.suffix in MAPS else None}
    plain = load_signals([path], **given)
    assert_same(plain, load_signals([path], **given, cache=place))
    not_read()
    assert_same(plain, load_signals([path], **given, cache=place))


def test_document_is_the_same_and_a_hit_imports_no_reader(tmp_path):
    path = SAMPLES / "lane_drive.csv"
    given = ["detect", path, "--vehicle", SAMPLES / "vehicle.toml", "--json", "--signals", MAPS[".csv"]]
    plain, first = run(*given), run(*given, "--cache", AQUALOG_CACHE=str(tmp_path))
    code = (
        f"import sys; sys.argv = ['aqualog', *{[str(a) for a in given]!r}]\nfrom aqualog.cli.main import run\n"
        "try:\n    run()\nexcept SystemExit:\n    pass\nprint('LOADED', *sys.modules)"
    )
    env = {**os.environ, "AQUALOG_CACHE": str(tmp_path)}
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env).stdout
    hit, loaded = out.split("LOADED")
    assert plain.exit_code == 0
    assert plain.stdout == first.stdout == hit
    assert not {"asammdf", "mcap", "rosbags", "pandas", "aqualog.io.tables.csv"} & set(loaded.split())


def test_nulls_faults_and_notes_survive():
    faults = TimeFaults(1, 2, 3, 4, 5)
    origin = Origin("a_x", "ESP [1]", "ä.csv", "g", 99.98999999999999, 7, 1, 2, 3, 1 / 3, faults)
    frame = pl.DataFrame({"t": [0.0, 0.01, 0.02], "a_x": [None, -0.0, 5e-324], "on_water": [True, None, False]})
    quality = Quality(9, 8, True, 7, faults, ('says "so"', "zwei\nZeilen"))
    signals = Signals(frame, 10_000_000, -(2**62) - 1, {"a_x": origin}, quality, ("ä.csv",))
    again = from_parquet(to_parquet(signals).getvalue())
    assert_same(signals, again)
    assert str(again.frame["a_x"][1]) == "-0.0"


def test_key_holds_all_that_signals_depend_on(log, place, monkeypatch):
    def key(paths=(log,), car=CAR, signal_map=None, dbc=(), rate=None):
        return place.key(paths, car, signal_map or SignalMap(), dbc, rate).text

    base = key()
    assert key() == base
    assert key(car=replace(CAR, mass=9.0, name="another")) == base  # nothing that alignment asks for
    two = [SignalMap(clocks={k: SourceClock(i) for i, k in enumerate(order)}) for order in (("*", "d*"), ("d*", "*"))]
    others = {
        key(car=replace(CAR, **{n: 1.01 * getattr(CAR, n)}))
        for n in ("r_e_f", "r_e_r", "steering_ratio", "torque_gain")
    } | {key(rate=50.0), key(dbc=(log,)), key(paths=(log, log)), *(key(signal_map=m) for m in two)}
    assert len(others - {base}) == 9
    named = Path(shutil.copy(log, log.parent / "named.parquet"))
    assert key(paths=[named]) != base  # a map may ask for names
    (log.parent / "elsewhere").mkdir()
    assert key(paths=[Path(shutil.copy(log, log.parent / "elsewhere"))]) == base
    monkeypatch.setattr(module, "_stamp", lambda: "00000000")
    assert key() != base


def test_every_source_behind_signals_is_in_the_key():
    code = (
        "import sys; from pathlib import Path; from aqualog.align.load import load_signals\n"
        "from aqualog.core.vehicle import Vehicle\n"
        f"load_signals([Path({str(LOGS[0])!r})], vehicle=Vehicle())\n"
        "print(*(m for m in sys.modules if m.startswith('aqualog')))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    loaded = {m.removeprefix("aqualog").removeprefix(".").replace(".", "/") for m in out.split()} - {""}
    assert len(loaded) > 15
    assert not {m for m in loaded if m.split("/")[0] not in module._BEHIND and f"{m}.py" not in module._BEHIND}
    package = Path(aqualog.__file__).parent
    assert all((package / name).exists() for name in module._BEHIND)


def test_a_log_that_changes_is_read_again_even_at_once(log, place):
    old = load_signals([log], vehicle=CAR, cache=place)
    stat = log.stat()
    frame = pl.read_parquet(log)
    frame.head(frame.height // 2).write_parquet(log)
    os.utime(log, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert load_signals([log], vehicle=CAR, cache=place).frame.height < old.frame.height
    # a clock of the file system that is too coarse to tell: size and time of change stay
    os.utime(log, (2e10, 2e10))
    load_signals([log], vehicle=CAR, cache=place)
    log.write_bytes(log.read_bytes()[::-1])
    os.utime(log, (2e10, 2e10))
    with pytest.raises(Exception, match="drive"):
        load_signals([log], vehicle=CAR, cache=place)


def test_hashes_of_settled_logs_are_kept_and_those_of_young_ones_not(log, place):
    load_signals([log], vehicle=CAR, cache=place)
    hashes = place.folder / "contents.json"
    assert json.loads(hashes.read_text()) == {}
    os.utime(log, (1e9, 1e9))
    load_signals([log], vehicle=CAR, cache=place)
    assert list(json.loads(hashes.read_text())) == [os.path.realpath(log)]


def test_what_is_not_kept(log, place, monkeypatch):
    """Some signals only; a note that names a folder; more than the limit; a log that changes while it is read."""
    signals = load_signals([log], vehicle=CAR, wanted=lambda s: s.startswith("omega_"), cache=place)
    assert set(signals.symbols) == {f"omega_{w}" for w in ("fl", "fr", "rl", "rr")}
    real, told = load_signals([log], vehicle=CAR), []
    noted = replace(real, quality=replace(real.quality, notes=(f"a split is left out: {log}: is cut",)))
    monkeypatch.setattr(*READ, lambda *_, **__: noted)
    load_signals([log], vehicle=CAR, cache=place)
    monkeypatch.setattr(*READ, lambda *_, **__: real)
    load_signals([log], vehicle=CAR, cache=SignalCache(place.folder.parent, limit=1000, tell=told.append))
    assert "not kept" in told[0]
    monkeypatch.setattr(*READ, lambda *_, **__: (log.write_bytes(b"x"), real)[1])
    load_signals([log], vehicle=CAR, cache=place)
    assert place.kept() == []


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 4
    path.write_bytes(data)


@pytest.mark.parametrize(
    "spoil",
    [flip, lambda p: p.write_bytes(p.read_bytes()[:-100]), lambda p: p.write_bytes(b"")],
    ids=["a bit", "cut", "empty"],
)
def test_a_damaged_entry_is_thrown_away_and_made_again(spoil, log, place):
    plain = load_signals([log], vehicle=CAR, cache=place)
    assert os.name == "nt" or place.folder.stat().st_mode & 0o777 == 0o700  # for the user alone
    (entry,) = place.kept()
    whole = entry.path.read_bytes()
    spoil(entry.path)
    assert_same(plain, load_signals([log], vehicle=CAR, cache=place))
    assert entry.path.read_bytes() == whole


def test_an_entry_without_records_is_a_miss(log, place):
    plain = load_signals([log], vehicle=CAR, cache=place)
    (entry,) = place.kept()
    entry.path.unlink()
    plain.frame.write_parquet(entry.path)
    check = module._check(entry.path.read_bytes())
    strange = entry.path.rename(entry.path.with_name(entry.path.name[:-16] + f"{check}.parquet"))
    assert_same(plain, load_signals([log], vehicle=CAR, cache=place))
    assert not strange.exists()


@pytest.mark.parametrize("make", [os.mkfifo, lambda p: p.symlink_to("/dev/zero")], ids=["pipe", "device"])
def test_what_has_no_end_is_not_read(make, log, place):
    plain = load_signals([log], vehicle=CAR, cache=place)
    (entry,) = place.kept()
    for path in (entry.path, place.folder / "contents.json"):
        path.unlink(missing_ok=True)
        make(path)
    assert place.kept() == []
    assert_same(plain, load_signals([log], vehicle=CAR, cache=place))
    assert len(place.kept()) == 1


@pytest.mark.parametrize("known", ["", "[" * 100_000, "[1]", '{"a": 1}', '{"a": [1, 2, 3]}'])
def test_hashes_that_are_none_are_not_believed(known, log, place):
    place.folder.mkdir(parents=True)
    (place.folder / "contents.json").write_text(known)
    load_signals([log], vehicle=CAR, cache=place)
    assert len(place.kept()) == 1


def test_a_folder_that_cannot_be_made_is_told_with_v_or_where_it_is_asked_for(log, tmp_path):
    (tmp_path / "file").write_text("")
    given = ["slip-slope", log, "--vehicle", SAMPLES / "vehicle.toml", "--json"]
    plain = run(*given)
    for more in ([], ["-v"], ["--cache"]):
        result = run(*given, *more, AQUALOG_CACHE=str(tmp_path / "file" / "below"))
        assert (result.exit_code, result.stdout) == (plain.exit_code, plain.stdout)
        assert ("cannot be written" in result.stderr) == bool(more)


def test_least_used_goes_first_and_the_limit_holds(log, place, monkeypatch):
    real = load_signals([log], vehicle=CAR)
    size = to_parquet(real).getbuffer().nbytes
    small = SignalCache(place.folder.parent, limit=int(2.5 * size))
    monkeypatch.setattr(*READ, lambda *_, **__: real)
    for age, rate in enumerate((10.0, 20.0)):
        load_signals([log], vehicle=CAR, rate_hz=rate, cache=small)
        for entry in small.kept():
            if entry.used > 1e9 + 10:
                os.utime(entry.path, (1e9 + age, 1e9 + age))
    old, new = small.kept()
    load_signals([log], vehicle=CAR, rate_hz=10.0, cache=small)  # the older one is used
    load_signals([log], vehicle=CAR, rate_hz=30.0, cache=small)
    left = {e.path for e in small.kept()}
    assert len(left) == 2
    assert old.path in left
    assert new.path not in left


def test_many_processes_at_once(log, tmp_path):
    code = (
        "import sys; from pathlib import Path; from aqualog.align.cache import SignalCache\n"
        "from aqualog.align.load import load_signals; from aqualog.core.vehicle import Vehicle\n"
        f"for _ in range(8):\n"
        f"    c = SignalCache(Path({str(tmp_path / 'cache')!r}), limit=300_000)\n"  # room for one of two: they fight
        f"    s = load_signals([Path({str(log)!r})], vehicle=Vehicle(), rate_hz=float(sys.argv[1]), cache=c)\n"
        "    print(s.frame.hash_rows().sum(), s.frame.height)"
    )
    work = [
        subprocess.Popen([sys.executable, "-c", code, rate], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for rate in ("100", "100", "90")
    ]
    outs = [p.communicate() for p in work]
    assert [e for _, e in outs] == [""] * 3
    assert [len(set(o.split("\n"))) for o, _ in outs] == [2, 2, 2]  # one line, and what is behind the last
    assert not list((tmp_path / "cache" / "signals").glob(".*"))


def test_nothing_is_kept_unless_asked_for(log, tmp_path):
    given = ["detect", log, "--vehicle", SAMPLES / "vehicle.toml", "--json"]
    home = {"XDG_CACHE_HOME": str(tmp_path / "xdg")}
    own = str(tmp_path / "own")
    run(*given, **home)
    run(*given, "--no-cache", **home, AQUALOG_CACHE=own)
    assert not [*tmp_path.rglob("signals")]
    run(*given, "--cache", **home)
    assert len([*(tmp_path / "xdg" / "aqualog" / "signals").glob("*.parquet")]) == 1
    run(*given, **home, AQUALOG_CACHE=own)
    assert len([*(tmp_path / "own" / "signals").glob("*.parquet")]) == 1


def test_show_and_clean(log, place):
    env = {"AQUALOG_CACHE": str(place.folder.parent)}
    empty = json.loads(run("cache", "--json", **env).stdout)
    assert (empty["drives"], empty["bytes"], empty["usable"], empty["is_default"]) == ([], 0, 0, True)
    load_signals([log], vehicle=CAR, cache=place)
    (entry,) = place.kept()
    old = entry.path.with_name(re.sub("^.{8}", "0" * 8, entry.path.name))
    shutil.copy(entry.path, old)
    others = [place.folder / "mine.parquet", place.folder / "notes.txt", place.folder.parent / "compiled"]
    for other in others:
        other.write_text("not ours")
    (place.folder / f".{'0' * 8}-abc-12345678.parquet.tmp").write_text("left behind")
    shown = json.loads(run("cache", "--json", **env).stdout)
    assert (len(shown["drives"]), shown["usable"], shown["bytes"]) == (2, 1, 2 * entry.size)
    assert {f for d in shown["drives"] for f in d["files"]} == {"drive.parquet"}
    text = run("cache", "-v", **env).stdout
    assert "2 drives" in text
    assert "1 of this version" in text
    assert text.count("drive.parquet") == 2
    assert "2 drives removed" in run("cache", "--clean", **env).stdout
    assert sorted(place.folder.iterdir()) == sorted(others[:2])
    assert others[2].exists()
    for other in others[:2]:
        other.unlink()
    assert json.loads(run("cache", "--clean", "--json", **env).stdout)["removed"] == 0
    assert not place.folder.exists()


def test_a_limit_that_is_none_is_told():
    result = run("cache", AQUALOG_CACHE_MB="2 GB")
    assert result.exit_code == 2
    assert "AQUALOG_CACHE_MB" in result.stderr
    assert run("diagnose", "campaign.toml", "--cache").exit_code == 2


def test_calibrate_and_diagnose_take_what_detect_has_kept(log, tmp_path):
    env = {"AQUALOG_CACHE": str(tmp_path / "c")}
    car = ["--vehicle", SAMPLES / "vehicle.toml"]
    run("detect", log, *car, **env)
    (entry,) = (tmp_path / "c" / "signals").glob("*.parquet")
    os.utime(entry, (1e9, 1e9))
    for command in (["calibrate", log, *car], ["slip-slope", log, *car], ["diagnose", log, *car, "--no-bootstrap"]):
        run(*command, **env)
        assert entry.stat().st_mtime > 1e9 + 10, command[0]
        os.utime(entry, (1e9, 1e9))
    assert len([*(tmp_path / "c" / "signals").glob("*.parquet")]) == 1
