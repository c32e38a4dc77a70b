"""Which channel of thousands is which signal."""

import numpy as np

from aqualog.align.propose import propose_map, words_of
from aqualog.core.records import Channel, ChannelInfo


def channel(path, unit, file="a.mf4"):
    t_ns = np.arange(100, dtype=np.int64) * 10_000_000
    info = ChannelInfo(path, path.rpartition(".")[2], unit, 100, file, None, "")
    return Channel(info, t_ns, np.random.default_rng(len(path)).standard_normal(100), True)


def test_words_of_a_name():
    assert words_of("VehSpd_FL2x") == ("veh", "spd", "fl", "x")


def test_a_path_that_two_files_have_is_told_with_the_file():
    own = propose_map([channel("g.wheel_speed_FL", "rad/s"), channel("g.gear", "")])
    both = propose_map([channel("g.wheel_speed_FL", "rad/s"), channel("g.wheel_speed_FL", "rad/s", "b.mf4")])
    assert own["omega_fl"].entry.channel == ("g.wheel_speed_FL",)
    assert both["omega_fl"].entry.channel == ("a.mf4:g.wheel_speed_FL",)


def test_the_signal_is_found_among_thousands_that_could_be_it():
    many = [channel(f"g{i}.WheelSpeed_FL", "rad/s") for i in range(3000)]
    found = propose_map([*many, channel("x.omega_fl", "rad/s")])
    assert found["omega_fl"].entry.channel == ("x.omega_fl",)
    assert found["omega_fl"].reason == "its canonical name"


def test_names_of_buses_and_german_ones():
    names = {
        "torque_f": ("FrntAxleTq", "N*m"), "torque_r": ("RearAxleTq", "N*m"), "ambient_temperature": ("AmbTemp", "degC"),
        "latitude": ("Breitengrad", "deg"), "longitude": ("Laengengrad", "deg"), "altitude": ("Hoehe", "m"),
    }  # fmt: skip
    found = propose_map([channel(n, u) for n, u in names.values()])
    assert {s: p.entry.channel for s, p in found.items()} == {s: (n,) for s, (n, _) in names.items()}
    german = {"torque_f": "Achsmoment_VA", "torque_r": "Achsmoment_HA"}
    found = propose_map([channel(n, "N*m") for n in german.values()])
    assert {s: p.entry.channel for s, p in found.items()} == {s: (n,) for s, n in german.items()}
