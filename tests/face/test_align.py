"""`aq.align` does what `aqualog align` does."""

import numpy as np
import polars as pl
import pytest

import aqualog as aq
from tests.both_ways import check_saved, check_shown, command

LATE = 0.35


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Wheels and a GPS whose clock is late; a camera that saw another drive."""
    path = tmp_path_factory.mktemp("loggers")
    rng = np.random.default_rng(3)

    def speed(t):
        return 20.0 + 4.0 * np.sin(0.21 * t) + 2.0 * np.sin(0.83 * t + 1.0) + np.sin(2.1 * t)

    t = np.arange(0.0, 200.0, 0.02)
    wheels = {"t": t} | {f"omega_{w}": (speed(t) + 0.01 * rng.standard_normal(t.size)) / 0.317 for w in WHEELS}
    pl.DataFrame(wheels).write_csv(path / "wheels.csv")
    t = np.arange(0.0, 200.0, 0.1)
    pl.DataFrame({"t": t + LATE, "v_x": speed(t) + 0.02 * rng.standard_normal(t.size)}).write_csv(path / "gps.csv")
    other = 20.0 + np.cumsum(rng.standard_normal(t.size)) * 0.1
    pl.DataFrame({"t": t, "v_x": other}).write_csv(path / "camera.csv")
    return path


WHEELS = ("fl", "fr", "rl", "rr")


def test_face_and_command_agree(folder, tmp_path):
    files = folder / "wheels.csv", folder / "gps.csv"
    result = aq.align(*files)
    assert result.offsets["gps.csv"] == pytest.approx(LATE, abs=0.02)
    assert result.to_json() + "\n" == command("align", *files, "--json")[0]
    assert result.text() == command("align", *files)[0]
    assert not result.has_loss
    check_shown(result)
    check_saved(result, tmp_path / "face", ("alignment.json", "map.toml"))
    command("align", *files, "--write-map", tmp_path / "map.toml")
    written = (tmp_path / "map.toml").read_bytes()
    assert (tmp_path / "face" / "map.toml").read_bytes() == written
    assert result.write_map(tmp_path / "again.toml").read_bytes() == written
    aligned = aq.read(files, map=result.map).frame
    assert aligned.equals(aq.read(files, map=tmp_path / "map.toml").frame)
    assert (aligned["v_x"] - 0.317 * aligned["omega_fl"]).drop_nulls().abs().median() < 0.1


def test_what_does_not_match_is_refused(folder):
    files = [folder / n for n in ("wheels.csv", "gps.csv", "camera.csv")]
    heard = []
    result = aq.align(files, progress=heard.append)
    assert list(result.fits) == ["gps.csv"]
    assert list(result.refused) == ["camera.csv"]
    assert result.has_loss
    assert any(h.startswith("error: camera.csv") for h in heard)
    assert result.to_json() + "\n" == command("align", *files, "--json", code=3)[0]
    check_shown(result)
    alone = aq.align(files[0], files[2])
    assert alone.files().keys() == {"alignment.json"}
    check_shown(alone)
    with pytest.raises(aq.AqualogError, match="no clock was found"):
        alone.write_map("map.toml")
    assert command("align", files[0], files[2], "--json", code=4)[0] == alone.to_json() + "\n"


def test_a_drive_and_named_channels(folder):
    files = folder / "wheels.csv", folder / "gps.csv"
    result = aq.align(aq.read(files), channels={"wheels.csv": "omega_fl"})
    args = ("--channel", "wheels.csv=omega_fl", "--json")
    assert result.to_json() + "\n" == command("align", *files, *args)[0]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [({"quantity": "noise"}, "speed or yaw_rate"), ({"channels": {"x.csv": "a"}}, "FILE one of"),
     ({"max_offset_s": 0.0}, "max_offset_s")],
)  # fmt: skip
def test_wrong_arguments(folder, arguments, said):
    with pytest.raises(aq.AqualogError, match=said):
        aq.align(folder / "wheels.csv", folder / "gps.csv", **arguments)


def test_one_file_is_too_few(folder):
    with pytest.raises(aq.AqualogError, match="different files; expected a reference and at least one other file"):
        aq.align(folder / "wheels.csv")


@pytest.fixture
def others(tmp_path):
    """Two files without any speed."""
    t = np.arange(0.0, 200.0, 0.1)
    for name, column in (("brake.csv", "BRK_PRESS"), ("steer.csv", "STEER_POS")):
        pl.DataFrame({"t": t, column: 40.0 * np.sin(0.3 * t)}).write_csv(tmp_path / name)
    return tmp_path / "brake.csv", tmp_path / "steer.csv"


def test_files_without_the_quantity_are_left_out_and_said(folder, others):
    files = others[0], folder / "wheels.csv", folder / "gps.csv", others[1]
    result = aq.align(files)
    assert result.offsets["gps.csv"] == pytest.approx(LATE, abs=0.02)
    assert list(result.left_out) == ["brake.csv", "steer.csv"]
    assert result.compared[0].file == "wheels.csv"
    assert "brake.csv carries no speed: wheels.csv is the reference" in result.notes
    printed, _ = command("align", *files, "--json", code=3)
    assert printed == result.to_json() + "\n"
    assert "left out: steer.csv: no speed found" in result.text()
    check_shown(result)
    assert "no speed found" in command("align", others[0], folder / "gps.csv", code=4)[1]
    with pytest.raises(aq.AqualogError, match="no channel"):
        aq.align(files, channels={"steer.csv": "speed"})


@pytest.mark.parametrize(("slip", "taken"), [(0.0, "the two intervals overlap"), (0.002, "tyre slip is part")])
def test_of_two_offsets_one_is_taken_and_it_says_why(tmp_path, slip, taken):
    rng = np.random.default_rng(7)
    t = np.arange(0.0, 400.0, 0.05)
    v = 25.0 + 9.0 * np.sin(0.11 * t) + 4.0 * np.sin(0.53 * t + 1.0) + np.sin(1.9 * t)
    wheels = v + slip * v * np.gradient(v, t)
    pl.DataFrame({"t": t, "v_x": wheels + 0.01 * rng.standard_normal(t.size)}).write_csv(tmp_path / "a.csv")
    pl.DataFrame({"t": t + LATE, "v_x": v + 0.01 * rng.standard_normal(t.size)}).write_csv(tmp_path / "b.csv")
    result = aq.align(tmp_path / "a.csv", tmp_path / "b.csv")
    fit = result.fits["b.csv"]
    assert fit.has_slip == bool(slip)
    assert result.offsets["b.csv"] == (fit.slip_offset_s if slip else fit.offset_s)
    assert result.map.clocks["b.csv"].offset_s == pytest.approx(LATE, abs=0.01)
    assert taken in result.text()
    assert result.document["sources"][0]["taken_s"] == pytest.approx(result.offsets["b.csv"])
