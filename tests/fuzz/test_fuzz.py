"""A short turn of every target, all that has been found before, and that the judges see what they should see."""

import json
import sys
import time
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from aqualog.core.errors import ConfigError, LogError
from aqualog.core.records import FileFaults
from tests.fuzz import __main__ as command
from tests.fuzz import readers, settings_files, targets_campaign, targets_config, targets_simulation, turn, watch
from tests.fuzz.corpus import Case, case_of, cases
from tests.fuzz.damage import TOKEN, damaged, drawn
from tests.fuzz.registry import MEGABYTES, SECONDS, Target, all_targets
from tests.fuzz.targets_csv import seeds as csv_seeds
from tests.fuzz.targets_mcap import seeds as mcap_seeds
from tests.fuzz.targets_mdf import DBC, check_recorded, version_4

TARGETS = all_targets()
# simulations and detectors are compiled for these, which other tests do as well: here a few cases are enough
FRESH = {"mdf": 12, "mdf3": 8, "mcap": 12, "bag": 12, "db3": 8, "csv": 16, "parquet": 8}


def judged(name: str, case: Case) -> str | None:
    """As the fuzzer judges; the time that a case may take is of the processor."""
    target = TARGETS[name]
    begin = time.process_time()
    data = case.content(target)
    if case.seed and target.known is not None:
        target.known(case.seed, case.damages, data)
    else:
        target.one(data)
    return "hangs" if time.process_time() - begin > 3.0 * SECONDS else None


@pytest.fixture
def strict(monkeypatch):
    """Nothing may be refused."""

    def refused(error, name=""):
        raise AssertionError(f"refused: {error.line()}")

    for module in (settings_files, targets_campaign, targets_config, targets_simulation):
        monkeypatch.setattr(module, "check_error", refused)
    form = readers._check_form

    def read(found, name):
        assert not found.refusal
        assert found.channels
        form(found, name)

    monkeypatch.setattr(readers, "_check_form", read)


@pytest.mark.parametrize("name", TARGETS)
def test_sound_files_are_read_whole(name, strict):
    for seed in TARGETS[name].seeds():
        assert judged(name, Case(seed)) is None


@pytest.mark.parametrize(("name", "case"), [(n, c) for n in TARGETS for c in cases(n)])
def test_what_has_been_found_before(name, case):
    assert judged(name, case) is None


@pytest.mark.parametrize("name", [n for n in TARGETS if not TARGETS[n].may_end])
def test_damage_drawn_by_chance(name, capfd):
    target, rng = TARGETS[name], np.random.default_rng(20261123)
    seeds = target.seeds()
    for k in range(FRESH.get(name, 10)):
        seed = sorted(seeds)[k % len(seeds)]
        assert judged(name, Case(seed, drawn(rng, seeds[seed], is_text=target.is_text))) is None
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["plain", "deflated", "streamed", "streamed_deflated", "unsorted"])
def test_every_cut_of_an_mdf_file_gives_what_precedes_it(name):
    size = len(version_4()[name])
    for cut in range(1, size, max(size // 8, 1)):
        assert judged("mdf", Case(name, (("cut", cut),))) is None


def test_damages_are_what_they_say():
    data = b"a = 1\nbc = [2, 3]\n"
    assert [w[0] for w in TOKEN.finditer(data)] == [b"a", b"=", b"1", b"bc", b"=", b"[", b"2", b",", b"3", b"]"]
    for damage, expected in (
        (("cut", 3), b"a = 1\nbc = [2, "), (("flip", 0, 1), b"c = 1\nbc = [2, 3]\n"),
        (("word", 2, "nan"), b"a = nan\nbc = [2, 3]\n"), (("take", 2, 3), b"a = bc\nbc = [2, 3]\n"),
        (("line", 0, 1), b"bc = [2, 3]\na = 1\nbc = [2, 3]\n"), (("no line", 0), b"bc = [2, 3]\n"),
        (("deep", 2, 2), b"a = [[1]]\nbc = [2, 3]\n"), (("again", 0, 4), b"a = a = 1\nbc = [2, 3]\n"),
        (("out", 0, 4), b"1\nbc = [2, 3]\n"), (("zero", 0, 2), b"\0\0= 1\nbc = [2, 3]\n"),
        (("number", 0, 2, 0x4142), b"BA= 1\nbc = [2, 3]\n"), (("swap", 0, 6, 2), b"bc= 1\na  = [2, 3]\n"),
    ):  # fmt: skip
        assert damaged(data, (damage,)) == expected
        assert damaged(b"", (damage,)) == b""


@pytest.mark.parametrize("name", TARGETS)
def test_a_case_is_the_same_after_it_was_written_down(name):
    target, rng = TARGETS[name], np.random.default_rng(4)
    for seed, data in target.seeds().items():
        case = Case(seed, drawn(rng, data, is_text=target.is_text))
        assert case_of(case.line() + "  # a remark").content(target) == case.content(target)
        own = Case("", (), case.content(target))
        assert case_of(own.line() + "  # a remark").data == own.data


def test_a_reader_that_says_another_thing_in_pieces_is_seen(monkeypatch):
    data = csv_seeds()["point"]
    whole = readers.outcome(data, "a.csv")
    first = whole.channels[0]
    others = [
        replace(first, values=first.values + 1.0), replace(first, t_ns=first.t_ns + 1),
        replace(first, t_ns=first.t_ns[:-1], values=first.values[:-1]),
    ]  # fmt: skip
    found = [whole._replace(channels=(c, *whole.channels[1:])) for c in others]
    found += [whole._replace(channels=whole.channels[1:]), whole._replace(faults=FileFaults(lost_samples=3))]
    found += [readers.Outcome(refusal="a.csv: is damaged")]
    for other in found:
        monkeypatch.setattr(readers, "_pieces", lambda *_, other=other: other)
        with pytest.raises(AssertionError):
            readers.outcome(data, "a.csv")


@pytest.mark.parametrize("error", [ValueError("x"), KeyError("x"), LogError("no file is named"), LogError("x" * 3000, where="y" * 3000 + "a.csv")])  # fmt: skip
def test_an_error_of_another_kind_or_form_is_seen(error, monkeypatch):
    monkeypatch.setattr(readers, "_whole", mock.Mock(side_effect=error))
    with pytest.raises((AssertionError, type(error))):
        readers.outcome(csv_seeds()["point"], "a.csv")


def test_values_that_were_not_recorded_are_seen(monkeypatch):
    data = mcap_seeds()["zstd"]
    target = TARGETS["mcap"]
    target.known("zstd", (), data)
    whole = readers._whole

    def shifted(path, options, number):
        found = whole(path, options, number)
        return found._replace(channels=tuple(replace(c, values=c.values + 1.0) for c in found.channels))

    monkeypatch.setattr(readers, "_whole", shifted)
    monkeypatch.setattr(readers, "_pieces", shifted)
    with pytest.raises(AssertionError, match="not recorded"):
        target.known("zstd", (), data)


def test_a_silent_loss_of_an_mdf_file_is_seen():
    whole = readers.outcome(version_4()["plain"], "a.mf4", dbc=DBC)
    check_recorded(whole, whole)
    first = whole.channels[0]
    for channels in (
        whole.channels[1:], (replace(first, values=first.values + 1.0), *whole.channels[1:]),
        (replace(first, t_ns=first.t_ns + 1), *whole.channels[1:]),
        (replace(first, t_ns=first.t_ns[:-1], values=first.values[:-1]), *whole.channels[1:]),
    ):  # fmt: skip
        with pytest.raises(AssertionError):
            check_recorded(whole, whole._replace(channels=channels))


@pytest.mark.parametrize(
    ("name", "where", "wrong"),
    [
        ("map", "load_signal_map", ValueError), ("vehicle", "load_vehicle", KeyError), ("labels", "load_labels", TypeError),
        ("history", "load_history", RecursionError), ("thresholds", "load_settings", ConfigError("no file is named")),
        ("vehicle", "load_vehicle", ConfigError("x" * 40_000, where="vehicle.toml")),
    ],
)  # fmt: skip
def test_a_settings_file_that_ends_in_another_error_is_seen(name, where, wrong, monkeypatch):
    monkeypatch.setattr(targets_config, where, mock.Mock(side_effect=wrong))
    target = TARGETS[name]
    with pytest.raises((AssertionError, ValueError, KeyError, TypeError, RecursionError)):
        target.one(next(iter(target.seeds().values())))


def test_settings_that_are_lost_when_written_are_seen(monkeypatch):
    monkeypatch.setattr(targets_config, "map_text", lambda _: "[signals]\n")
    with pytest.raises(AssertionError, match="written and read again"):
        targets_config.signal_map(targets_config.maps()["full"])


def _broken(kind: str) -> Target:
    def one(data: bytes) -> None:
        if kind == "slow":
            while True:
                pass
        elif kind == "panic":
            raise BaseException("a panic")

    return Target("", lambda: {"a": b"abc"}, one)


@pytest.mark.parametrize(
    ("kind", "told"), [("slow", "hangs"), ("large", "takes"), ("panic", "a panic"), ("well", None)]
)
def test_hangs_memory_and_panics_are_told(kind, told, monkeypatch):
    monkeypatch.setattr(turn, "SECONDS", 0.2)
    peaks = iter([100.0, 100.0 + 2.0 * MEGABYTES] if kind == "large" else [100.0, 100.0])
    monkeypatch.setattr(turn, "peak", lambda: next(peaks))
    import signal

    before = signal.signal(signal.SIGPROF, turn._stop)
    try:
        verdict = turn.judged(_broken(kind), Case("a"))
    finally:
        signal.signal(signal.SIGPROF, before)
    assert verdict is None if told is None else told in verdict


def test_a_process_that_ends_or_stands_still_is_told_with_its_case(monkeypatch, tmp_path):
    """The watcher, with a process in place of the fuzzer's that writes a case and then does what it is told."""
    script = tmp_path / "child.py"
    script.write_text(
        "import os, sys, time\nopen(sys.argv[1], 'w').write('[\"a\", []]\\n')\n"
        "print('done {\"cases\": 50, \"wrong\": 0, \"faults\": 0, \"over\": false}', flush=True)\n"
        "os.abort() if sys.argv[2] == 'end' else time.sleep(60)\n"
    )  # fmt: skip
    popen = watch.subprocess.Popen
    for what, still_s, told in (("end", 60.0, "ends the process"), ("still", 0.5, "never comes back")):
        lines = []

        def child(command, what=what, **kwargs):
            return popen([sys.executable, str(script), command[6], what], **kwargs)

        monkeypatch.setattr(watch.subprocess, "Popen", child)
        monkeypatch.setattr(watch, "STILL_S", still_s)
        total = watch.watched("csv", 0.3, 1, guided=False, may_end=False, tell=lines.append)
        assert lines
        assert told in lines[0]
        assert lines[0].startswith('["a", []]')
        assert (total["cases"], total["wrong"]) == (50 * len(lines), len(lines))
        if what == "end":
            total = watch.watched("csv", 0.3, 1, guided=False, may_end=True, tell=lines.append)
            assert total["wrong"] == 0 < total["ended"]


def test_help_names_all_targets_and_has_examples(capsys):
    with pytest.raises(SystemExit):
        command.main(["--help"])
    text = capsys.readouterr().out
    assert "examples:" in text
    assert all(f"\n  {name} " in text for name in TARGETS)


def test_without_atheris_one_line_says_so(capsys, monkeypatch):
    monkeypatch.setattr(command.importlib.util, "find_spec", lambda _: None)
    assert command.main(["csv", "--guided"]) == 2
    assert capsys.readouterr().err == "--guided needs atheris, which is not installed. Try: pip install -e '.[fuzz]'\n"


@pytest.mark.nightly
def test_a_turn_of_the_command(capsys):
    assert command.main(["labels", "--seconds", "1", "--seed", "3"]) == 0
    out = capsys.readouterr()
    assert out.out == ""
    assert int(out.err.split()[1]) > 3
    assert " 0 wrong" in out.err


def test_one_case_again(capsys):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_DATA)
    assert command.main(["labels", "--case", json.dumps(["all", [["cut", 3]]])]) == 0
    assert capsys.readouterr().out == "right\n"
    with pytest.raises(SystemExit):
        command.main(["labels", "--case", "nonsense"])
    assert resource.getrlimit(resource.RLIMIT_DATA) == before  # a browser that another test starts would inherit it


@pytest.mark.nightly
@pytest.mark.parametrize("name", TARGETS)
def test_much_damage_drawn_by_chance(name, capsys):
    assert command.main([name, "--seconds", "60"]) == 0, capsys.readouterr()


@pytest.mark.nightly
def test_guided_by_coverage(capsys):
    pytest.importorskip("atheris")
    assert command.main(["mcap", "--seconds", "20", "--guided"]) == 0, capsys.readouterr()
