"""Files with settings that a user writes: signal map, vehicle, thresholds, labels, history; each is then worked with."""

import json
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np

from aqualog.align.load import load_signals
from aqualog.config.history import load_history, save_history
from aqualog.config.labels import load_labels
from aqualog.config.signal_map import load_signal_map, map_text
from aqualog.config.thresholds import joint_text, load_settings, load_thresholds, thresholds_text
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import AqualogError
from aqualog.core.records import Signals
from aqualog.core.vehicle import KEYS, Vehicle, vehicle_toml
from aqualog.detect.registry import RIVALS
from aqualog.detect.slip_slope.history import History, Period, history_to_json, reference
from aqualog.detect.stream import Settings, detect_drive
from aqualog.detect.thresholds import DEFAULT
from tests.fuzz.registry import Target, add
from tests.fuzz.settings_files import LOG, NAMES, check_error, check_finite, drive, folder_with, loaded

_SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"


@cache
def maps() -> dict[str, bytes]:
    """Maps of the drive: short, with every key, and with several channels for a signal."""
    short = "[time]\nchannel = \"Zeit\"\nunit = \"s\"\n\n[signals]\n" + "".join(f'{s} = "{n}"\n' for s, (n, _) in NAMES.items())  # fmt: skip
    rows = "".join(f'{s} = {{ channel = ["none", "{n}"], unit = "{u}", scale = 1.0, offset = 0.0, invalid = [-1.0, 255] }}\n' for s, (n, u) in NAMES.items())  # fmt: skip
    clocks = '\n[sources."log.csv"]\noffset_s = 0.25\ndrift_ppm = 12.0\nat_s = 1.0\n'
    return {
        "short": short.encode(),
        "full": ('[time]\nchannel = "Zeit"\nunit = "s"\n[signals]\n' + rows + clocks).encode(),
    }


def signal_map(data: bytes) -> None:
    """Read a map, write it again, and read a log with it."""
    with folder_with({"map.toml": data, "log.csv": LOG}) as folder:
        found = loaded(load_signal_map, folder / "map.toml")
        if found is None:
            return
        check_finite({k: asdict(e) for k, e in found.entries.items()})
        with folder_with({"map.toml": map_text(found).encode()}) as again:
            second = load_signal_map(again / "map.toml")
        for part in ("entries", "clocks", "time_channel", "time_unit"):
            a, b = getattr(found, part), getattr(second, part)
            assert a == b or (not a and not b), f"written and read again, {part} {a} are {b}"
        try:
            signals = load_signals([folder / "log.csv"], vehicle=Vehicle(), signal_map=found)
        except AqualogError as error:
            check_error(error)
            return
        _check_signals(signals)


def _check_signals(signals: Signals) -> None:
    assert signals.dt_ns > 0
    for symbol in signals.symbols:
        x = signals.array(symbol)
        assert len(x) == signals.frame.height
        assert not np.isinf(np.asarray(x, dtype=float)).any(), f"{symbol} is infinite"


@cache
def vehicles() -> dict[str, bytes]:
    """The sample's, one with every key, and a bare one."""
    polynomials = '\n[tie_rod]\nc0 = 10.0\nc_y = [0.1, 1e-5]\nc_x = 0.02\nsigma = 40.0\n[provenance]\nmass = "measured"\nwheels.r_e_f = { source = "calibrated", sd = 0.001 }\n[spread]\nmass = 30.0\ntorque_gain = 0.02\n'
    full = vehicle_toml(Vehicle())
    with_more = full if "[spread]" in full else full + polynomials
    bare = b'drivetrain = "awd"\nmass = 1900\n[tyre]\nslip_slope_f = 28\n'
    return {"sample": (_SAMPLES / "vehicle.toml").read_bytes(), "full": with_more.encode(), "bare": bare}


def vehicle(data: bytes) -> None:
    """Read a vehicle file, and run the detectors with it."""
    with folder_with({"vehicle.toml": data}) as folder:
        found = loaded(load_vehicle, folder / "vehicle.toml")
    if found is None:
        return
    check_finite(found)
    for path in found.given & set(KEYS):
        key = KEYS[path]
        assert key.low <= getattr(found, key.name) <= key.high, f"{path} = {getattr(found, key.name)}"
    _detect(found, Settings())


def _detect(car: Vehicle, settings: Settings) -> None:
    try:
        result = detect_drive(drive(), car, settings=settings)
    except AqualogError as error:
        check_error(error)
        return
    for track in result.tracks:
        assert len(track.statistic) == drive().frame.height
    for event in result.events:
        assert event.start_s <= event.end_s, "an event that ends before it begins"


@cache
def thresholds() -> dict[str, bytes]:
    """With every key, and a few."""
    joint = '\n[joint_cusum]\nthird = "variance"\nwith_slope = true\ngated = false\nweights = { resistance = 1.0 }\n'
    full = thresholds_text(DEFAULT, dict.fromkeys(RIVALS, 0.5)) + joint
    return {"full": full.encode(), "few": b"[thresholds]\nspin_down = 0.4\nslip_slope_drop = 0.6\n[rivals]\n"}


def threshold(data: bytes) -> None:
    """Read a thresholds file, write it again, and run the detectors with it."""
    with folder_with({"thresholds.toml": data}) as folder:
        settings = loaded(load_settings, folder / "thresholds.toml")
        both = loaded(load_thresholds, folder / "thresholds.toml")
    if settings is None or both is None:
        return
    check_finite(settings)
    text = thresholds_text(settings.thresholds, both[1]) + joint_text(settings.joint_cusum)
    with folder_with({"thresholds.toml": text.encode()}) as again:
        assert load_settings(again / "thresholds.toml") == settings, "written and read again it is another"
        assert load_thresholds(again / "thresholds.toml") == both, "written and read again it is another"
    _detect(Vehicle(), settings)


def labels() -> dict[str, bytes]:
    """With all columns, without wheels, and without lines."""
    all_of = "start_s,end_s,effect,wheel\n0.5,2.5,full,fl\n1,3,water,\n2.0,2.25,spin_down,rr\n2,4,aquaplaning,\n3,3.5,snow,fr\n"
    return {
        "all": all_of.encode(), "short": b"start_s,end_s,effect\r\n1,2,full\r\n1.5,3,full\r\n",
        "none": b"\xef\xbb\xbfstart_s,end_s,effect,wheel\n",
    }  # fmt: skip


def label(data: bytes) -> None:
    """Read a labels file."""
    with folder_with({"labels.csv": data}) as folder:
        found = loaded(load_labels, folder / "labels.csv")
    ends: dict[tuple[str, str | None], float] = {}
    for x in found or ():
        check_finite(x)
        assert 0.0 <= x.start_s < x.end_s, f"a label from {x.start_s} to {x.end_s}"
        assert x.start_s >= ends.get((x.effect, x.wheel), 0.0), "labels of one effect overlap"
        ends[x.effect, x.wheel] = x.end_s
    count = max(data.count(b"\n"), data.count(b"\r")) + 1
    assert len(found or ()) <= 2 * count, "more labels than lines"


def histories() -> dict[str, bytes]:
    """Two configurations at two places, and an empty one."""
    periods = tuple(Period(30.0 + k, 28.0 + k, 30.0, "0123456789abcdef") for k in range(3))
    found = History({"summer 2.0 bar": {"left": periods, "right": periods[:1]}, "": {"axle": periods}})
    return {
        "two": json.dumps(history_to_json(found), indent=1).encode(),
        "none": json.dumps(history_to_json(History())).encode(),
    }


def history(data: bytes) -> None:
    """Read a history, write it again, and take the reference from it."""
    with folder_with({"history.json": data}) as folder:
        found = loaded(load_history, folder / "history.json")
    if found is None:
        return
    check_finite(dict(found.periods))
    for places in found.periods.values():
        for periods in places.values():
            for rule in ("max", "robust"):
                assert not periods or 1.0 <= reference(periods, rule=rule) <= 300.0
    with folder_with({}) as folder:
        save_history(folder / "h.json", found)
        assert load_history(folder / "h.json") == found, "written and read again it is another"
        (folder / "h.json").unlink()


add("map", Target("signal maps, and a log read with them", maps, signal_map, is_text=True))
add("vehicle", Target("vehicle files, and the detectors with them", vehicles, vehicle, is_text=True))
add("thresholds", Target("thresholds files, and the detectors with them", thresholds, threshold, is_text=True))
add("labels", Target("labels files", labels, label, is_text=True))
add("history", Target("histories of the slip slope", histories, history, is_text=True))
