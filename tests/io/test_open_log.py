"""Which folders are one recording."""

import os
from pathlib import Path

import polars as pl
import pytest

from aqualog.core.errors import LogError
from aqualog.face.arguments import expand
from aqualog.io.fingerprint import hash_of
from aqualog.io.open_log import open_log, sniff

ONE = (["a_0.mcap", "a_1.mcap"], ["a.db3"], ["a.mcap"], ["a_0.db3", "notes.txt"], ["metadata.yaml"])
SEVERAL = (
    ["a.mcap", "b.mcap"], ["run_1.mcap", "run_2.mcap"], ["a_0.mcap", "b_1.mcap"], ["a_0.mcap", "a_0.db3"],
    ["a_0.mcap", "gps.csv"], ["a.db3", "a.mf4"], ["a_0.mcap", "a_2.mcap"], [],
)  # fmt: skip


def fill(folder, names):
    for name in names:
        (folder / name).write_bytes(b"\x89MCAP0\r\n")


@pytest.mark.parametrize("names", ONE)
def test_a_recording_in_parts_is_one(names, tmp_path):
    fill(tmp_path, names)
    assert sniff(tmp_path) == "ros"


@pytest.mark.parametrize("names", SEVERAL)
def test_a_folder_of_drives_is_none(names, tmp_path):
    fill(tmp_path, names)
    with pytest.raises(LogError, match="folder without a ROS 2 bag"):
        sniff(tmp_path)
    if names:
        assert [p.name for p in expand([str(tmp_path)])] == sorted(names)


def test_a_name_that_is_no_text(tmp_path):
    """Bytes that are not UTF-8: a hash takes them, and Parquet, whose library does not, says so."""
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/bad\xff.parquet"))
    pl.DataFrame({"t": [0.0, 0.1], "v_x": [1.0, 2.0]}).write_parquet(tmp_path / "good.parquet")
    (tmp_path / "good.parquet").rename(path)
    assert len(hash_of([str(path)])) == len(hash_of(["good"]))
    with pytest.raises(LogError, match="its name is not UTF-8"):
        open_log(path)


@pytest.mark.parametrize("suffix", [".mf4", ".parquet", ".csv"])
def test_a_file_that_is_still_empty_space_is_not_taken_for_text(suffix, tmp_path):
    (tmp_path / f"a{suffix}").write_bytes(bytes(100_000))
    with pytest.raises(LogError, match=r"begins with \d+ NUL bytes; expected a log\. Try: wait for the copy"):
        open_log(tmp_path / f"a{suffix}")
