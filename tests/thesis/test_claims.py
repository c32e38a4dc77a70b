"""Claims as data, checks as records, and one verdict from several."""

import math
import tomllib
from importlib.resources import files

import pytest

from aqualog.core.errors import ConfigError
from aqualog.thesis import claims as said
from aqualog.thesis.catalogue import rows
from aqualog.thesis.evidence.seeds import Plan, bootstrap, ratio_of_counts, share
from aqualog.thesis.run import makers

RAW = tomllib.loads(files("aqualog.thesis").joinpath("claims.toml").read_text(encoding="utf-8"))


def test_all_118_claims_in_their_order():
    found = said.claims()
    assert [said.number_of(c) for c in found] == list(range(1, 119))
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
        said.read(raw)


@pytest.mark.parametrize(
    ("found", "one"),
    [
        ([said.REPRODUCED], said.REPRODUCED),
        ([said.REPRODUCED, said.REPRODUCED], said.REPRODUCED),
        ([said.REPRODUCED, said.DIFFERENCE], said.DIFFERENCE),
        ([said.REPRODUCED, said.NOT_REPRODUCED], said.DIFFERENCE),
        ([said.DIFFERENCE, said.NOT_REPRODUCED], said.DIFFERENCE),
        ([said.NOT_REPRODUCED, said.NOT_REPRODUCED], said.NOT_REPRODUCED),
        ([said.NEEDS_DATA], said.NEEDS_DATA),
        ([said.NEEDS_DATA, said.REPRODUCED], said.DIFFERENCE),
        ([said.NEEDS_DATA, said.DIFFERENCE], said.DIFFERENCE),
        ([said.NEEDS_DATA, said.NOT_REPRODUCED], said.NOT_REPRODUCED),
    ],
)
def test_several_checks_make_one_verdict(found, one):
    assert said.combined(found) == said.combined(reversed(found)) == one


def test_a_claim_without_a_check_has_none():
    with pytest.raises(ConfigError, match="without a check"):
        said.combined([])


def test_a_criterion_and_its_weaker_form():
    assert [said.judged(whole=a, part=b) for a, b in ((True, True), (False, True), (False, False))] == [
        said.REPRODUCED, said.DIFFERENCE, said.NOT_REPRODUCED,
    ]  # fmt: skip


def check(**changed):
    return said.Check(**{"claim": "C7", "criterion": "a", "found": "b", "verdict": said.REPRODUCED, **changed})


@pytest.mark.parametrize(
    "changed",
    [
        {"claim": "7"},
        {"claim": "C119"},
        {"verdict": said.DIFFERENCE},
        {"verdict": said.NOT_REPRODUCED},
        {"verdict": said.NEEDS_DATA},
        {"value": math.nan},
        {"ci95": (1.0, 0.0)},
        {"ci95": (math.nan, 1.0)},
    ],
)
def test_a_check_that_says_nothing_is_refused(changed):
    check()
    with pytest.raises(ConfigError, match="check of"):
        check(**changed)


def test_a_judgement_takes_its_texts_from_the_claim():
    good = said.judge("C73.figure", "soon", whole=True, value=0.3)
    assert (good.name, good.verdict, good.reason) == ("C73", said.REPRODUCED, "")
    assert f"within {said.limit('soon'):g} s in 80% of the runs" in good.criterion
    bad = said.judge("C62.figure_course", "never", value=math.inf)
    assert (bad.name, bad.claim, bad.verdict, bad.value) == ("C62 (course)", "C62", said.NOT_REPRODUCED, None)
    assert bad.reason.startswith("The driver pushes")
    part = said.judge("C115.half_car", "some", part=True)
    assert (part.verdict, part.reason) == (said.DIFFERENCE, "See the numbers.")
    # a criterion without a reason of its own shows what is missing
    assert said.judge("C106.figure", "one", part=True).reason == "The criterion is met only in part; see the number."
    # what is said of every check comes first; some differ by what came out
    sure, open_ = (said.judge("C14.passes", "x", whole=w) for w in (True, False))
    assert sure.reason.endswith("measured; a simulator, whose tyres and water are assumed, can show its shape only. "
                                "The other passes have no spin-down.")  # fmt: skip
    assert open_.reason.endswith("The first ones come at a higher speed.")
    assert said.judge("C89.half_car", "x").reason == "See the numbers."
    assert said.judge("C89.half_car", "x", part=True).reason.startswith("As printed")


def test_every_claim_has_a_criterion_and_something_that_judges_it():
    judged_by = {c for ids in makers() for c in ids.split()}
    drawn = {c for row in rows().values() for c in row.claims}
    for claim in said.claims().values():
        assert claim.criteria
        assert ("figure" in {k.split("_")[0] for k in claim.criteria}) == (claim.id in drawn), claim.id
        assert (set(claim.criteria) - {k for k in claim.criteria if k.startswith("figure")} != set()) == (
            claim.id in judged_by
        ), claim.id


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
