"""Colours of the pages: text can be read on every ground it stands on, in light, dark and print [WCAG 2.2, 1.4.3]."""

import re
from pathlib import Path

import pytest

import aqualog.report
from aqualog.report.theme import LIGHT

CSS = (Path(aqualog.report.__file__).parent / "templates" / "page.css").read_text(encoding="utf-8")
TEXT = ("ink", "muted", "full", "partial", "good", "accent")
ENOUGH = 4.5
GROUNDS = {
    "ink": ("paper", "ground", "pick", "full-ground", "partial-ground", "good-ground"),
    "muted": ("paper", "ground", "pick", "full-ground", "partial-ground", "good-ground"),
    "full": ("paper", "ground", "pick", "full-ground"),
    "partial": ("paper", "ground", "pick", "partial-ground"),
    "good": ("paper", "ground", "pick", "good-ground"),
    "accent": ("paper", "ground", "pick", "full-ground", "partial-ground", "good-ground"),
}


def luminance(colour):
    digits = colour.lstrip("#")
    full = "".join(2 * d for d in digits) if len(digits) == 3 else digits
    parts = [int(full[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a, b):
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


def schemes():
    """Colours by name of the light, the dark and the printed page; a scheme that sets none has the light one's."""
    roots = [
        dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})", block)) for block in re.findall(r":root \{(.*?)\}", CSS, re.S)
    ]
    light, dark, paper = roots
    return {"light": light, "dark": light | dark, "paper": light | paper, "dark on paper": light | dark | paper}


def test_contrast_is_that_of_the_standard():
    assert contrast("#fff", "#000000") == pytest.approx(21.0)
    assert contrast("#777", "#fff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("scheme", ["light", "dark", "paper", "dark on paper"])
def test_text_can_be_read_on_all_its_grounds(scheme):
    colours = schemes()[scheme]
    pale = {
        (text, ground): round(found, 2)
        for text in TEXT for ground in GROUNDS[text]
        if (found := contrast(colours[text], colours[ground])) < ENOUGH
    }  # fmt: skip
    assert pale == {}


def test_figures_have_the_colours_of_the_page():
    light = schemes()["light"]
    assert {"@ink": light["ink"], "@muted": light["muted"], "@paper": light["paper"]} == LIGHT
