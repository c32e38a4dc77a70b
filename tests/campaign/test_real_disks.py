"""The store on disks that are really full, read-only or gone; these need the right to mount."""

import shutil
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from aqualog.campaign import batch
from aqualog.campaign.batch import run_batch
from aqualog.campaign.store import Store
from aqualog.config.configured import configure
from aqualog.core.errors import AqualogError
from tests.campaign.made import make_campaign


def mounts(*arguments):
    return subprocess.run(["mount", *map(str, arguments)], capture_output=True).returncode == 0


@contextmanager
def disk(folder, *options):
    """A disk of its own in a folder, taken away at the end if it is still there."""
    folder.mkdir(exist_ok=True)
    if sys.platform != "linux" or not shutil.which("mount") or not mounts("-t", "tmpfs", *options, "none", folder):
        pytest.skip("needs the right to mount")
    try:
        yield folder
    finally:
        gone(folder)


def gone(folder):
    """As a network disk that is lost: what has it open keeps it, whoever looks finds the folder under it."""
    subprocess.run(["umount", "-l", str(folder)], capture_output=True)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return make_campaign(tmp_path_factory.mktemp("disks"), speeds=(80, 100), repeats=4)


def after(count, monkeypatch, act):
    """Let something happen before the log of that number is read."""
    real = batch.load_drive
    seen = []

    def reads(logs, **options):
        seen.append(logs)
        if len(seen) == count:
            act()
        return real(logs, **options)

    monkeypatch.setattr(batch, "load_drive", reads)


def made_in(store):
    return len(Store(store).keys()[0])


def test_a_full_disk(campaign, tmp_path):
    with disk(tmp_path / "disk", "-o", "size=100k") as place:
        with pytest.raises(AqualogError, match=r"disk/s: no space left on device; expected room") as caught:
            run_batch(configure(campaign), Store(place / "s"))
        assert caught.value.exit_code == 1
        there = made_in(place / "s")
        assert 0 < there < 8
        assert not list(place.rglob("*.tmp"))
        assert mounts("-o", "remount,size=10m", place)
        assert run_batch(configure(campaign), Store(place / "s")).kept == there
        assert made_in(place / "s") == 8


@pytest.mark.parametrize("name", ["s", "."])
def test_a_disk_that_is_read_only(campaign, tmp_path, name):
    with (
        disk(tmp_path / "disk", "-o", "ro") as place,
        pytest.raises(AqualogError, match=r"disk/.*: cannot be written \(Read-only file system\)"),
    ):
        run_batch(configure(campaign), Store(place / name))


@pytest.mark.parametrize("is_under", [False, True], ids=["nothing under it", "another store under it"])
def test_a_store_whose_disk_goes_is_not_begun_anew_in_its_place(campaign, tmp_path, monkeypatch, is_under):
    """Under a disk that is gone there is its mount point, to which anybody can write."""
    (tmp_path / "disk").mkdir()
    if is_under:
        with pytest.MonkeyPatch.context() as patch:
            after(1, patch, lambda: pytest.fail("no log is read"))
            with Store(tmp_path / "disk" / "s").held(must=True):
                pass
    with disk(tmp_path / "disk") as place:
        after(4, monkeypatch, lambda: gone(place))
        expected = "3 results that were written are missing" if is_under else "is gone; expected the folder in which"
        with pytest.raises(AqualogError, match=rf"disk/s: {expected}") as caught:
            run_batch(configure(campaign), Store(place / "s"))
    assert caught.value.exit_code == 1
    assert (tmp_path / "disk" / "s").exists() == is_under


def test_logs_whose_disk_goes_are_tried_again(campaign, tmp_path, monkeypatch):
    with disk(tmp_path / "disk") as place:
        shutil.copytree(campaign.parent, place / "c")
        after(4, monkeypatch, lambda: gone(place))
        outcome = run_batch(configure(place / "c" / "campaign.toml"), Store(tmp_path / "s"))
    assert (outcome.made, len(outcome.failed)) == (3, 5)
    assert all("No such file or directory" in reason for reason in outcome.failed.values())
    assert not list((tmp_path / "s" / "failed").iterdir())
    with disk(tmp_path / "disk") as place:
        shutil.copytree(campaign.parent, place / "c")
        monkeypatch.undo()
        assert run_batch(configure(place / "c" / "campaign.toml"), Store(tmp_path / "s")).made == 5


@pytest.mark.parametrize("step_s", [-10 * 365 * 86400.0, 86400.0], ids=["back", "on"])
def test_a_clock_that_is_set_while_it_works(campaign, tmp_path, monkeypatch, step_s):
    """Neither results nor what is new depend on the time of day."""
    run_batch(configure(campaign), Store(tmp_path / "plain"))
    real, real_ns = time.time, time.time_ns

    def sets():
        monkeypatch.setattr(time, "time", lambda: real() + step_s)
        monkeypatch.setattr(time, "time_ns", lambda: real_ns() + int(step_s * 1e9))

    after(4, monkeypatch, sets)
    assert run_batch(configure(campaign), Store(tmp_path / "s")).made == 8
    assert run_batch(configure(campaign), Store(tmp_path / "s")).kept == 8
    for path in (tmp_path / "plain").rglob("*"):
        if path.is_file() and path.name != "lock":
            assert (tmp_path / "s" / path.relative_to(tmp_path / "plain")).read_bytes() == path.read_bytes()
