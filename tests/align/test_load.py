"""What is told of the files of a drive that give nothing."""

import numpy as np
import pytest

from aqualog.align.load import idle_files, load_signals
from aqualog.align.mapping import Entry, SignalMap
from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle


def table(path, *names):
    t = np.arange(300) * 0.01
    lines = [",".join(["t [s]", *names]), *(",".join([f"{x:.2f}", *(f"{20 + x:.2f}" for _ in names)]) for x in t)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_files_that_give_no_signal_are_named(tmp_path):
    used = table(tmp_path / "wheels.csv", "v_x [m/s]")
    assert load_signals([used], vehicle=Vehicle(), signal_map=SignalMap()).quality.notes == ()
    idle = [table(tmp_path / f"more{k}.csv", "heater [W]") for k in range(5)]
    one = load_signals([used, idle[0]], vehicle=Vehicle(), signal_map=SignalMap()).quality.notes
    assert [n for n in one if "more0.csv gives none of the signals" in n]
    many = load_signals([used, *idle], vehicle=Vehicle(), signal_map=SignalMap()).quality.notes
    assert [n for n in many if "more0.csv, more1.csv, more2.csv and 2 more give none" in n]


@pytest.mark.parametrize(
    "entries",
    [
        {"omega_fl": "wheel", "omega_fr": "a.csv:wheel"},  # by name and by file
        {"omega_fr": "omega_fl"},  # which is omega_fl by its name already
    ],
)  # fmt: skip
def test_one_channel_for_two_signals_under_different_names(tmp_path, entries):
    path = table(tmp_path / "a.csv", "wheel [rad/s]", "omega_fl [rad/s]")
    signal_map = SignalMap({s: Entry(s, (c,)) for s, c in entries.items()}, path="map.toml")
    with pytest.raises(
        ConfigError, match=r"map\.toml: omega_fr and omega_fl|map\.toml: omega_fl and omega_fr"
    ) as error:
        load_signals([path], vehicle=Vehicle(), signal_map=signal_map)
    assert "read the same channel" in error.value.what


@pytest.mark.parametrize("paths", [[], ["a.csv"]])
def test_all_in_use(paths, tmp_path):
    class Log:
        def __init__(self):
            self.goes_on = {}
            self.paths = [tmp_path / p for p in paths]

    class Info:
        file = "a.csv"

    assert idle_files(Log(), {"v_x": (None, Info())}) == []


def test_a_state_needs_no_unit(tmp_path):
    entries = {s: Entry(s, (c,)) for s, c in (("v_x", "Speed"), ("gear", "Gang"))}
    log = table(tmp_path / "log.csv", "Speed", "Gang")
    notes = load_signals([log], vehicle=Vehicle(), signal_map=SignalMap(entries)).quality.notes
    assert [n.split(" has")[0] for n in notes if "has no unit" in n] == ["log.csv:Speed"]
