"""A short turn of the fuzzer: any damage of small MDF files ends in the right values or in a clear error, soon."""

import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz import mdf
from tests.fuzz.corpus import cases
from tests.fuzz.damage import NUMBERS, damaged
from tests.fuzz.registry import SECONDS

TARGET = mdf.mdf()
PLACE = st.integers(0, 20_000)
DAMAGE = st.one_of(
    st.tuples(st.just("cut"), st.integers(1, 9000)),
    st.tuples(st.just("flip"), PLACE, st.integers(0, 7)),
    st.tuples(st.just("zero"), PLACE, st.sampled_from([1, 8, 64, 500])),
    st.tuples(st.just("swap"), PLACE, PLACE, st.sampled_from([1, 8, 24, 160])),
    st.tuples(st.just("number"), PLACE.map(lambda x: x // 8 * 8), st.sampled_from([1, 2, 4, 8]), st.sampled_from(NUMBERS) | PLACE),
    st.tuples(st.just("copy"), PLACE.map(lambda x: x // 8 * 8), PLACE.map(lambda x: x // 8 * 8)),
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


def verdict(name, damages, folder):
    path = folder / "case.mf4"
    path.write_bytes(damaged(mdf._whole(name, folder)[0], damages))
    begin = time.monotonic()
    found = TARGET.judge(name, damages, path)
    return found or ("hangs" if time.monotonic() - begin > SECONDS else None)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.sampled_from(sorted(mdf.MAKERS)), damages=st.lists(DAMAGE, min_size=1, max_size=3).map(tuple))
def test_any_damage(folder, capfd, name, damages):
    assert verdict(name, damages, folder) is None
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("name", "damages"), cases("mdf"))
def test_what_has_been_found_before(folder, name, damages):
    assert verdict(name, damages, folder) is None


@pytest.mark.parametrize("name", ["plain", "deflated", "version3", "streamed", "streamed_deflated", "unsorted"])
def test_every_cut_gives_what_precedes_it(folder, name):
    size = len(mdf._whole(name, folder)[0])
    for cut in range(1, size, max(size // 12, 1)):
        assert verdict(name, (("cut", cut),), folder) is None


def test_the_judge_sees_a_wrong_value_and_a_silent_loss(folder, monkeypatch):
    mdf._whole("plain", folder)
    found, faults = mdf.read(folder / "whole_plain.mf4")
    name = next(iter(found))
    t, values = found[name]
    for other in ({**found, name: (t, values + 1)}, {**found, name: (t + 1, values)}, {k: v for k, v in found.items() if k != name}):  # fmt: skip
        monkeypatch.setattr(mdf, "read", lambda _, other=other: (other, faults))
        assert TARGET.judge("plain", (("cut", 1),), folder / "case.mf4")
