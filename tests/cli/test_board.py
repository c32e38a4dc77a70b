"""What a process has in hand is read while it writes."""

import os
import signal
import time

from aqualog.cli.board import Board
from aqualog.io.in_hand import InHand


def test_what_is_told_is_read():
    board, held = Board(), InHand("drive.mf4", 2.0, 17, 3, ("a.tmp", "b.tmp"))
    board.tell(held)
    assert board.read() == held


def test_page_that_is_written_just_now_leaves_what_was_read_before():
    told = [InHand("d.mf4", 1.0, 1, n, ("x" * (n % 7 * 40),)) for n in range(50)]
    board = Board()
    board.tell(told[0])
    assert board.read() == told[0]
    child = os.fork()
    if child == 0:
        while True:
            for held in told:
                board.tell(held)
    try:
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            assert board.read() in told
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
