"""Every benchmark, tiny: both sides run and agree. What starts processes is tried once, and at length by `-m nightly`."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from tests.bench import __main__ as bench
from tests.bench import batching, child, detecting, logs, messages, paging, recursions, regressing, script, table
from tests.bench.compare import Row, line
from tests.bench.scale import TINY

IN_PROCESS = ("mf4", "csv", "mcap", "recursions", "computing", "regression", "page", "growth")


@pytest.mark.parametrize("name", IN_PROCESS)
def test_rows_run_and_agree(name):
    lines, code = bench.run([name], TINY)
    assert code == 0, lines
    assert lines
    assert all("reached |" in x or "not run" in x for x in lines)


@pytest.mark.nightly
@pytest.mark.parametrize("name", [n for n in bench.GROUPS if n not in IN_PROCESS])
def test_rows_of_processes(name):
    lines, code = bench.run([name], TINY)
    assert code == 0, lines
    assert all("reached |" in x for x in lines)


def test_the_script_finds_what_aqualog_finds(tmp_path):
    from aqualog.align.load import load_signals
    from aqualog.config.vehicle import load_vehicle
    from aqualog.detect.stream import detect_drive

    log, car = logs.one_log(tmp_path / "log.mf4", 120.0), load_vehicle(logs.CAR)
    found = detect_drive(load_signals([log], vehicle=car), car).events
    ours = [{n: getattr(e, n) for n in ("detector", "wheel", "start_s", "end_s", "peak")} for e in found]
    peer = script.detect(log, tomllib.loads(logs.CAR.read_text(encoding="utf-8")))
    assert detecting.unlike(ours, peer) == ""
    late = [{**e, "start_s": e["start_s"] + 30.0, "end_s": e["end_s"] + 30.0} for e in peer]
    assert "missing on the other side" in detecting.unlike(ours, late)
    assert "no spin-down" in detecting.unlike(ours, [])


def test_slopes_are_measured_with_what_the_peer_leaves_out():
    """A row that says that the peer leaves the noise of the traction in must pay for taking it off."""
    plain = regressing.made(40, 600)
    noise = np.random.default_rng(0).normal(0.0, 0.008, plain.mu.size)
    noisy = plain._replace(mu=plain.mu + noise)
    ours, peer = (
        f(noisy)[:, 0] / f(plain)[:, 0] for f in (regressing.slopes_with_aqualog, regressing.slopes_with_scipy)
    )
    assert peer.mean() < 0.90
    assert ours.mean() == pytest.approx(1.0, abs=0.03)


def test_a_child_tells_its_own_memory_and_time():
    hold = np.ones(40_000_000)  # of this process, not of the child
    small = child.run("-c", "print('done')")
    large = child.run("-c", "x = bytearray(60_000_000); sum(range(2_000_000))")
    assert hold[-1] == 1.0
    assert small.stdout == "done\n"
    assert small.peak_mb < 60.0 < large.peak_mb - small.peak_mb + 5.0
    assert large.cpu_s > small.cpu_s
    with pytest.raises(RuntimeError, match="ended with 3: oh dear"):
        child.run("-c", "import sys; print('oh dear', file=sys.stderr); sys.exit(3)")


def test_logs_of_pieces_are_those_in_one(tmp_path, monkeypatch):
    import asammdf

    whole = logs.one_log(tmp_path / "whole.mf4", 50.0)
    monkeypatch.setattr(logs, "PIECE_H", 20.0 / 3600.0)
    monkeypatch.setattr(logs, "PERIOD_S", 50.0)
    columns = logs.drive(50.0)
    short = {n: x[:2000] for n, x in columns.items()}
    pieces = logs._in_pieces(tmp_path / "pieces.mf4", short, 5000)
    with asammdf.MDF(whole) as a, asammdf.MDF(pieces) as b:
        for name in ("v_x", "on_water"):
            x, y = a.get(name), b.get(name)
            np.testing.assert_allclose(x.timestamps, y.timestamps, atol=1e-9)
            np.testing.assert_array_equal(y.samples, np.resize(short[name], 5000))


def test_differences_are_told(tmp_path):
    data = recursions.wheels(500)
    ours = recursions.with_aqualog(data)
    assert any(x.any() for x in ours if x.dtype == bool)
    flipped = [~x if x.dtype == bool else x for x in ours]
    assert "bits differ" in recursions.unlike(ours, flipped)
    s = regressing.made(4, 240)
    lines = regressing.lines_with_aqualog(s)
    assert regressing._lines_unlike(lines, 1.001 * lines)
    bag = messages.made_bag(tmp_path, 0.2)
    a = messages.with_rosbags(bag)
    name, (t, x) = next(iter(a.items()))
    assert "differ" in messages.unlike(a, a | {name: (t, x + 1e-9)})
    assert "one side" in messages.unlike(a, {n: c for n, c in a.items() if n != name})
    result = paging.made(300.0)
    page = paging.with_aqualog(result)
    assert paging.unlike(page, result) == ""
    assert "extremes" in paging.unlike(page, replace(result, features=result.features * 1.1))


def test_a_missing_peer_ends_nothing(monkeypatch):
    row = Row("row", "peer", 1.0, lambda: 1, lambda: 1, needs=("no_such_module",))
    other = Row("other", "peer", 1.0, lambda: 1, lambda: 2, lambda a, b: "1 is not 2")
    failing = Row("third", "peer", 1.0, lambda: child.run("-c", "raise SystemExit(2)"), 1.0)
    monkeypatch.setitem(bench.GROUPS, "made up", lambda _folder, _scale: [row, other, failing])
    lines, code = bench.run(["made up"], TINY)
    assert "not run: `pip install -e '.[bench]'`" in lines[0]
    assert "not the same: other: 1 is not 2" in lines[1]
    assert "failed: " in lines[2]
    assert code == 1


def test_cost_of_a_result_is_no_time():
    m = bench.measured(Row("size", "peer", 2.0, lambda: "ab", lambda: "abcd", cost=len, unit="MB", clock="", rounds=2))
    assert m.ratios == (2.0, 2.0)
    assert "| 2 / **2** / 2 | reached | 2 MB |" in line(m)


def test_batches_leave_no_store(tmp_path):
    folder = logs.many_logs(tmp_path / "logs", 12, 10.0)
    assert batching.in_batch(folder, tmp_path / "store") == 12
    assert not (tmp_path / "store").exists()


def test_the_table_goes_between_the_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{table.BEGIN}\nold\n{table.END}\nafter\n", encoding="utf-8")
    table.put(page, "about", ["| a |", "| b |"])
    text = page.read_text(encoding="utf-8")
    assert text.startswith(f"before\n{table.BEGIN}\nabout\n\n| benchmark ")
    assert text.endswith(f"| a |\n| b |\n{table.END}\nafter\n")
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match="must have"):
        table.put(page, "about", [])
    assert page.read_text(encoding="utf-8") == "no marks"


def test_the_page_has_the_marks_and_the_groups_exist():
    text = table.PAGE.read_text(encoding="utf-8")
    assert text.count(table.BEGIN) == text.count(table.END) == 1
    assert "processors" in table.conditions()
