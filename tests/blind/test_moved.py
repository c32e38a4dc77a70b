"""Cases with a vehicle file that is off, and what becomes of their names."""

import json
import tomllib

from aqualog.config.vehicle import load_vehicle
from tests.blind.moved import MOVED, changes, main, make


def case(folder, text):
    folder.mkdir(parents=True)
    (folder / "truth.bin").write_bytes(b"sealed")
    (folder / "vehicle.toml").write_text(text, encoding="utf-8")


TEXT = """mass = 1500.0
torque_gain = 0.95
[wheels]
r_e_f = 0.31
r_e_r = 0.32
[spread]
torque_gain = 0.003
"""


def test_guesses_are_moved_and_said_to_be_guesses(tmp_path):
    for n in range(1, 9):
        case(tmp_path / "a" / f"case_{n:04d}", TEXT)
    assert make(tmp_path / "b", tmp_path / "a", 7) == 8
    cars = [load_vehicle(p) for p in sorted((tmp_path / "b").glob("*/vehicle.toml"))]
    assert all({k: c.provenance[k].source for k in MOVED} == dict.fromkeys(MOVED, "guess") for c in cars)
    assert all(c.provenance["mass"].source == "measured" and c.mass == 1500.0 for c in cars)
    off = [c.r_e("fl") / 0.31 - 1.0 for c in cars]
    assert 0.004 < max(map(abs, off)) <= 0.03
    assert len({c.torque_gain for c in cars}) == 8
    assert all(abs(c.torque_gain / 0.95 - 1.0) <= 0.4 for c in cars)
    assert tomllib.loads((tmp_path / "b" / "case_0001" / "vehicle.toml").read_text())["spread"]["torque_gain"] == 0.003


def verdict(folder, said, *causes):
    folder.mkdir(parents=True)
    text = json.dumps({"verdict": said, "causes": [{"effect": e, "where": None} for e in causes]})
    (folder / "verdict.json").write_text(text, encoding="utf-8")


def test_a_name_that_becomes_another_one_is_a_fault(tmp_path, capsys):
    one, other = tmp_path / "one", tmp_path / "other"
    for name, a, b in (("1", ("named", "aero_drag"), ("named", "aero_drag")), ("2", ("named", "aero_drag"), ("named", "trailer")),
                       ("3", ("named", "aero_drag"), ("cannot_tell", "aero_drag", "trailer"))):  # fmt: skip
        verdict(one / name, *a)
        verdict(other / name, *b)
    count, faults = changes(one, other)
    assert count == {"named -> named": 2, "named -> cannot_tell": 1}
    assert len(faults) == 1
    assert main(["count", str(one), str(other)]) == 1
    assert "1 of 3 names became another one" in capsys.readouterr().out
