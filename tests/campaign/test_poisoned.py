"""The long batch of `poisoned`, short: it is killed and goes on, and the store is that of one that nobody disturbed."""

import signal
import sys

import pytest

from tests.campaign.poison import hooked
from tests.campaign.poisoned import batch, disturbed, left_in, make, reasons, unlike


@pytest.mark.skipif(sys.platform != "linux", reason="looks at processes in /proc")
@pytest.mark.parametrize(
    "hooks", [(), pytest.param(("crash.csv",), marks=pytest.mark.nightly)], ids=["no logs", "a crash, too"]
)
def test_a_batch_with_poison_in_it_that_is_killed_ends_as_one_that_is_not(tmp_path, hooks):
    count = 30
    campaign = make(tmp_path / "c", count, contents=4, hooks=hooks, are_bombs=False)
    env = {**hooked(tmp_path, MB=1500), "TMPDIR": str(tmp_path / "tmp")}
    (tmp_path / "tmp").mkdir()
    jobs = ("--jobs", "2" if hooks else "1")  # processes take longer to start than these logs
    plain = batch(campaign, tmp_path / "plain", env, *jobs)
    failed = reasons(plain.document)
    assert plain.code == 3
    assert len(failed) == 6 + len(hooks)
    assert plain.document["made"] == count - len(failed)
    assert all("ended without a message" in failed[f"logs/poison_{name}"] for name in hooks)
    again = disturbed(campaign, tmp_path / "killed", env, count, 1, [signal.SIGKILL], *jobs)
    assert again.document["kept"] > 0
    assert reasons(again.document) == failed
    assert not unlike(tmp_path / "plain", tmp_path / "killed")
    assert left_in(tmp_path / "tmp") == []
