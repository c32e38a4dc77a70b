"""Stores behind URLs: the same files as in a folder, byte for byte, whole, and read by every command.

`other://` is a file system that has no locks and no atomic put, in a folder, by fsspec's own code; with moto and s3fs
installed an S3 server in a process of its own (long).
"""

import json
import os
import re
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import fsspec
import pytest
from fsspec.implementations.local import LocalFileSystem
from fsspec.implementations.memory import MemoryFileSystem

from aqualog.campaign.cluster import asked_of, unlike
from aqualog.campaign.place import Place, Remote, address_of, place_of
from aqualog.campaign.store import Store
from aqualog.core.errors import ConfigError, LogError
from tests.campaign.dask_here import cluster
from tests.campaign.made import make_campaign
from tests.commands import run


class Other(LocalFileSystem):
    """A folder that is reached by another protocol."""

    protocol = "other"

    @classmethod
    def _strip_protocol(cls, path):
        return LocalFileSystem._strip_protocol(str(path).removeprefix("other://"))


class Shaky(Other):
    """The same behind a network that fails."""

    protocol = "shaky"
    fails = ""

    @classmethod
    def _strip_protocol(cls, path):
        return Other._strip_protocol(str(path).removeprefix("shaky://").removeprefix("someone:secret@host"))

    def cat_file(self, path, *args, **kw):
        if "read" in self.fails:
            raise TimeoutError("no answer from someone:secret@host")
        return super().cat_file(path, *args, **kw)

    def rm_file(self, path):
        if not Path(path).exists():
            raise RuntimeError("550 no such file")
        super().rm_file(path)

    def mv(self, *args, **kw):
        if "move" in self.fails:
            raise RuntimeError("connection lost")
        return super().mv(*args, **kw)


for kind in (Other, Shaky):
    fsspec.register_implementation(kind.protocol, kind, clobber=True)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A campaign of four runs and its store in a folder."""
    folder = tmp_path_factory.mktemp("plain")
    campaign = make_campaign(folder, speeds=(80, 100), repeats=2)
    assert run("batch", campaign, "-o", folder / "store").exit_code == 0
    return campaign, folder / "store"


@pytest.fixture(params=["other", "memory"])
def url(request, tmp_path):
    MemoryFileSystem.store.clear()
    MemoryFileSystem.pseudo_dirs[:] = [""]
    return f"other://{tmp_path}/a [1] store" if request.param == "other" else "memory://bucket/store"


@pytest.fixture(autouse=True)
def steady():
    Shaky.fails = ""


def files_of(address):
    """Content of every file of a store but its lock."""
    if isinstance(address, Path):
        found = {p.relative_to(address).as_posix(): p.read_bytes() for p in address.rglob("*") if p.is_file()}
    else:
        fs, root = fsspec.core.url_to_fs(address)
        fs.invalidate_cache()
        paths = [p for p in fs.find(root) if not p.endswith("/")]
        found = {p.removeprefix(root).lstrip("/"): fs.cat_file(p) for p in paths}
    return {n: data for n, data in found.items() if n != "lock"}


def test_a_batch_writes_the_same_store_and_every_command_reads_it(plain, url, tmp_path):
    campaign, store = plain
    first = run("batch", campaign, "-o", url, "--json", "--jobs", "1")
    assert first.exit_code == 0, first.stderr
    assert (json.loads(first.stdout)["made"], json.loads(first.stdout)["store"]) == (4, url)
    assert files_of(url) == files_of(store)
    again = json.loads(run("batch", campaign, "-o", url, "--json").stdout)
    assert (again["made"], again["kept"]) == (0, 4)
    for command in ("bin-slipslope",) if url.startswith("memory") else ("bin-resistance",):
        assert run(command, campaign, "--store", url, "--json").stdout == run(command, campaign, "--store", store, "--json").stdout  # fmt: skip
    left = json.loads(run("plan", campaign, "--store", url, "--json").stdout)
    assert left["logs"]["kept"] == 4
    assert files_of(url) == files_of(store)


@pytest.mark.nightly
def test_pages_and_figures_read_it(plain, url, tmp_path):
    campaign, store = plain
    assert run("batch", campaign, "-o", url, "-q").exit_code == 0
    for name, place in (("there", url), ("here", store)):
        assert run("report", campaign, "--store", place, "-o", tmp_path / name).exit_code == 0
        figure = run("figures", "2.16", "--campaign", campaign, "--store", place, "-o", tmp_path / name / "figures", "--format", "csv")  # fmt: skip
        assert figure.exit_code in (0, 3)
    there, here = files_of(tmp_path / "there"), files_of(tmp_path / "here")
    assert here.keys() == there.keys()
    assert [n for n in here if n.endswith(".csv") and here[n] != there[n]] == []
    assert any(n.endswith(".csv") for n in here)


def test_it_goes_on_where_it_stopped_and_mends_what_is_damaged(plain, url):
    campaign, store = plain
    assert run("batch", campaign, "-o", url, "--shard", "1/2", "-q").exit_code == 0
    assert run("batch", campaign, "-o", url, "--shard", "2/2", "-q").exit_code == 0
    assert not Remote(url).has("runs.parquet")
    assert json.loads(run("batch", campaign, "-o", url, "--json").stdout)["kept"] == 4
    place = Remote(url)
    cut, empty, bits, gone = sorted(place.names("samples"))
    whole = place.read(f"samples/{bits}")
    place.write(f"samples/{cut}", whole[:2000])
    place.write(f"samples/{empty}", b"")
    place.write(f"samples/{bits}", bytes(3000) + whole[3000:])
    place.remove(f"samples/{gone}")
    damaged = Store(url)
    for name in (cut, empty, gone):
        assert not damaged.is_sound(name.removesuffix(".parquet"))
    with pytest.raises(LogError, match="is damaged"):
        damaged.samples(bits.removesuffix(".parquet"))
    assert json.loads(run("batch", campaign, "-o", url, "--json").stdout)["made"] == 4
    found, made = files_of(url), files_of(store)
    assert {n for n in found if n.startswith("parts/")} == {"parts/1-of-2.json", "parts/2-of-2.json"}
    made.pop("contents.json")  # the shards have hashed all logs
    assert {n: data for n, data in found.items() if not n.startswith("parts/")} == made


def test_footers_of_any_length(plain, url, monkeypatch):
    campaign, store = plain
    assert run("batch", campaign, "-o", url, "-q").exit_code == 0
    key = sorted(Store(store).keys()[0])[0]
    about = Store(store).about(key)
    for tail in (12, 100, 5_000, 10**7):
        monkeypatch.setattr("aqualog.campaign.place._TAIL", tail)
        asked = Store(url)
        asked.look_at([key, "no-such-key"])
        assert set(asked._place._footers) == {f"samples/{key}.parquet"}
        assert asked.about(key) == about
        with pytest.raises(LogError):
            asked.about("no-such-key")


def test_copies_are_fetched_ahead_and_go_with_the_store(plain, url):
    campaign, store = plain
    assert run("batch", campaign, "-o", url, "-q").exit_code == 0
    place = Remote(url)
    names = sorted(f"samples/{n}" for n in place.names("samples"))
    place.expect([*names, "samples/none.parquet"])
    paths = [place.copy(n) for n in names]
    assert [p.read_bytes() for p in paths] == [(store / n).read_bytes() for n in names]
    place.remove(names[0])
    assert place.copy(names[0]) == paths[0]
    place.expect(names)
    assert not paths[0].exists()
    with pytest.raises(FileNotFoundError, match=re.escape(names[0])):
        place.copy(names[0])


@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("nowhere://x/store", "is not a place that fsspec supports"),
        ("simplecache::s3://bucket/store", "is a chain of file systems"),
        ("memory://", "names no place"),
        ("lakefs://bucket/store", "needs a package that is not installed (Please install lakefs-spec"),
    ],
)
def test_what_is_no_place_for_a_store(plain, address, text):
    for command in (("batch", plain[0], "-o"), ("bin-slipslope", plain[0], "--store")):
        result = run(*command, address)
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert text in result.stderr


def test_without_fsspec(plain, monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    result = run("batch", plain[0], "-o", "s3://bucket/store")
    assert result.exit_code == 2
    assert "a store behind a URL needs fsspec. Try: pip install 'aqualog[remote]'" in result.stderr


def test_a_folder_imports_no_fsspec(plain):
    code = (
        "import sys; from pathlib import Path; from aqualog.campaign.place import place_of\n"
        "place_of(Path(sys.argv[1])).names(); print(any(m.startswith('fsspec') for m in sys.modules))"
    )
    assert subprocess.check_output([sys.executable, "-c", code, str(plain[1])], text=True) == "False\n"


def test_places_with_other_things_in_them(plain, tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("")
    for name, text in (("file", "is a file"), ("full", "holds other files")):
        result = run("batch", plain[0], "-o", f"other://{tmp_path}/{name}")
        assert result.exit_code == 2
        assert f"other://{tmp_path}/{name}: {text}" in result.stderr
    assert [p.name for p in (tmp_path / "full").iterdir()] == ["thesis.txt"]


def test_memory_is_of_one_process(plain):
    result = run("batch", plain[0], "-o", "memory://bucket/alone", "--limit-s", "60")
    assert result.exit_code == 2
    assert "is in the memory of one process" in result.stderr


def test_memory_that_ends_with_the_command_is_refused(plain, monkeypatch):
    monkeypatch.setattr("aqualog.guard.command._is_command", True)
    for command in (("batch", "-o"), ("bin-slipslope", "--store"), ("plan", "--store")):
        result = run(command[0], plain[0], command[1], "Memory://bucket/gone")
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert "Memory://bucket/gone: is in the memory of this command and would end with it" in result.stderr


def test_nothing_half_written_where_the_move_fails(plain, tmp_path):
    url = f"shaky://{tmp_path}/store"
    Shaky.fails = "move"
    result = run("batch", plain[0], "-o", url)
    assert (result.exit_code, result.stderr.count("\n")) == (1, 1)
    assert "aqualog_store.json: cannot be written (RuntimeError: connection lost)" in result.stderr
    assert not [p for p in (tmp_path / "store").rglob("*") if p.is_file()]


def test_a_network_that_fails_damages_nothing(plain, tmp_path):
    url = f"shaky://someone:secret@host{tmp_path}/store"
    assert run("batch", plain[0], "-o", url, "-q").exit_code == 0
    before = files_of(url)
    Shaky.fails = "read"
    for command in (("batch", plain[0], "-o"), ("bin-slipslope", plain[0], "--store")):
        result = run(*command, url)
        assert (result.exit_code, result.stderr.count("\n")) in ((1, 1), (2, 1))
        assert "cannot be read (no answer from" in result.stderr
        assert "secret" not in result.stderr + result.stdout
    Shaky.fails = ""
    assert files_of(url) == before


def test_a_worker_is_asked_whether_it_can_use_the_store(plain, url, monkeypatch):
    place_of(url).make(())
    with asked_of({"a": (url, plain[0])}) as asked:
        assert [u for u, _ in asked.places] == [url]
        assert unlike(asked) is None
        again = asked._replace(files=())
        with monkeypatch.context() as patch:
            patch.setattr(Remote, "has", lambda *_: False)  # a place of the same name on another machine
            assert "it is another one here" in unlike(again).what
        with monkeypatch.context() as patch:

            def refused(*_):
                raise PermissionError(13, "no credentials")

            patch.setattr(Remote, "write", refused)
            assert "(no credentials)" in unlike(again).what
        assert unlike(again) is None
    assert files_of(url) == {}


def test_what_was_half_written_long_ago_is_swept(plain, tmp_path):
    url = f"other://{tmp_path}/store"
    assert run("batch", plain[0], "-o", url, "-q").exit_code == 0
    old, new, mine = (tmp_path / "store" / "samples" / n for n in (".x-abcd1234.parquet.tmp", ".y-abcd1234.parquet.tmp", ".mine"))  # fmt: skip
    for path in (old, new, mine):
        path.write_text("")
    long_ago = (datetime.now(UTC) - timedelta(days=2)).timestamp()
    for path in (old, mine):
        os.utime(path, (long_ago, long_ago))
    assert run("batch", plain[0], "-o", url, "-q").exit_code == 0
    assert (old.exists(), new.exists(), mine.exists()) == (False, True, True)


def test_addresses(tmp_path):
    assert address_of("file:///a/b") == Path("/a/b")
    assert address_of("file:/a/b") == address_of("FILE://localhost/a/b") == Path("/a/b")
    for text in ("", "file:", "file:a", "file://", "file://host/a", "local://a", "file://localhostage/a"):
        with pytest.raises(ConfigError, match=r"empty|no folder of this machine"):
            address_of(text)
    assert address_of("a/b:c") == Path("a/b:c")
    assert address_of("S3://b/x") == "S3://b/x"
    assert type(Store(f"file://{tmp_path}")._place) is Place
    assert Remote("other://user:word@host/x").name == "other://***@host/x"
    with pytest.raises(ConfigError, match="chain"):
        address_of("zip://a::file://b")


@pytest.fixture(scope="module")
def s3(tmp_path_factory):
    """An S3 server with a bucket; by the environment, as users tell it."""
    pytest.importorskip("s3fs")
    pytest.importorskip("moto.server")
    folder = tmp_path_factory.mktemp("s3")
    with (folder / "log").open("w") as log:
        server = subprocess.Popen(
            [sys.executable, "-u", "-m", "moto.server", "-H", "127.0.0.1", "-p", "0"], stdout=log, stderr=log
        )  # fmt: skip
    try:
        for _ in range(600):
            match = re.search(r"http://127\.0\.0\.1:\d+", (folder / "log").read_text())
            if match:
                break
            time.sleep(0.1)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("AWS_ENDPOINT_URL", match[0])
            patch.setenv("AWS_ACCESS_KEY_ID", "test")
            patch.setenv("AWS_SECRET_ACCESS_KEY", "test")
            patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
            import s3fs

            s3fs.S3FileSystem(skip_instance_cache=True).mkdir("bucket")
            yield "s3://bucket/some/store"
    finally:
        server.kill()
        server.wait()


@pytest.mark.nightly
def test_s3_by_processes_and_by_a_cluster(plain, s3, tmp_path):
    campaign, store = plain
    by_processes = run("batch", campaign, "-o", s3, "--json", "--jobs", "2", "--limit-s", "100")
    assert by_processes.exit_code == 0, by_processes.stderr
    assert files_of(s3) == files_of(store)
    assert run("bin-slipslope", campaign, "--store", s3, "--json").stdout == run("bin-slipslope", campaign, "--store", store, "--json").stdout  # fmt: skip
    with cluster(tmp_path) as (address, _):
        found = run("batch", campaign, "-o", s3 + "-2", "--json", "--cluster", address)
    assert found.exit_code == 0, found.stderr
    assert json.loads(found.stdout)["made"] == 4
    assert files_of(s3 + "-2") == files_of(store)


@pytest.mark.nightly
def test_s3_that_is_not_there(plain, s3, monkeypatch):
    result = run("batch", plain[0], "-o", "s3://no-such-bucket/store")
    assert (result.exit_code, result.stderr.count("\n")) == (1, 1)
    assert "s3://no-such-bucket/store/aqualog_store.json: cannot be written" in result.stderr
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    result = run("batch", plain[0], "-o", "s3://bucket/elsewhere")
    assert (result.exit_code, result.stderr.count("\n")) == (1, 1)
    assert "s3://bucket/elsewhere: cannot be read" in result.stderr
    fsspec.get_filesystem_class("s3").clear_instance_cache()
