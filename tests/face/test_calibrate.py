"""`aq.calibrate` does what `aqualog calibrate` does."""

from dataclasses import replace

import pytest

import aqualog as aq
from tests.both_ways import check_result, command

FILES = ("calibration.json", "calibrated.toml", "calibration.html")


@pytest.fixture(scope="module")
def result(dry_folder):
    return aq.calibrate([dry_folder / "a.parquet", aq.read(dry_folder / "b.parquet")], dry_folder / "car.toml")


def test_face_and_command_agree(dry_folder, result, tmp_path):
    logs, car = (dry_folder / "a.parquet", dry_folder / "b.parquet"), dry_folder / "car.toml"
    check_result(result, tmp_path / "face", "calibrate", *logs, "--vehicle", car, files=FILES)
    out, page = tmp_path / "out.toml", tmp_path / "page.html"
    command("calibrate", *logs, "--vehicle", car, "-o", out, "--page", page)
    assert out.read_bytes() == (tmp_path / "face" / "calibrated.toml").read_bytes()
    assert page.read_bytes() == (tmp_path / "face" / "calibration.html").read_bytes()
    assert result.write_vehicle(tmp_path / "again.toml").read_bytes() == out.read_bytes()
    assert result.write_page(str(tmp_path / "again.html")).read_bytes() == page.read_bytes()
    with pytest.raises(aq.AqualogError, match="exists already"):
        result.write_vehicle(out)
    with pytest.raises(aq.AqualogError, match="source of this very run"):
        result.write_vehicle(car, force=True)


def test_the_calibrated_vehicle_is_that_of_the_file(dry_folder, result, tmp_path):
    read = aq.Vehicle.read(result.write_vehicle(tmp_path / "car.toml"))
    assert result.vehicle.mass != result.before.mass
    assert replace(read, given=frozenset(), spread={}) == replace(result.vehicle, given=frozenset(), spread={})
    assert dict(read.spread) == pytest.approx(dict(result.vehicle.spread))
    assert aq.detect(dry_folder / "a.parquet", result.vehicle).vehicle == result.vehicle


def test_tables(result):
    tables = result.tables
    mass = next(row for row in tables["parameters"].iter_rows(named=True) if row["name"] == "mass")
    assert mass["low"] < mass["value"] < mass["high"]
    assert tables["drives"]["name"].to_list() == ["a.parquet", "b.parquet"]
    assert tables["residuals"].columns == ["drive", "v", "force", "before", "after"]


def test_what_is_known_and_what_cannot_be_read(dry_folder, tmp_path):
    (tmp_path / "broken.mf4").write_bytes(b"MDF     4.10" + b"\0" * 90)
    heard = []
    logs = [tmp_path / "broken.mf4", dry_folder / "a.parquet", dry_folder / "b.parquet"]
    result = aq.calibrate(logs, str(dry_folder / "car.toml"), fix={"mass": 1500.0}, progress=heard.append)
    assert result.has_loss
    assert any(h.startswith("error: broken.mf4") for h in heard)
    assert [d.label for d in result.drives] == ["a.parquet", "b.parquet"]
    args = ("calibrate", *logs, "--vehicle", dry_folder / "car.toml", "--fix", "mass=1500", "--json")
    assert result.to_json() + "\n" == command(*args, code=3)[0]
    with pytest.raises(aq.AqualogError, match=r"no drive can be used: .*broken\.mf4"):
        aq.calibrate(logs[:1], dry_folder / "car.toml")
    with pytest.raises(aq.AqualogError, match="not known"):
        aq.calibrate(logs, dry_folder / "car.toml", fix={"wheel": 1.0})
    with pytest.raises(aq.AqualogError, match="no vehicle"):
        aq.calibrate(logs)


def test_signals_in_memory(dry_folder, result):
    signals = [aq.read(dry_folder / f"{n}.parquet").signals for n in "ab"]
    again = aq.calibrate(signals, result.before)
    assert again.found.get("mass").value == result.found.get("mass").value
    assert [d["name"] for d in again.document["drives"]] == ["a.parquet", "b.parquet"]
