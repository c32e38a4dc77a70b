"""What a process has in hand is read while it writes."""

import os
import signal
import time

from aqualog.guard.page import StatePage
from aqualog.guard.reading import ReadingState


def test_what_is_told_is_read():
    page, state = StatePage(), ReadingState("drive.mf4", 2.0, 17, 3, ("a.tmp", "b.tmp"))
    page.write(state)
    assert page.read() == state


def test_page_that_is_written_just_now_leaves_what_was_read_before():
    told = [ReadingState("d.mf4", 1.0, 1, n, ("x" * (n % 7 * 40),)) for n in range(50)]
    page = StatePage()
    page.write(told[0])
    assert page.read() == told[0]
    child = os.fork()
    if child == 0:
        while True:
            for state in told:
                page.write(state)
    try:
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            assert page.read() in told
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def test_what_was_written_last_and_believes_no_nonsense():
    page = StatePage()
    assert page.read() == ReadingState()
    state = ReadingState("/a b/ü\udcff.csv", 12.5, 3, 7, ("/tmp/x",))
    page.write(state)
    assert page.read() == state
    page._page[1:5] = b"\xff" * 4
    assert page.read() == state
    page.write(state._replace(temporary=tuple(f"{k:05000}" for k in range(20))))
    assert page.read() == state._replace(temporary=())
    assert not page.is_finished
    page.finish()
    page.write(state)
    assert page.is_finished
