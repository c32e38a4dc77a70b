"""A drive without a signal map: what `inspect` proposes is used, and said."""

import json

import pytest

import aqualog as aq
from aqualog.core.units import parse_unit
from tests.commands import run
from tests.conftest import ROOT

GERMAN = ROOT / "sample_logs" / "lane_drive.csv"
CAR = ROOT / "sample_logs" / "vehicle.toml"


@pytest.fixture(scope="module")
def by_map():
    return aq.detect(aq.read(GERMAN, map=aq.inspect(GERMAN).map), CAR, samples=False)


def test_detect_without_a_map_is_detect_with_the_proposed_one_and_says_so(by_map):
    done = run("detect", GERMAN, "--vehicle", CAR, "--json")
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["events"] == by_map.document["events"]
    said = [n for n in document["quality"]["notes"] if n.startswith("no signal map: ")]
    assert len(said) == 1
    assert "are guessed from names, units and data (" in said[0]
    assert f"note: {said[0]}" in done.stderr.replace("\n  ", "\n")
    assert not any(n.startswith("no signal map") for n in by_map.document["quality"]["notes"])


def test_convert_guesses_as_detect_does_and_says_so(by_map, tmp_path):
    done = run("convert", GERMAN, "--vehicle", CAR, "-o", tmp_path / "c.parquet")
    assert done.exit_code == 0, done.stderr
    assert "no signal map: 12 signals are guessed from names, units and data (" in done.stderr
    made = aq.detect(tmp_path / "c.parquet", CAR, samples=False)
    assert [e["wheel"] for e in made.document["events"]] == [e["wheel"] for e in by_map.document["events"]]


def test_units_that_the_log_does_not_give_are_guessed_too(by_map, tmp_path):
    heading, _, rows = GERMAN.read_text(encoding="utf-8").partition("\n")
    bare = ";".join(cell.split(" [")[0] if i else cell for i, cell in enumerate(heading.split(";")))
    (tmp_path / "bare.csv").write_text(f"{bare}\n{rows}", encoding="utf-8")

    def units(entries):
        return {s: parse_unit(e.unit) for s, e in entries.items()}

    assert units(aq.inspect(tmp_path / "bare.csv").map.entries) == units(by_map.drive.signal_map.entries)


def test_canonical_names_and_drives_that_do_not_go_together_are_not_guessed_at(tmp_path):
    log = ROOT / "sample_logs" / "lane_drive.parquet"
    assert not any("guessed" in n for n in aq.detect(log, CAR, samples=False).notes)
    for own in (log, GERMAN):
        (tmp_path / f"copy{own.suffix}").write_bytes(own.read_bytes())
        done = run("detect", own, tmp_path / f"copy{own.suffix}", "--vehicle", CAR)
        assert done.exit_code != 0
        assert "separate drives" in done.stderr


def test_a_log_without_any_signal_still_says_so(tmp_path):
    (tmp_path / "a.csv").write_text("t,foo\n" + "".join(f"{0.1 * i},{i % 7}\n" for i in range(100)))
    done = run("detect", tmp_path / "a.csv")
    assert done.exit_code == 4
    assert "by name; expected names as omega_fl" in done.stderr
