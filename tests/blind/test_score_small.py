"""A few blind cases in every run of the tests: what is large is named, and where nothing is, nothing is."""

from pathlib import Path

import numpy as np
import pytest

from tests.blind.metrics.run import run
from tests.blind.metrics.small import small_jobs
from tests.blind.metrics.store import Store


@pytest.fixture(scope="module")
def rows():
    from tests.blind.metrics.case import work

    made = run(small_jobs(), Store(None), work, processes=1, say=lambda _: None)
    assert not [r.error for r in made if r.error]
    return made


def test_nothing_is_found_where_nothing_is(rows):
    assert [r.verdict for r in rows if not r.truth] == ["no_effect"] * sum(not r.truth for r in rows)


def test_no_name_is_wrong(rows):
    assert not [(r.hidden, r.names) for r in rows if r.wrong]


def test_what_can_be_told_is_named_with_its_size(rows):
    told = [r for r in rows if r.truth and r.truth[0].z >= 8.0 and r.truth[0].p_right >= 0.95]
    assert len(told) >= 2
    for r in told:
        assert r.names == r.hidden
        fact, cause = r.truth[0], r.causes[0]
        name, (value, low, high) = next(iter(cause.values.items()))
        assert low < value < high
        assert value == pytest.approx(fact.values[name], rel=0.25)


def test_what_is_hidden_is_among_what_is_left_open(rows):
    assert all(set(r.hidden) <= r.listed for r in rows if r.truth)


def test_unseen_drives_are_predicted_better(rows):
    assert np.median([r.gain / r.oracle for r in rows if r.truth]) >= 0.8
    assert all(r.worse <= 0.01 for r in rows if not r.truth)


def test_no_reserved_seed_is_used_up():
    assert all(j.spec.seed < 200 for j in small_jobs())


def test_the_score_reads_the_truth_only_from_the_spec():
    # what is diagnosed is the log and the vehicle file: nothing of the case goes into the call but these
    text = (Path(__file__).parent / "metrics" / "case.py").read_text(encoding="utf-8")
    call = text[text.index("    return diagnose(") :].split("\n\n")[0]
    assert not any(x in call for x in ("truth", "spec", "hidden"))
