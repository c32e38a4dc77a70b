import numpy as np
import pytest

from aqualog.align.mapping import Entry, SignalMap, SourceClock, resolve
from aqualog.align.table import build_signals
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.records import Channel, ChannelInfo, FileFaults
from aqualog.core.vehicle import Vehicle

CAR = Vehicle(r_e_f=0.3, r_e_r=0.32, steering_ratio=16.0)
MS = 1_000_000


def channel(name, values, unit="", dt=10 * MS, start=0, file="a.mf4", absolute=False, path=None):
    values = np.asarray(values, dtype=np.float64)
    info = ChannelInfo(path or name, name, unit, values.size, file)
    return Channel(info, start + np.arange(values.size, dtype=np.int64) * dt, values, absolute)


def build(*channels, entries=None, clocks=None, **kw):
    signal_map = SignalMap(entries or {}, clocks or {})
    found = resolve([c.info for c in channels], signal_map)
    by_info = {(c.info.file, c.info.path): c for c in channels}
    mapped = {s: (e, by_info[i.file, i.path]) for s, (e, i) in found.items()}
    return build_signals(mapped, signal_map=signal_map, vehicle=CAR, **kw)


@pytest.mark.parametrize("narrow", [np.float64, np.float32])
def test_codes_are_known_but_for_rounding(narrow):
    x = np.sin(np.arange(100.0))
    x[[3, 50]], x[51] = 1023 * 0.1, 1022.9 * 0.1
    s = build(channel("tq", x.astype(narrow), "Nm"), entries={"torque_r": Entry("torque_r", ("tq",), invalid=(102.3,))})
    assert s.origins["torque_rl"].invalid_code == 2


def test_canonical_names_need_no_map():
    s = build(channel("omega_fl", np.full(100, 90.0), "rad/s"), channel("v_x", np.full(100, 100.0), "km/h"))
    assert s.symbols == ("v_x", "omega_fl")
    assert s.dt == pytest.approx(0.01)
    assert s.array("v_x") == pytest.approx(np.full(100, 100 / 3.6))
    assert s.frame["t"][0] == 0.0
    assert s.start_ns is None


def test_values_become_si_by_their_unit_the_car_and_the_map():
    given = {
        "omega_fl": (108.0, "km/h"), "omega_rl": (30.0, "m/s"), "torque_r": (500.0, "Nm"),
        "steering_wheel_angle": (160.0, "deg"), "acc": (0.1, ""),
    }  # fmt: skip
    entry = Entry("a_x", ("acc",), "g", scale=-1.0, offset=1.5)
    s = build(*(channel(n, np.full(9, x), unit) for n, (x, unit) in given.items()), entries={"a_x": entry})
    expected = {
        "omega_fl": 30.0 / 0.3, "omega_rl": 30.0 / 0.32, "torque_rl": 250.0, "torque_rr": 250.0,
        "steer_angle": np.radians(10.0), "a_x": -0.980665 + 1.5,
    }  # fmt: skip
    assert {n: s.array(n)[0] for n in expected} == pytest.approx(expected)
    assert np.isnan(s.array("torque_fl")).all()


def test_error_codes_and_nonsense_are_masked_and_counted():
    x = np.full(200, 100.0)
    x[20] = np.nan
    x[40:60] = 1023.0
    x[100] = 1e9
    s = build(channel("tq", x, "Nm"), entries={"torque_r": Entry("torque_r", ("tq",), invalid=(1023.0,))})
    origin = s.origins["torque_rl"]
    assert (origin.not_finite, origin.invalid_code, origin.out_of_range) == (1, 20, 1)
    assert np.isnan(s.array("torque_rl")[41:59]).all()
    assert s.array("torque_rl")[20] == pytest.approx(50.0)  # one lost sample is bridged
    assert origin.missing_fraction == pytest.approx(22 / 200, abs=0.011)
    assert s.quality.dropped_samples == 22
    assert any("outside" in n for n in s.quality.notes)


def test_wheels_set_the_rate_whatever_their_jitter():
    c = channel("omega_fl", np.full(1000, 90.0), "rad/s")
    c.t_ns[:] += np.random.default_rng(1).integers(-2 * MS, 2 * MS, 1000)
    assert build(c).dt_ns == 10 * MS
    s = build(channel("omega_fl", np.full(100, 90.0), "rad/s", 20 * MS), channel("a_x", np.zeros(2000), "g", MS))
    assert s.dt_ns == 20 * MS


def test_states_are_held_and_labels_are_booleans():
    wheel = channel("omega_fl", np.full(100, 90.0), "rad/s")
    water = channel("on_water", [0, 1, 0, 0], "", 250 * MS)
    s = build(wheel, water)
    assert s.frame["on_water"].to_list()[24:27] == [False, True, True]


def test_late_source_is_moved_by_its_clock():
    wheel = channel("omega_fl", np.full(300, 90.0), "rad/s")
    gps = channel("v_x", np.arange(200) * 0.1, "m/s", start=200 * MS, file="gps.csv")
    s = build(wheel, gps, clocks={"gps.csv": SourceClock(offset_s=0.2)})
    assert s.array("v_x")[:3] == pytest.approx([0.0, 0.1, 0.2])


def test_clocks_without_a_common_zero_are_refused():
    a = channel("omega_fl", np.ones(9), "rad/s", absolute=True, start=10**18)
    b = channel("v_x", np.ones(9), "m/s", file="gps.csv")
    with pytest.raises(SignalError, match=r"gps\.csv.*clock"):
        build(a, b)
    assert build(a).start_ns == 10**18


def test_unknown_unit_of_a_mapped_channel_is_an_error_and_of_another_a_note():
    with pytest.raises(ConfigError, match="unknown unit"):
        build(channel("x", np.ones(9), "furlong"), entries={"v_x": Entry("v_x", ("x",))})
    s = build(channel("v_x", np.ones(9), "furlong"), channel("omega_fl", np.ones(9), "rad/s"))
    assert s.symbols == ("omega_fl",)
    assert any("furlong" in n for n in s.quality.notes)


def test_missing_and_ambiguous_channels_are_named():
    with pytest.raises(SignalError, match=r"omega_fl.*nearest.*wheel_fl"):
        build(channel("wheel_fl", np.ones(9)), entries={"omega_fl": Entry("omega_fl", ("wheel_f",))})
    twins = [channel("speed", np.ones(9), "m/s", path=f"g{i}.speed") for i in (1, 2)]
    with pytest.raises(SignalError, match=r"ambiguous.*g1\.speed.*g2\.speed"):
        build(*twins, entries={"v_x": Entry("v_x", ("speed",))})
    assert build(*twins, entries={"v_x": Entry("v_x", ("g2.speed",))}).symbols == ("v_x",)


def test_a_file_that_lacks_most_of_the_map_is_told_in_one_line_and_of_its_folder():
    names = {"v_x": "speed", "a_x": "along", "a_y": "aside", "altitude": "height"}
    with pytest.raises(SignalError) as failed:
        build(channel("BRK", np.ones(9)), entries={s: Entry(s, (n,)) for s, n in names.items()})
    assert "2 more of the map's channels are missing: aside, height" in failed.value.line()
    assert "the folder, if its files are one drive" in failed.value.line()


def test_mapped_channels_that_every_file_has_look_like_separate_drives():
    mapped = {s: Entry(s, (n,)) for s, n in (("v_x", "speed"), ("a_x", "along"), ("altitude", "height"))}
    twins = [channel(e.channel[0], np.ones(9), "-", file=f) for f in ("mon.csv", "tue.csv") for e in mapped.values()]
    with pytest.raises(SignalError, match=r"mon.csv, tue.csv: .* same 3 names: these look like separate drives.*batch"):
        build(*twins, entries=mapped)


def test_losses_of_readers_and_time_faults_reach_the_quality_record():
    c = channel("omega_fl", np.ones(500), "rad/s")
    c.t_ns[10] = c.t_ns[9]
    c.t_ns[300:] += 5_000 * MS
    q = build(c, file_faults=[FileFaults(truncated=True, lost_samples=7)]).quality
    assert (q.truncated, q.lost_in_files, q.faults.duplicates, q.faults.pauses, q.time_jumps) == (True, 7, 1, 1, 1)


def test_no_usable_signal():
    with pytest.raises(SignalError, match="no usable signal"):
        build()


def test_jumping_time_stamps_do_not_fill_the_memory():
    c = channel("omega_fl", np.full(1000, 90.0), "rad/s")
    c.t_ns[500:] += 400_000 * 1_000_000_000
    with pytest.raises(SignalError, match="time stamps jump"):
        build(c)


def test_a_block_that_is_written_twice_counts_once_and_is_no_loss():
    c = channel("omega_fl", 90 + np.sin(np.arange(2500) / 9), "rad/s")
    rows = np.r_[0:1000, 600:2500]
    s = build(Channel(c.info, c.t_ns[rows], c.values[rows], absolute=False))
    assert s.frame.equals(build(c).frame)
    assert (s.quality.has_loss, s.quality.faults.resets, s.quality.dropped_samples) == (False, 0, 0)
    assert any("400 rows from 6.00 to 9.99 s stand twice" in n for n in s.quality.notes)


def test_many_doubled_stamps_are_a_loss_and_a_note():
    c = channel("omega_fl", np.full(1000, 90.0), "rad/s")
    s = build(Channel(c.info, np.sort(np.tile(c.t_ns[:500], 2)), c.values, absolute=False))
    assert s.quality.lost_in_files == 500
    assert any("500 doubled (first at 0.00 s)" in n for n in s.quality.notes)


@pytest.mark.parametrize("both", [False, True])
def test_a_clock_that_begins_anew_in_one_file_of_several_is_told(both):
    own = [channel("omega_fl", np.ones(5000), "rad/s"), channel("a_x", np.ones(5000), "m/s^2", file="b.csv")]
    for c in own[: 1 + both]:
        c.t_ns[3000:] -= c.t_ns[3000]
    s = build(*own)
    told = [n for n in s.quality.notes if "its clock restarts" in n]
    name = own[0].info.file
    assert len(told) == 1 + both
    if not both:
        assert told[0].startswith(f"{name}: its clock restarts (first at 29.99 s), that of b.csv does not. The part")
    # alone it is out of step with nothing, but its pause is a guess all the same
    (alone,) = (n for n in build(own[0]).quality.notes if "its clock restarts" in n)
    assert alone.startswith(f"{name}: its clock restarts (first at 29.99 s). The part after the restart is placed 1 s")
    assert alone.endswith("assumes a pause of 1 s; times and places after it are in doubt by the true pause")


def test_sensor_dropouts_are_left_out_and_noted():
    x = np.full(1000, 90.0)
    x[400:420] = 0.0
    s = build(channel("omega_fl", x, "rad/s"))
    assert s.origins["omega_fl"].out_of_range == 20
    assert any("step faster than a wheel can" in n for n in s.quality.notes)
