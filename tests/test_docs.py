"""What the README says exists, and what exists is in the README."""

import re

import pytest
from conftest import ROOT

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


@pytest.mark.parametrize("command", ["detect", "inspect", "convert", "align"])
def test_commands(command):
    assert f"`{command} " in README


def test_links_and_pictures_exist():
    for target in re.findall(r"\]\((?!#)([^)]+)\)", README):
        assert (ROOT / target).exists(), target


def test_detectors_of_the_contract_are_explained():
    from aqualog.detect.needs import DETECTORS

    for name in DETECTORS:
        assert f"`{name}`" in README
