"""One channel has one rate: in the list of channels, on the grid, in the document and on the page."""

import numpy as np
import pytest

import aqualog as aq

MEAN_HZ = 82.9


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Stamps that jitter: most steps are shorter than their mean; a pause of 2 s."""
    path = tmp_path_factory.mktemp("rates") / "a.csv"
    steps = np.where(np.arange(1500) % 3 < 2, 0.93, 1.14) / MEAN_HZ
    t = np.cumsum(steps)
    t[750:] += 2.0
    speed = 20.0 + 0.01 * np.sin(t)
    names = ["a_x [m/s^2]", *(f"omega_{w} [rad/s]" for w in ("fl", "fr", "rl", "rr"))]
    rows = [f"{a:.6f},{0.1 * np.sin(a):.6f}," + ",".join([f"{s / 0.3:.6f}"] * 4) for a, s in zip(t, speed, strict=True)]
    path.write_text("\n".join([",".join(["t [s]", *names]), *rows]) + "\n")
    return path


def test_one_rate_everywhere(log, tmp_path):
    listed = {c["rate_hz"] for c in aq.inspect(log).document["channels"]}
    found = aq.detect(log)
    document = found.document
    rates = listed | {document["sample_rate_hz"]} | {s["rate_hz"] for s in document["signals"].values()}
    (shown,) = {f"{r:.4g}" for r in rates}
    assert float(shown) == pytest.approx(MEAN_HZ, rel=1e-3)
    page = next(p for p in found.save(tmp_path) if p.suffix == ".html").read_text(encoding="utf-8")
    assert f"{shown} Hz" in page
    assert page.count("<td>82.9</td>") + page.count(">82.9<") >= 5
