"""Lines of panics are left out of what libraries write."""

from aqualog.guard.streams import PanicFilter


def test_lines_of_panics_are_known_as_they_come():
    panics = PanicFilter()
    text = [
        b"one",
        b"",
        b"",
        b"two",
        b"",
        b"thread 'a' panicked at b.rs:1:2:",
        b"what",
        b"  left: 1",
        b"three",
        b" four",
    ]
    assert [kept for line in text for kept in panics.kept([line])] == [b"one", b"", b"", b"two", b"three", b" four"]
