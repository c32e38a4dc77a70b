"""The README is short, names every command and leads into the book; what the method pages say of tables in the code is so."""

import re

import pytest
from conftest import ROOT

from aqualog.detect.slip_slope.tuning import TUNING

DOCS = ROOT / "aqualog" / "docs"
README = (ROOT / "README.md").read_text(encoding="utf-8")


def commands():
    from typer.main import get_command

    from aqualog.cli.main import app

    return sorted(get_command(app).commands)


def test_the_readme_is_two_screens():
    assert len(README.encode()) <= 12_000


@pytest.mark.parametrize("command", commands())
def test_commands(command):
    assert f"`{command} " in README


def test_links_and_pictures_exist():
    targets = re.findall(r"\]\((?!#|https?:)([^)#]+)[^)]*\)", README)
    assert len(targets) > 20
    for target in targets:
        assert (ROOT / target).exists(), target


def test_the_first_command_is_the_one_that_is_checked():
    command = "aqualog detect sample_logs/lane_drive.mf4 --vehicle sample_logs/vehicle.toml -o"
    assert command.replace("aqualog", ".venv/bin/aqualog", 1) in README.replace("\n", " ")
    run = "".join(p.read_text(encoding="utf-8") for p in (ROOT / ".ci").iterdir())
    assert "detect sample_logs/lane_drive.mf4 --vehicle sample_logs/vehicle.toml" in run.replace('"', "")


def test_every_page_of_the_guide_is_linked():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    for page in (DOCS / "guide").glob("*.md"):
        assert f"](aqualog/docs/guide/{page.name})" in README, page.name
        assert f"](guide/{page.name})" in index, page.name


def test_detectors_of_the_contract_are_explained():
    from aqualog.detect.needs import DETECTORS

    text = (DOCS / "method" / "detectors.md").read_text(encoding="utf-8")
    for name in DETECTORS:
        assert f"`{name}`" in text


def test_tuning_of_the_slip_slope():
    text = (DOCS / "method" / "slip_slope_filter.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| ([^|]+) \|", text, re.M)
    said = {}
    for names, values in rows:
        numbers = [float(x) for x in re.findall(r"\d[\d.]*(?:e-?\d+)?", values)]
        said |= dict(zip(re.findall(r"`(\w+)`", names), numbers, strict=False))
    for name, value in TUNING._asdict().items():
        if name != "adapted":
            assert said[name] == pytest.approx(value), name


def test_keys_of_a_campaign():
    from aqualog.campaign.records import GROUP_NAMES
    from aqualog.config.campaign import RUN_KEYS

    text = "".join((DOCS / p / "campaign.md").read_text(encoding="utf-8") for p in ("guide", "reference"))
    for name in (*RUN_KEYS, *GROUP_NAMES):
        assert f"`{name}`" in text, name
