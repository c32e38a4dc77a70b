"""Pages and tables of figures and of a reproduction as text: nothing from outside, the same every time, units in every header."""

import base64
import csv
import hashlib
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from aqualog.cli.main import app
from aqualog.core.errors import ConfigError
from aqualog.thesis.catalogue import WITHOUT
from aqualog.thesis.claims import DIFFERENCE, NEEDS_DATA, NOT_REPRODUCED, REPRODUCED, VERDICTS, Check, claims
from aqualog.thesis.draw import panel_figure, rounded
from aqualog.thesis.export import claims_csv, claims_document, counts_of, figure_csv, figures_document
from aqualog.thesis.page import panel_ids, render_figures, render_reproduction
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table
from aqualog.thesis.run import Made, conclude, make
from tests.headless import severe, wait_for
from tests.thesis.made import all_made, made


@pytest.fixture(scope="module")
def page():
    return render_figures(all_made(), title="all")


def island(page):
    return json.loads(re.search(r'<script type="application/json" id="figure-data">(.*?)</script>', page, re.DOTALL)[1])


def test_page_has_each_plot_and_each_claim_once_in_the_table(page):
    ids = [i for f in all_made() for i in panel_ids(f)]
    assert list(island(page)) == ids
    assert len(ids) == len(set(ids))
    for i in ids:
        assert page.count(f'id="{i}"') == 1
    table = re.search(r'<table id="claims">.*?</table>', page, re.DOTALL)[0]
    assert re.findall(r'<td class="claim">(.*?)</td>', table) == [c.name for f in all_made() for c in f.checks]
    for f in all_made():
        assert f'<section id="{f.stem}"' in page


def test_scripts_are_those_of_the_policy_and_plotly_is_there_once(page):
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert len(scripts) == 2
    policy = re.search(r'http-equiv="Content-Security-Policy" content="(.*?)"', page)[1].replace("&#39;", "'")
    for s in scripts:
        digest = base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy
    assert policy.count("'sha256-") == 2
    assert policy.startswith("default-src 'none'")
    assert page.count("plotly.js v") == 1
    # apart from plotly.js itself
    rest = page.replace(scripts[0], "")
    assert not re.search(r"https?://|src=|@import|url\(", rest)


def test_page_is_the_same_every_time():
    assert render_figures([made("3.3")], title="x") == render_figures([make("3.3")], title="x")


def test_single_page_has_no_table_of_all_claims():
    page = render_figures([made("3.1")], title="x")
    assert 'id="claims"' not in page
    assert "C81" in page
    assert "reproduced" in page


def hostile():
    bad = "</script><img src=x onerror=alert(1)>"
    line = Line(bad, np.array([0.0, 1.0]), np.array([1.0, np.nan]))
    return Figure(
        "3.1", bad, bad, (Panel(bad, Axis(bad), Axis("y"), (line,)),), (Check("C1", bad, bad, DIFFERENCE, bad, bad, unit=bad, reason=bad),),
        (Table(bad, (bad, "a"), ((bad, "1"),)),),
    )  # fmt: skip


def test_names_cannot_leave_their_place():
    page = render_figures([hostile(), hostile()], title="</title><b>")
    assert "<img" not in page
    assert "<b>" not in re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert island(page)["figure_3_01_a"]["data"][0]["y"] == [1.0, None]


@pytest.mark.parametrize("number", WITHOUT)
def test_table_has_units_and_the_numbers_that_are_drawn(number):
    figure = made(number)
    rows = list(csv.reader(io.StringIO(figure_csv(figure))))
    header = rows[0]
    assert all(re.search(r"\[(-|%|s|N|mm|bar|km/h|1e-3 s|m/s|m/s\^2|\(m/s\^2\)\^2)\]$", name) for name in header), (
        header
    )
    assert {len(r) for r in rows} == {len(header)}
    columns = list(zip(*rows[1:], strict=True))
    for i, panel in enumerate(figure.panels):
        letter = f"({'abcdef'[i]}) " if len(figure.panels) > 1 else ""
        axis = panel.y
        for line in panel.lines:
            at = header.index(f"{letter}{line.name}: {axis.title}")
            column = columns[at]
            values = [float(v) if v else None for v in column[: line.y.size]]
            assert values == rounded(line.y)
            assert not any(column[line.y.size :])
            of_x = f"{letter}{line.name}: {panel.x.title}" if panel.z else f"{letter}{panel.x.title}"
            x = columns[max(i for i in range(at) if header[i] == of_x)]
            assert [float(v) for v in x[: line.x.size]] == rounded(line.x)


def test_first_column_of_runs_is_time():
    assert figure_csv(made("3.6")).split(",")[0] == "(a) t [s]"


def test_document_is_json():
    text = json.dumps(figures_document(all_made(), ["a.html"]), allow_nan=False)
    back = json.loads(text)
    assert [f["figure"] for f in back["figures"]] == list(WITHOUT)
    assert back["files"] == ["a.html"]


def test_colours_are_left_to_the_page_and_solid_panels_are_solid():
    for f in all_made():
        for p in f.panels:
            figure = panel_figure(p)
            assert figure["layout"]["font"]["color"] == "@ink"
            kinds = {t["type"] for t in figure["data"]}
            assert kinds <= ({"scatter3d", "surface"} if p.z else {"scatter"})


HOSTILE_FOUND = "</script><img src=x onerror=\"document.body.dataset.hit='1'\">"


def small_figure(number, verdict, claim):
    x = np.linspace(0.0, 1.0, 20)
    panel = Panel("panel", Axis("v", "km/h"), Axis("slip"), (Line("line", x, x * x),))
    check = Check(claim, "crit", f"found {HOSTILE_FOUND}", verdict, reason="" if verdict == REPRODUCED else "why")
    return Figure(number, "title", "caption", (panel,), (check,))


def made_up():
    checks = [
        Check(name, "criterion", "found", VERDICTS[i % 4], reason="because", value=1.5, ci95=(1.0, 2.0), unit="m/s^2")
        for i, name in enumerate(claims())
    ]
    figures = (small_figure("2.3", REPRODUCED, "C1"), small_figure("3.5", NOT_REPRODUCED, "C2"))
    return Made(figures, tuple(checks), {"2.4": f"no runs {HOSTILE_FOUND}"})


@pytest.fixture(scope="module")
def reproduction():
    m = made_up()
    return render_reproduction(conclude(m), m.figures, m.missing, ["a fact"])


def test_every_claim_has_one_verdict_from_its_checks_and_figures():
    found = conclude(made_up())
    of = {c.claim.id: c.verdict for c in found}
    assert list(of) == list(claims())
    assert (of["C1"], of["C2"], of["C3"], of["C4"]) == (REPRODUCED, DIFFERENCE, NOT_REPRODUCED, NEEDS_DATA)
    assert sum(counts_of(found).values()) == 118
    spoilt = Made((small_figure("2.3", NOT_REPRODUCED, "C1"),), made_up().checks, {})
    assert conclude(spoilt)[0].verdict == DIFFERENCE


def test_a_claim_that_nothing_judges_is_an_error():
    m = made_up()
    with pytest.raises(ConfigError, match="C118"):
        conclude(Made(m.figures, m.checks[:-1], m.missing))


def test_page_has_all_claims_numbers_and_missing_figures(reproduction):
    for name in claims():
        assert f'id="{name}"' in reproduction
    assert "1.5 [1, 2] m/s²" in reproduction
    assert 'href="#figure_2_03"' in reproduction
    assert reproduction.count("<script>") == 2
    assert "no runs &lt;/script&gt;" in reproduction


def test_reproduction_is_the_same_for_the_same_results(reproduction):
    m = made_up()
    assert render_reproduction(conclude(m), m.figures, m.missing, ["a fact"]) == reproduction


def test_documents_of_claims():
    m = made_up()
    found = conclude(m)
    whole = json.loads(json.dumps(claims_document(found, m.figures, m.missing, {"conditions": ["a"]}), allow_nan=False))
    assert len(whole["claims"]) == 118
    assert whole["figures_missing"].keys() == {"2.4"}
    rows = list(csv.DictReader(io.StringIO(claims_csv(found))))
    assert len(rows) == 120  # two of the figures
    assert {r["claim"] for r in rows} == set(claims())
    # the number of a figure has its unit and interval there, too
    sized = [replace(k, value=np.float64(0.3), ci95=(0.2, 0.4), unit="m/s^2") for k in m.figures[0].checks]
    m = replace(m, figures=(replace(m.figures[0], checks=tuple(sized)), *m.figures[1:]))
    rows = csv.DictReader(io.StringIO(claims_csv(conclude(m))))
    of_figure = [r for r in rows if r["source"] == f"figure {m.figures[0].number}"]
    assert len(of_figure) == len(sized) > 0
    assert {(r["value"], r["low"], r["high"], r["unit"]) for r in of_figure} == {("0.3", "0.2", "0.4", "m/s^2")}


@pytest.mark.browser
def test_page_in_the_browser(reproduction, tmp_path, browser):
    path = tmp_path / "index.html"
    path.write_text(reproduction, encoding="utf-8")
    browser.get(path.as_uri())
    wait_for(lambda: browser.execute_script("return document.body.dataset.ready === 'true'"))
    assert browser.execute_script("return document.body.dataset.hit") is None
    assert len(browser.find_elements("css selector", ".plot .main-svg")) >= 2
    shown = "return document.querySelectorAll('#claims tbody:not([hidden])').length"
    assert browser.execute_script(shown) == 118
    browser.find_element("css selector", ".chip.reproduced").click()
    without = browser.execute_script(shown)
    assert without == 118 - counts_of(conclude(made_up()))[REPRODUCED]
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
