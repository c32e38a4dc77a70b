"""Layouts name what is in the written log, and nothing else, as their viewers name it."""

import csv
import json
import xml.etree.ElementTree as ET

import pytest
from mcap.reader import make_reader

from aqualog.core.errors import ConfigError
from aqualog.io.write_log import write_log
from aqualog.report.drive.document import result_groups
from aqualog.report.layouts import layout_texts
from tests.report.fake_result import make_result


@pytest.fixture(scope="module")
def drive():
    result = make_result()
    return result, result_groups(result, features=True)


def written(drive, path):
    result, groups = drive
    t_ns = (result.signals.frame["t"].to_numpy() * 1e9).round().astype("int64")
    write_log(path, t_ns, groups, suffix=path.suffix, start_ns=None)
    return {p.name: text() for p, text in layout_texts(path, groups).items()}


def plots(text):
    """The panels of a PlotJuggler layout with their curves."""
    root = ET.fromstring(text.encode())
    assert [e.tag for e in root][:3] == ["tabbed_widget", "use_relative_time_offset", "Plugins"]
    split = root.find("tabbed_widget/Tab/Container/DockSplitter")
    assert int(split.get("count")) == len(split) == len(split.get("sizes").split(";"))
    return {area.get("name"): [c.get("name") for c in area.iter("curve")] for area in split}


def test_layouts_of_an_mcap_name_topics_and_fields(drive, tmp_path):
    texts = written(drive, tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    fields = {
        (c.topic, f)
        for c in summary.channels.values()
        for f in json.loads(summary.schemas[c.schema_id].data)["properties"]
    }
    found = plots(texts["a.plotjuggler.xml"])
    assert {"Speed [m/s]", "Slip speed: wheel less car [m/s]", "Resistance measure [m/s^2]", "Detections"} <= set(found)
    assert found["Speed [m/s]"][:2] == ["/signals/v_x", "/features/v_x_hat"]
    curves = [c for own in found.values() for c in own]
    assert {tuple(c.rsplit("/", 1)) for c in curves} <= fields
    layout = json.loads(texts["a.foxglove.json"])
    paths = [p["value"] for plot in layout["configById"].values() for p in plot["paths"]]
    assert [p.replace(".", "/") for p in paths] == curves
    tree, ids = layout["layout"], []
    while isinstance(tree, dict):
        ids.append(tree["first"])
        tree = tree["second"]
    assert [*ids, tree] == list(layout["configById"])


def test_layout_of_a_csv_names_its_headings(drive, tmp_path):
    texts = written(drive, tmp_path / "a.csv")
    assert list(texts) == ["a.plotjuggler.xml"]
    with (tmp_path / "a.csv").open() as file:
        heading = next(csv.reader(file))
    assert {c for own in plots(texts["a.plotjuggler.xml"]).values() for c in own} <= set(heading)
    assert 'time_axis="t [s]"' in texts["a.plotjuggler.xml"]


def test_an_mf4_has_no_layout(tmp_path):
    with pytest.raises(ConfigError, match=r"opens \.mf4"):
        layout_texts(tmp_path / "a.mf4", ())
