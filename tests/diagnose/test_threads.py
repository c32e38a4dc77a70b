"""Two threads that stay, and none within them."""

import threading

import pytest

from aqualog.diagnose.threads import beside


def test_results_come_in_their_order_from_other_threads():
    here = threading.get_ident()
    assert beside(lambda x: 2 * x, range(20)) == [2 * x for x in range(20)]
    assert here not in beside(lambda _: threading.get_ident(), range(8))


def test_threads_stay():
    barrier = threading.Barrier(2)

    def who(_):
        barrier.wait(10.0)  # both take part
        return threading.current_thread()

    first, second = set(beside(who, range(2))), set(beside(who, range(4)))
    assert first == second
    assert len(first) == 2


def test_within_a_thread_there_is_no_other():
    def outer(_):
        return {threading.get_ident(), *beside(lambda _: threading.get_ident(), range(4))}

    assert all(len(ids) == 1 for ids in beside(outer, range(4)))


def test_an_error_comes_through_and_the_next_work_is_done():
    def fails(x):
        if x == 1:
            raise ValueError("no")
        return x

    with pytest.raises(ValueError, match="no"):
        beside(fails, range(5))
    assert beside(fails, [0, 2]) == [0, 2]
