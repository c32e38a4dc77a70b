"""An item that ends its process, takes too long or wants too much costs itself, and no other item."""

import gc
import multiprocessing
import os
import time
from pathlib import Path

import pytest

from aqualog.core.errors import AqualogError
from aqualog.guard import worker
from aqualog.guard.reading import ReadLimits, reading
from aqualog.guard.worker import NO_LIMITS, Bounds, Crashed, Limits, kept_worker, work_on

WRITES = "reading it writes a file of more than 5 MB. Try: a higher AQUALOG_LIMIT_FILE_MB"


def dies(i, folder):
    (folder / f"{i}-{os.getpid()}").touch()
    if i in (3, 11):
        os._exit(9)
    time.sleep(0.05)
    return i


@pytest.mark.parametrize("way", [m for m in ("spawn", "forkserver") if m in multiprocessing.get_all_start_methods()])
def test_a_process_that_dies_is_one_item_tried_twice_and_leaves_what_is_beside_it(tmp_path, monkeypatch, way):
    monkeypatch.setattr(worker, "_context", multiprocessing.get_context(way))
    found = {}
    work_on({i: (i, tmp_path) for i in range(14)}, dies, jobs=2, record=found.__setitem__)
    assert sorted(found) == list(range(14))
    assert {i for i, r in found.items() if isinstance(r, Crashed)} == {3, 11}
    tries = [p.name.split("-") for p in tmp_path.iterdir()]
    assert sorted(int(i) for i, _ in tries) == sorted([*range(14), 3, 11])
    assert len({process for _, process in tries}) <= 2 + 2 + 2


def cannot_be_sent(i):
    if i == 1:
        return lambda: i
    if i == 2:
        raise ZeroDivisionError("of the item")
    return i


def test_what_an_item_raises_or_cannot_send_is_raised_here():
    for i, error in ((1, TypeError), (2, ZeroDivisionError)):
        found = {}
        with pytest.raises(error):
            work_on({0: (0,), i: (i,)}, cannot_be_sent, jobs=1, record=found.__setitem__)
        assert found == {0: 0}


def sleep(seconds):
    time.sleep(seconds)
    return seconds


def hang():
    # in C, with the interpreter's lock held: no exception can end it
    import re

    re.match(r"(a+)+$", "a" * 40 + "b")


def want(megabytes):
    try:
        return len(bytearray(megabytes * 1_000_000))
    except MemoryError:
        return "no memory"


def test_what_takes_too_long_is_ended_and_the_others_are_not():
    tasks = {"a": (0.0,), "b": (60.0,), "c": (0.1,), "d": (0.2,)}
    found = {}
    work_on(tasks, sleep, jobs=2, record=found.__setitem__, limits=Limits(seconds=1.0))
    assert {n: r for n, r in found.items() if n != "b"} == {"a": 0.0, "c": 0.1, "d": 0.2}
    assert isinstance(found["b"], Crashed)
    assert found["b"].seconds >= 1.0


def test_what_never_comes_back_to_python_is_ended():
    found = {}
    began = time.monotonic()
    work_on({"a": ()}, hang, jobs=1, record=found.__setitem__, limits=Limits(seconds=1.0))
    assert isinstance(found["a"], Crashed)
    assert time.monotonic() - began < 30.0


def test_too_much_memory_is_an_error_of_one_item():
    found = {}
    work_on({"a": (100,), "b": (3000,)}, want, jobs=2, record=found.__setitem__, limits=Limits(memory_mb=1500))
    assert found == {"a": 100_000_000, "b": "no memory"}


def test_a_process_that_is_idle_ends(monkeypatch):
    monkeypatch.setattr(worker, "_IDLE_S", 0.3)
    with kept_worker(Bounds(NO_LIMITS, ReadLimits())) as do:
        number = do(os.getpid)
        assert do(os.getpid) == number
        assert do(gc.get_threshold) > gc.get_threshold()  # imports are not searched for garbage
    for _ in range(100):
        if not Path(f"/proc/{number}").exists():
            break
        time.sleep(0.1)
    assert not Path(f"/proc/{number}").exists()


def read_badly(path, kind):
    acts = {"hang": lambda: time.sleep(60), "write": write_on}
    try:
        with reading(Path(path)):
            acts.get(kind, int)()
    except AqualogError as error:
        return error.line()
    return kind


def write_on(path="endless"):
    with open(path, "wb") as file:  # noqa: PTH123
        while True:
            file.write(bytes(1_000_000))


def test_workers_of_a_batch_have_the_same_limits(tmp_path, monkeypatch):
    """`--limit-s` is not given: a step of reading has its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("AQUALOG_LIMIT_S", "3")
    monkeypatch.setenv("AQUALOG_LIMIT_FILE_MB", "5")
    found = {}
    work_on({k: ("a", k) for k in ("hang", "write", "y")}, read_badly, jobs=1, record=found.__setitem__)
    assert found["y"] == "y"
    assert isinstance(found["hang"], Crashed)
    assert found["hang"].seconds >= 3.0
    assert found["write"] == f"a: {WRITES}"


def test_the_limit_of_an_item_stands_in_for_that_of_reading(tmp_path, monkeypatch):
    monkeypatch.setenv("AQUALOG_LIMIT_S", "0.1")
    found = {}
    work_on({"a": (str(tmp_path),)}, slow_read, jobs=1, record=found.__setitem__, limits=Limits(seconds=30.0))
    assert found == {"a": "read"}


def slow_read(path):
    with reading(Path(path)):
        time.sleep(0.5)
    return "read"
