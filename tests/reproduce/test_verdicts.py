"""Claims as data, checks as records, and one verdict from several."""

import math
import tomllib
from importlib.resources import files

import pytest

from aqualog.core.errors import ConfigError
from aqualog.figures.record import BORNE_OUT, IN_PART, NOT_BORNE_OUT, Finding
from aqualog.reproduce.catalogue import claims, number_of, read
from aqualog.reproduce.check import Check, Plan, from_finding
from aqualog.reproduce.checks.catalogue import MODULES, WITH_PROCESSES, claims_of, makers
from aqualog.reproduce.checks.findings import JUDGED
from aqualog.reproduce.statistics import bootstrap, ratio_of_counts, share
from aqualog.reproduce.verdict import DIFFERENCE, NEEDS_DATA, NOT_REPRODUCED, REPRODUCED, combined, judged, of_figure

RAW = tomllib.loads(files("aqualog.reproduce").joinpath("claims.toml").read_text(encoding="utf-8"))


def test_all_118_claims_in_their_order():
    found = claims()
    assert [number_of(c) for c in found] == list(range(1, 119))
    assert found["C44"].where == "2.2"
    assert "0.2 m/s²" in found["C44"].statement
    assert found["C117"].kind == "M"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda raw: raw.pop("C7"), "C7"),
        (lambda raw: raw.update(C119=raw["C7"]), "C119"),
        (lambda raw: raw.update(C7={"where": "2", "kind": "A"}), "C7"),
        (lambda raw: raw.update(C7={"where": "2", "kind": "X", "statement": "a"}), "kind X"),
        (lambda raw: raw.update(C7={"where": "2", "kind": "A", "statement": ""}), "C7"),
    ],
)
def test_a_claim_that_is_not_whole_is_refused(change, told):
    raw = {k: dict(v) for k, v in RAW.items()}
    change(raw)
    with pytest.raises(ConfigError, match=told):
        read(raw)


@pytest.mark.parametrize(
    ("found", "one"),
    [
        ([REPRODUCED], REPRODUCED),
        ([REPRODUCED, REPRODUCED], REPRODUCED),
        ([REPRODUCED, DIFFERENCE], DIFFERENCE),
        ([REPRODUCED, NOT_REPRODUCED], DIFFERENCE),
        ([DIFFERENCE, NOT_REPRODUCED], DIFFERENCE),
        ([NOT_REPRODUCED, NOT_REPRODUCED], NOT_REPRODUCED),
        ([NEEDS_DATA], NEEDS_DATA),
        ([NEEDS_DATA, REPRODUCED], DIFFERENCE),
        ([NEEDS_DATA, DIFFERENCE], DIFFERENCE),
        ([NEEDS_DATA, NOT_REPRODUCED], NOT_REPRODUCED),
    ],
)
def test_several_checks_make_one_verdict(found, one):
    assert combined(found) == combined(reversed(found)) == one


def test_a_claim_without_a_check_has_none():
    with pytest.raises(ConfigError, match="without a check"):
        combined([])


def test_words_of_figures():
    assert [of_figure(v) for v in (BORNE_OUT, IN_PART, NOT_BORNE_OUT)] == [REPRODUCED, DIFFERENCE, NOT_REPRODUCED]
    assert [judged(whole=a, part=b) for a, b in ((True, True), (False, True), (False, False))] == [
        REPRODUCED, DIFFERENCE, NOT_REPRODUCED,
    ]  # fmt: skip


def check(**changed):
    return Check(**{"claim": "C7", "criterion": "a", "found": "b", "verdict": REPRODUCED, **changed})


@pytest.mark.parametrize(
    "changed",
    [
        {"claim": "7"},
        {"claim": "C7 (part)"},
        {"verdict": DIFFERENCE},
        {"verdict": NOT_REPRODUCED},
        {"verdict": NEEDS_DATA},
        {"value": math.nan},
        {"ci95": (1.0, 0.0)},
        {"ci95": (math.nan, 1.0)},
    ],
)
def test_a_check_that_says_nothing_is_refused(changed):
    check()
    with pytest.raises(ConfigError, match="check of"):
        check(**changed)


def test_a_finding_becomes_a_check():
    finding = Finding("C104 (phase)", "says", "criterion", "found", IN_PART, "because", 1.5)
    made = from_finding(finding, "3.6")
    assert (made.claim, made.part, made.verdict, made.value) == ("C104", "phase", DIFFERENCE, 1.5)
    assert (made.statement, made.reason, made.source) == ("says", "because", "figure 3.6")
    plain = from_finding(Finding("C9", "s", "c", "f", NOT_BORNE_OUT, value=math.inf), "2.1")
    assert (plain.part, plain.value) == ("", None)
    assert plain.reason
    with pytest.raises(ConfigError, match="not about a claim"):
        from_finding(Finding("E7", "s", "c", "f", BORNE_OUT), "2.1")


def test_every_module_is_about_claims_that_there_are():
    assert claims_of(MODULES) <= set(claims())
    assert set(WITH_PROCESSES) <= set(MODULES)
    mine = {
        *(1, 2, 6, 7, 8, 9, 10, 11, 24, 25, 26, 27, 30, 31, 32, 34, 35, 36, 46, 56, 57, 58), *range(64, 70), 71,
        *range(79, 119),
    }  # fmt: skip
    assert {f"C{n}" for n in mine} <= claims_of(MODULES)
    for module in MODULES:
        for ids, make in makers(module):
            assert ids
            assert callable(make)


def test_figures_without_a_campaign_judge_the_claims_that_are_listed():
    import re
    from pathlib import Path

    import aqualog.figures
    from aqualog.figures.record import stem_of

    folder = Path(aqualog.figures.__file__).parent
    for number, listed in JUDGED.items():
        source = (folder / f"{stem_of(number).replace('figure', 'fig')}.py").read_text(encoding="utf-8")
        named = set(re.findall(r'^ *"(C\d+)(?: \(.+\))?",$', source, flags=re.MULTILINE))
        assert named == set(listed), number


def test_plan_gives_the_first_seeds():
    assert Plan(range(5, 9)).first(2) == (5, 6)
    assert Plan(range(5, 7)).first(9) == (5, 6)


def test_intervals():
    x = [1.0] * 10 + [3.0] * 10
    low, high = bootstrap(x)
    assert low < 2.0 < high
    assert bootstrap(x) == (low, high)
    assert ratio_of_counts(3, 0) is None
    low, high = ratio_of_counts(2, 20)
    assert low < 0.1 < high < 0.5
    assert share(17, 20) == "17 of 20 (64 to 95 %)"
