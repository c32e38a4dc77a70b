"""What the README says exists, and what exists is in the README."""

import re

import pytest
from conftest import ROOT

from aqualog.config.scenario import SCENARIO_KEYS
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.model.effects import EFFECTS
from aqualog.model.empirical import EMPIRICAL
from aqualog.model.tyre import TYRE_KEYS
from aqualog.notation import ACCEPTED, SYMBOLS
from aqualog.vehicle import KEYS

README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("key", list(KEYS.values()), ids=lambda k: k.path)
def test_vehicle_keys_with_their_defaults(key):
    assert f"| `{key.path}` | {key.unit} | {key.default:g} |" in README


@pytest.mark.parametrize("name", [*SYMBOLS, *ACCEPTED])
def test_signals(name):
    stem = re.sub(r"_(fl|fr|rl|rr)$", "", name)
    assert f"`{name}`" in README or f"`{stem}_fl ... rr`" in README


@pytest.mark.parametrize(
    "command",
    [
        "detect", "inspect", "convert", "align", "simulate", "figures", "slip-slope", "calibrate", "evaluate", "batch",
        "bin-slipslope", "bin-resistance", "report", "reproduce", "campaign", "cache", "plan",
    ],
)  # fmt: skip
def test_commands(command):
    assert f"`{command} " in README


def test_links_and_pictures_exist():
    for target in re.findall(r"\]\((?!#)([^)]+)\)", README):
        assert (ROOT / target).exists(), target


def test_detectors_of_the_contract_are_explained():
    from aqualog.detect.needs import DETECTORS

    for name in DETECTORS:
        assert f"`{name}`" in README


def test_tuning_of_the_slip_slope():
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| ([^|]+) \|", README, re.M)
    said = {}
    for names, values in rows:
        numbers = [float(x) for x in re.findall(r"\d[\d.]*(?:e-?\d+)?", values)]
        said |= dict(zip(re.findall(r"`(\w+)`", names), numbers, strict=False))
    for name, value in TUNING._asdict().items():
        if name != "adapted":
            assert said[name] == pytest.approx(value), name


@pytest.mark.parametrize("key", list(SCENARIO_KEYS.values()), ids=lambda k: k.path)
def test_scenario_keys(key):
    default = "" if key.default is None else f"`{key.default}`" if isinstance(key.default, str) else f"{key.default:g}"
    assert f"| `{key.path}` | {key.unit} | {default} | {key.meaning} |" in README


@pytest.mark.parametrize("key", list(TYRE_KEYS.values()), ids=lambda k: k.name)
def test_tyre_keys(key):
    assert f"| `{key.name}` | {key.unit} | {key.default:g} | {key.meaning} | {key.source} |" in README


@pytest.mark.parametrize("effect", list(EFFECTS.values()), ids=lambda e: e.name)
def test_effects(effect):
    assert f"| `{effect.name}` | {effect.target} |" in README
    for p in effect.parameters:
        assert f"`{p.name}` [{p.unit}] ({p.neutral:g})" in README


@pytest.mark.parametrize("effect", list(EMPIRICAL.values()), ids=lambda e: e.name)
def test_functions_of_a_model(effect):
    t = effect.table
    assert f"| `{effect.name}` | {effect.target} | `knots`: {t.x} [{t.x_unit}], value [{t.unit}] (none) |" in README


def test_keys_of_a_campaign():
    from aqualog.campaign.records import GROUP_NAMES
    from aqualog.config.campaign import RUN_KEYS

    for name in (*RUN_KEYS, *GROUP_NAMES):
        assert f"`{name}`" in README, name
