"""Damages of a file as plain tuples, so that a case can be written down and made again."""

import re
import struct

NUMBERS = (0, 1, 7, 23, 24, 25, 63, 64, 2**16, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63, 2**64 - 1)
TOKEN = re.compile(rb'"[^"\n]*"|[-+]?[\w.]+|[^\s\w]')
WORDS = (
    "nan", "inf", "-inf", "-0.0", "0", "1", "-1", "1e308", "-1e308", "1e-320", "1e999", "0.1", "3", "1e6", "1e12",
    "9223372036854775807", "-9223372036854775808", "9223372036854775808", "0x7f", "1_000", "1,5", "true", "false",
    '""', '" "', '"a"', '"\\u0000"', '"\\n"', '"\\u202e"', '"\\ud800"', '"/dev/null"', '"."', '"../.."', "''",
    "[]", "[[]]", "[1]", "[[0, 1]]", "[[0.0, 1.0], [1.0, 2.0]]", "{}", "{a = 1}", "null", "1979-05-27",
    "1979-05-27T07:32:00Z", "07:32:00", "#", "=", "[", "]", "[[", "]]", "{", "}", ",", ";", "\t", "\r", "\x00", "\x1b[2J",
    "\ufeff", "\u00e4", "\U0001f600", "\u2028", '"""', "'''", "\\", "%s", "*", "@", "x_", "x_a",
)  # fmt: skip


def damaged(data: bytes, damages: tuple) -> bytes:
    """The bytes after all damages, in order.

    ("cut", n): the last n bytes are missing. ("flip", at, bit). ("zero", at, n). ("swap", a, b, n): stretches change
    places. ("number", at, width, value): a number in place. ("copy", a, b): the 8 bytes at a also at b.
    ("again", at, n): n bytes twice. ("out", at, n): n bytes are missing. In texts: ("word", k, text): the k-th word is
    another. ("take", k, j): the k-th word is the j-th. ("line", k, j): the j-th line also before the k-th. ("no line", k).
    ("deep", k, n): the k-th word in n brackets.
    """
    out = bytearray(data)
    for kind, *how in damages:
        if not out:
            break
        n = len(out)
        if kind == "cut":
            del out[max(n - how[0], 0) :]
        elif kind == "flip":
            out[how[0] % n] ^= 1 << how[1]
        elif kind == "zero":
            at = how[0] % n
            out[at : at + how[1]] = bytes(len(out[at : at + how[1]]))
        elif kind == "swap":
            a, b = sorted((how[0] % n, how[1] % n))
            size = min(how[2], b - a, n - b)
            out[a : a + size], out[b : b + size] = out[b : b + size], out[a : a + size]
        elif kind == "number":
            at = how[0] % n
            raw = struct.pack("<Q", how[2])[: how[1]]
            out[at : at + how[1]] = raw[: len(out[at : at + how[1]])]
        elif kind == "copy":
            a, b = how[0] % n, how[1] % n
            piece = bytes(out[a : a + 8])
            out[b : b + 8] = piece[: len(out[b : b + 8])]
        elif kind == "again":
            at = how[0] % n
            out[at:at] = out[at : at + how[1]]
        elif kind == "out":
            at = how[0] % n
            del out[at : at + how[1]]
        else:
            out = bytearray(_reworded(bytes(out), kind, how))
    return bytes(out)


def _reworded(text: bytes, kind: str, how: list) -> bytes:
    if kind in ("line", "no line"):
        lines = text.splitlines(keepends=True)
        at = how[0] % len(lines)
        lines[at : at + 1] = [lines[how[1] % len(lines)], lines[at]] if kind == "line" else []
        return b"".join(lines)
    words = list(TOKEN.finditer(text))
    if not words:
        return text
    old = words[how[0] % len(words)]
    if kind == "word":
        new = how[1].encode("utf-8", "surrogatepass")
    elif kind == "take":
        new = words[how[1] % len(words)][0]
    else:
        new = b"[" * how[1] + old[0] + b"]" * how[1]
    return text[: old.start()] + new + text[old.end() :]


def drawn(rng, data: bytes, *, is_text: bool) -> tuple:
    """One to three damages by chance; most of them where numbers stand, or of words."""
    return tuple(
        _word(rng, data) if is_text and rng.random() < 0.8 else _bytes(rng, len(data))
        for _ in range(int(rng.choice([1, 1, 1, 2, 3])))
    )


def _word(rng, data: bytes) -> tuple:
    kind = str(rng.choice(["word", "word", "word", "take", "take", "line", "no line", "deep"]))
    words, lines = max(len(TOKEN.findall(data)), 1), data.count(b"\n") + 1
    if kind == "word":
        return (kind, int(rng.integers(words)), WORDS[int(rng.integers(len(WORDS)))])
    if kind == "take":
        return (kind, int(rng.integers(words)), int(rng.integers(words)))
    if kind == "line":
        return (kind, int(rng.integers(lines)), int(rng.integers(lines)))
    if kind == "no line":
        return (kind, int(rng.integers(lines)))
    return (kind, int(rng.integers(words)), int(rng.choice([1, 2, 50, 3000])))


def _bytes(rng, size: int) -> tuple:
    kind = str(rng.choice(["cut", "flip", "flip", "zero", "swap", "number", "number", "copy", "again", "out"]))
    at = int(rng.integers(size))
    aligned = at // 8 * 8
    if kind == "cut":
        return (kind, int(rng.integers(1, max(size, 2))))
    if kind == "flip":
        return (kind, at, int(rng.integers(8)))
    if kind == "zero":
        return (kind, at, int(rng.choice([1, 8, 64, 500])))
    if kind == "swap":
        return (kind, aligned, int(rng.integers(size)) // 8 * 8, int(rng.choice([1, 8, 24, 160])))
    if kind == "number":
        value = NUMBERS[int(rng.integers(len(NUMBERS)))] if rng.random() < 0.6 else int(rng.integers(size))
        return (kind, aligned if rng.random() < 0.7 else at, int(rng.choice([1, 2, 4, 8])), value)
    if kind == "copy":
        return (kind, aligned, int(rng.integers(size)) // 8 * 8)
    return (kind, at, int(rng.choice([1, 4, 8, 100, 4096])))
