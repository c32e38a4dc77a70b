"""Files that a user writes are read whole, or refused before they are: a device may have no end."""

import os
from pathlib import Path

import pytest

from aqualog.campaign.run_table import read_table
from aqualog.config.labels import load_labels
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError, LogError
from aqualog.io.can import load_dbc
from aqualog.io.user_file import read_small

LOADERS = {
    "toml": load_vehicle, "labels": load_labels, "runs": lambda p: read_table(p, key="log"),
    "dbc": lambda p: load_dbc([p]),
}  # fmt: skip


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no such device on this system")
@pytest.mark.parametrize("name", LOADERS)
def test_a_device_is_refused(name):
    with pytest.raises((ConfigError, LogError), match=r"/dev/zero: .*a device or a pipe"):
        LOADERS[name](Path("/dev/zero"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names on this system")
@pytest.mark.parametrize("name", LOADERS)
def test_a_pipe_is_refused(name, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises((ConfigError, LogError), match="a device or a pipe"):
        LOADERS[name](tmp_path / "pipe")


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda p: None, "labels file not found"), (lambda p: p.mkdir(), "labels file is a folder; expected a CSV file"),
        (lambda p: p.write_bytes(bytes(2**20 + 1)), "labels file is larger than 1 MiB; expected a CSV file"),
    ],
)  # fmt: skip
def test_what_is_no_such_file_is_told(make, told, tmp_path):
    make(tmp_path / "a.csv")
    with pytest.raises(ConfigError) as error:
        read_small(tmp_path / "a.csv", what="labels file", expected="a CSV file", largest=2**20)
    assert told in error.value.line()


def test_the_content_as_it_is(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbfa\r\n")
    assert read_small(tmp_path / "a.csv", what="", expected="", largest=2**20) == b"\xef\xbb\xbfa\r\n"


@pytest.mark.parametrize("line", ["a = {{{}}}", "[{}]", "[[{}]]", "{} = 1"])
@pytest.mark.parametrize("part", ["a", '"a.b"', "' '", "a-1 "])
def test_a_key_of_very_many_parts_is_refused_at_once(tmp_path, line, part):
    text = line.format(".".join([part] * 50_000) + ("= 1" if "{{" in line else ""))
    (tmp_path / "car.toml").write_text(text)
    with pytest.raises(ConfigError, match="more than 100 parts"):
        load_vehicle(tmp_path / "car.toml")


def test_of_very_many_faults_the_first_are_told(tmp_path):
    (tmp_path / "car.toml").write_text("\n".join(f"k{i} = 1" for i in range(20_000)))
    with pytest.raises(ConfigError) as error:
        load_vehicle(tmp_path / "car.toml")
    line = error.value.line()
    assert "k19" in line
    assert "k20" not in line
    assert line.endswith("and 19980 more")


def test_a_long_key_is_shown_in_part(tmp_path):
    (tmp_path / "car.toml").write_text("k" * 100_000 + " = 1")
    with pytest.raises(ConfigError) as error:
        load_vehicle(tmp_path / "car.toml")
    assert len(error.value.line()) < 300 + len(str(tmp_path))
