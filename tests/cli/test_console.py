"""What goes to stderr."""

import pytest

from aqualog.cli.console import Console


@pytest.fixture
def console():
    return Console.make(quiet=False, verbose=False, progress="off")


def test_inputs_that_fail_for_one_reason_share_a_line(console, capsys):
    with console.hearing() as hear:
        for i in range(1, 8):
            hear.failed(f"logs/{i}.csv", f'{i}.csv: v_x: no channel "Velocty"' if i % 2 else f"logs/{i}.csv: empty")
    first, second, *rest = capsys.readouterr().err.splitlines()
    assert first == 'error: logs/1.csv: v_x: no channel "Velocty"'
    assert second == "error: logs/2.csv: empty"
    assert rest == [
        "error: the same as of logs/1.csv for 3 more: logs/3.csv, logs/5.csv, logs/7.csv",
        "error: the same as of logs/2.csv for 2 more: logs/4.csv, logs/6.csv",
    ]


def test_of_many_reasons_the_first_are_shown(console, capsys):
    with console.hearing() as hear:
        for i in range(30):
            hear.failed(f"{i}.csv", f"reason {i}")
        hear.settled("runs.parquet")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 21
    assert lines[-1] == "error: and 10 more; all are in runs.parquet"


def test_units_are_written_one_way(console, capsys):
    console.note("a_x is off by 1.5 m/s^2; see run^2.csv")
    assert capsys.readouterr().err == "note: a_x is off by 1.5 m/s²; see run^2.csv\n"
