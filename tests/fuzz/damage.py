"""Damages of bytes as plain tuples, so that a case can be written down and made again."""

import struct

NUMBERS = (0, 1, 7, 23, 24, 25, 63, 64, 2**16, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63, 2**64 - 1)


def damaged(data: bytes, damages: tuple) -> bytes:
    """The bytes after all damages, in order.

    ("cut", n): the last n bytes are missing. ("flip", at, bit). ("zero", at, n). ("swap", a, b, n): stretches change
    places. ("number", at, width, value): a number in place. ("copy", a, b): the 8 bytes at a also at b.
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
    return bytes(out)


def drawn(rng, size: int) -> tuple:
    """One to three damages by chance; most of them where numbers stand."""
    out = []
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        kind = str(rng.choice(["cut", "flip", "flip", "zero", "swap", "number", "number", "copy"]))
        at = int(rng.integers(size))
        aligned = at // 8 * 8
        if kind == "cut":
            out.append((kind, int(rng.integers(1, size))))
        elif kind == "flip":
            out.append((kind, at, int(rng.integers(8))))
        elif kind == "zero":
            out.append((kind, at, int(rng.choice([1, 8, 64, 500]))))
        elif kind == "swap":
            out.append((kind, aligned, int(rng.integers(size)) // 8 * 8, int(rng.choice([1, 8, 24, 160]))))
        elif kind == "number":
            value = NUMBERS[int(rng.integers(len(NUMBERS)))] if rng.random() < 0.6 else int(rng.integers(size))
            out.append((kind, aligned if rng.random() < 0.7 else at, int(rng.choice([1, 2, 4, 8])), value))
        else:
            out.append((kind, aligned, int(rng.integers(size)) // 8 * 8))
    return tuple(out)
