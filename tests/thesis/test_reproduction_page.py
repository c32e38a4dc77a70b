"""The page of a reproduction, and how verdicts come together; made-up checks, real small figures."""

import csv
import io
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from aqualog.cli.main import app
from aqualog.core.errors import ConfigError
from aqualog.thesis.claims import DIFFERENCE, NEEDS_DATA, NOT_REPRODUCED, REPRODUCED, VERDICTS, Check, claims
from aqualog.thesis.export import claims_csv, claims_document, counts_of
from aqualog.thesis.page import render_reproduction
from aqualog.thesis.record import Axis, Figure, Line, Panel
from aqualog.thesis.run import Made, conclude
from tests.headless import severe, wait_for

HOSTILE = "</script><img src=x onerror=\"document.body.dataset.hit='1'\">"


def figure(number, verdict, claim):
    x = np.linspace(0.0, 1.0, 20)
    panel = Panel("panel", Axis("v", "km/h"), Axis("slip"), (Line("line", x, x * x),))
    check = Check(claim, "crit", f"found {HOSTILE}", verdict, reason="" if verdict == REPRODUCED else "why")
    return Figure(number, "title", "caption", (panel,), (check,))


def made():
    checks = [
        Check(name, "criterion", "found", VERDICTS[i % 4], reason="because", value=1.5, ci95=(1.0, 2.0), unit="m/s^2")
        for i, name in enumerate(claims())
    ]
    figures = (figure("2.3", REPRODUCED, "C1"), figure("3.5", NOT_REPRODUCED, "C2"))
    return Made(figures, tuple(checks), {"2.4": f"no runs {HOSTILE}"})


@pytest.fixture(scope="module")
def page():
    m = made()
    return render_reproduction(conclude(m), m.figures, m.missing, ["a fact"])


def test_every_claim_has_one_verdict_from_its_checks_and_figures():
    found = conclude(made())
    of = {c.claim.id: c.verdict for c in found}
    assert list(of) == list(claims())
    assert (of["C1"], of["C2"], of["C3"], of["C4"]) == (REPRODUCED, DIFFERENCE, NOT_REPRODUCED, NEEDS_DATA)
    assert sum(counts_of(found).values()) == 118
    spoilt = Made((figure("2.3", NOT_REPRODUCED, "C1"),), made().checks, {})
    assert conclude(spoilt)[0].verdict == DIFFERENCE


def test_a_claim_that_nothing_judges_is_an_error():
    m = made()
    with pytest.raises(ConfigError, match="C118"):
        conclude(Made(m.figures, m.checks[:-1], m.missing))


def test_page_has_all_claims_numbers_and_missing_figures(page):
    for name in claims():
        assert f'id="{name}"' in page
    assert "1.5 [1, 2] m/s²" in page
    assert 'href="#figure_2_03"' in page
    assert page.count("<script>") == 2
    assert "no runs &lt;/script&gt;" in page


def test_page_is_the_same_for_the_same_results(page):
    m = made()
    assert render_reproduction(conclude(m), m.figures, m.missing, ["a fact"]) == page


def test_documents():
    m = made()
    found = conclude(m)
    whole = json.loads(json.dumps(claims_document(found, m.figures, m.missing, {"conditions": ["a"]}), allow_nan=False))
    assert len(whole["claims"]) == 118
    assert whole["figures_missing"].keys() == {"2.4"}
    rows = list(csv.DictReader(io.StringIO(claims_csv(found))))
    assert len(rows) == 120  # two of the figures
    assert {r["claim"] for r in rows} == set(claims())


@pytest.mark.browser
def test_page_in_the_browser(page, tmp_path, browser):
    path = tmp_path / "index.html"
    path.write_text(page, encoding="utf-8")
    browser.get(path.as_uri())
    wait_for(lambda: browser.execute_script("return document.body.dataset.ready === 'true'"))
    assert browser.execute_script("return document.body.dataset.hit") is None
    assert len(browser.find_elements("css selector", ".plot .main-svg")) >= 2
    shown = "return document.querySelectorAll('#claims tbody:not([hidden])').length"
    assert browser.execute_script(shown) == 118
    browser.find_element("css selector", ".chip.reproduced").click()
    without = browser.execute_script(shown)
    assert without == 118 - counts_of(conclude(made()))[REPRODUCED]
    browser.find_element("id", "search").send_keys("C118")
    assert browser.execute_script(shown) == 1
    assert "1 of 118" in browser.find_element("id", "shown").text
    assert severe(browser) == []


def test_results_are_not_overwritten(tmp_path):
    (tmp_path / "index.html").write_text("mine")
    result = CliRunner().invoke(app, ["reproduce", "-o", str(tmp_path)])
    assert result.exit_code == 2
    assert "exists already" in result.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["index.html"]
