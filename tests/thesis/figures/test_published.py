"""Figure W.1: every published point stands in its table, and the speeds in the picture."""

import numpy as np

from aqualog.model.published import compared, points
from aqualog.thesis.run import make


def test_the_table_has_every_point_with_value_and_verdict():
    figure = make("W.1")
    (table,) = figure.tables
    assert [row[0] for row in table.rows] == [f"{p.id} ({p.mark})" for p in points()]
    for row, r in zip(table.rows, compared(), strict=True):
        assert (row[-1] == "yes") == r.is_inside
        assert f"[{r.point.source}]" in row[3]
        assert row[-1] == "yes" or not r.point.reason or r.point.reason in row[-1]
    inside = sum(r.is_inside for r in compared())
    assert f"{inside} of {len(points())} are within" in figure.caption


def test_the_picture_shows_tread_pressure_load_contact_and_drag():
    panels = make("W.1").panels
    assert [p.title.split(":")[0] for p in panels] == [
        "Tread", "Pressure", "Load", "Contact", "Drag of both front wheels",
    ]  # fmt: skip
    drawn = sum(line.x.size for line in panels[0].lines if line.mode == "markers")
    assert drawn == sum(p.quantity == "full_speed" for p in points())
    for panel in panels:
        assert any(line.mode == "markers" for line in panel.lines), panel.title
        assert all(np.isfinite(line.y).any() for line in panel.lines)
