"""Laws that every detector and rival of the registry keeps, and what a new one costs: a file and a line."""

import itertools
import json
import subprocess
import sys

import numpy as np
import pytest

from aqualog.detect.detector import Setup
from aqualog.detect.registry import BY_NAME, DETECTORS, RIVALS, all_of, check_needs, running_order
from aqualog.detect.stream import DriveStream
from aqualog.features.names import FEATURES, feature_of
from tests.conftest import ROOT
from tests.drives import AWD, CAR, drive, lane

OWN = all_of("effect", "joint", "warning")
DT_NS = 10_000_000


@pytest.fixture(scope="module")
def wet():
    """Columns of a wet drive with gaps, all signals of all detectors in it."""
    car = CAR.__class__(**{n: getattr(CAR, n) for n in CAR.__slots__} | {"tie_rod": {"c_y": (0.1,), "sigma": (60.0,)}})
    signals, _ = drive(car, duration_s=14.0, lanes=(lane(),), speed_kmh=((0.0, 104.0),))
    columns = {s: signals.array(s).copy() for s in signals.symbols if not s.startswith(("true", "on_water"))}
    columns["steering_torque"] = np.sin(np.arange(columns["v_x"].size) / 50.0)
    rng = np.random.default_rng(0)
    for x in columns.values():
        at = rng.integers(100, 1200)
        x[at : at + 7] = np.nan
    return car, columns


def run(car, columns, detectors, edges):
    stream = DriveStream(car, DT_NS, columns, detectors=detectors)
    pieces = [stream.push({s: x[a:b] for s, x in columns.items()}) for a, b in itertools.pairwise(edges)]
    assert not [c for c in pieces[0].features if feature_of(c) is None]  # the dictionary knows every column
    tracks = {}
    for piece in pieces:
        for t in piece.tracks:
            tracks.setdefault((t.detector, t.wheel, t.side), []).append((t.statistic, t.active))
    joined = {k: [np.concatenate(parts) for parts in zip(*v, strict=True)] for k, v in tracks.items()}
    events = [e for p in pieces for e in p.events] + list(stream.finish())
    return joined, sorted(events, key=repr), stream


@pytest.mark.parametrize("name", BY_NAME)
def test_no_statistic_and_no_alarm_without_any_value(name, wet):
    """NaN rule: where all signals are missing nothing is known, and no detection begins."""
    car, columns = wet
    gap = slice(300, 320)  # before the lane
    holed = {s: np.where((np.arange(x.size) >= gap.start) & (np.arange(x.size) < gap.stop), np.nan, x)
             for s, x in columns.items()}  # fmt: skip
    detectors = OWN if name in DETECTORS else [BY_NAME[name]]
    tracks, _, _ = run(car, holed, detectors, [0, columns["v_x"].size])
    for key, (statistic, bits) in tracks.items():
        if key[0] == name:
            assert np.isnan(statistic[gap]).all(), key
            assert not (bits[gap] & ~bits[gap.start - 1]).any(), key


@pytest.mark.parametrize("name", BY_NAME)
@pytest.mark.parametrize("car", [CAR, AWD], ids=["rwd", "awd"])
def test_needs_are_honest(name, car, wet):
    """With what it asks for a detector runs; without any of the signals it does not, and names them."""
    detector, (_, columns) = BY_NAME[name], wet
    assert detector.needs(car, (), 1.0).missing
    wanted = detector.needs(car, (), 1e4).missing
    keys = [m.removeprefix("vehicle.") for m in wanted if m.startswith("vehicle.")]
    car = CAR.__class__(**{n: getattr(car, n) for n in car.__slots__} | {"given": car.given | set(keys)})
    if name == "tie_rod":
        car = CAR.__class__(**{n: getattr(car, n) for n in car.__slots__} | {"tie_rod": {"c_y": (0.1,)}})
    symbols = [m for m in wanted if not m.startswith("vehicle.")]
    readers = [*detector.reads, detector]
    for read in detector.reads:
        symbols += [s for s in read.needs(car, symbols, 1e4).missing if s not in symbols]
    unavailable, _ = check_needs(car, symbols, rate_hz=100.0, detectors=readers)
    assert name not in {u.detector for u in unavailable}
    some = {s: columns.get(s, np.zeros(400))[:400] for s in symbols}
    some.setdefault("v_x", np.full(400, 20.0))
    run(car, some, readers, [0, 400])
    slow, _ = check_needs(car, symbols, rate_hz=0.5, detectors=[detector])
    assert name == "tie_rod" or any("Hz or more" in m for u in slow for m in u.missing)


def test_the_dictionary_of_features_names_its_makers():
    assert len({f.stem for f in FEATURES}) == len(FEATURES)
    assert {f.made_by for f in FEATURES} <= {"", *BY_NAME}
    assert {f.shown for f in FEATURES} == {f.shown for f in FEATURES if feature_of(f.shown) is f}


def test_each_runs_after_what_it_reads():
    order = running_order(BY_NAME.values())
    assert len(order) == len(BY_NAME)
    for i, detector in enumerate(order):
        assert not set(detector.reads) - set(order[:i]), detector.name
    assert [d.name for d in running_order(OWN)][2:5] == ["slip_slope_drop", "resistance", "spin_up"]


@pytest.mark.parametrize("name", BY_NAME)
def test_each_describes_itself(name):
    d = BY_NAME[name]
    assert d.name == name
    assert all((d.title, d.unit, d.meaning, d.statistic))
    assert 0.0 < d.threshold < d.highest
    assert (d.kind == "rival") == (name in RIVALS) == bool(d.reference) == (d.counterpart is not None)
    assert callable(d.start(Setup(d, CAR, 0.01, d.threshold)).push)


def test_names_stand_in_one_file_of_the_package():
    folder = ROOT / "aqualog" / "detect"
    for name in BY_NAME:
        files = [p.name for p in folder.rglob("*.py") if f'"{name}"' in p.read_text(encoding="utf-8")]
        if name == "resistance":
            files.remove("detector.py")  # also a word of a thresholds file
        assert len(files) == 1, (name, files)


NEW = '''
"""Detect rain by its noise."""

import numpy as np

from aqualog.detect.detector import Detector, Needs, Output


class Watch:
    def __init__(self, setup):
        self.setup = setup

    def push(self, scene):
        loud = scene.f["v_x_hat"]
        track = self.setup.track(loud, loud > self.setup.threshold)
        return Output(((track, {"v_x": ("first", loud)}),), {"loudness": loud})


LOUDNESS = Detector(
    name="loudness", title="Loud rain", unit="m/s", meaning="speed from which rain is loud", statistic="noise of rain",
    threshold=28.5, needs=lambda vehicle, have, rate: Needs(() if "v_x" in have else ("v_x",)), start=Watch,
)
'''
USE = """
import importlib.util, json, pathlib, sys
sys.path.insert(0, {tests!r})
new = importlib.util.module_from_spec(importlib.util.spec_from_loader("aqualog.detect.loudness", None))
exec({new!r}, new.__dict__)
sys.modules["aqualog.detect.loudness"] = new
path = pathlib.Path("aqualog/detect/registry.py")
line = "from aqualog.detect.loudness import LOUDNESS\\n"
code = path.read_text().replace("from aqualog.detect.tie_rod", line + "from aqualog.detect.tie_rod")
code = code.replace("TIE_ROD, JOINT_CRITERIA", "TIE_ROD, LOUDNESS, JOINT_CRITERIA")
registry = importlib.util.module_from_spec(importlib.util.spec_from_loader("aqualog.detect.registry", None))
sys.modules["aqualog.detect.registry"] = registry
exec(compile(code, str(path), "exec"), registry.__dict__)
from tests.drives import CAR, drive
from aqualog.book.reference.settings import thresholds_page as text
from aqualog.config.thresholds import load_thresholds, thresholds_text
from aqualog.detect.stream import Settings, detect_drive
from aqualog.evaluate.labels import EFFECTS
from aqualog.report.drive.document import document
from aqualog.report.wording import caption, detector_name
given = pathlib.Path(sys.argv[1])
given.write_text("[thresholds]\\nloudness = 10.0\\n")
thresholds, _ = load_thresholds(given)
signals, _ = drive(CAR, duration_s=6.0, speed_kmh=((0.0, 60.0),))
quiet = detect_drive(signals, CAR)
loud = detect_drive(signals, CAR, settings=Settings(thresholds=thresholds))
print("FOUND" + json.dumps(dict(
    quiet=[e.detector for e in quiet.events], events=[e.detector for e in loud.events],
    feature="loudness" in loud.features.columns, document=json.dumps(document(loud, log="drive.mf4")),
    written=thresholds_text(thresholds), page=text(), words=[detector_name("loudness"), caption("loudness")],
    labels=list(EFFECTS),
)))
"""


def test_a_new_detector_is_a_file_and_a_line(tmp_path):
    """It shows in events, JSON, thresholds files, the words of pages, labels and the reference."""
    code = USE.format(tests=str(ROOT / "tests"), new=NEW)
    ran = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "t.toml")], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert ran.returncode == 0, ran.stderr[-2000:]
    found = json.loads(ran.stdout.split("FOUND")[-1])
    assert "loudness" not in found["quiet"]
    assert "loudness" in found["events"]
    assert found["feature"]
    assert any(e["detector"] == "loudness" for e in json.loads(found["document"])["events"])
    assert "loudness = 10.0  # speed from which rain is loud [m/s]" in found["written"]
    assert "| `loudness` | m/s | 28.5 | speed from which rain is loud |" in found["page"]
    assert found["words"] == ["Loud rain", "noise of rain"]
    assert found["labels"][-1] == "loudness"
