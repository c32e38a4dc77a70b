"""What a channel shows of an effect is known to a twentieth: a second effect must not make up for the rest."""

from types import SimpleNamespace

import numpy as np

from aqualog.diagnose import search
from aqualog.diagnose.competition import Block

N = 400


class Plain:
    """White noise of size one, without tolerances."""

    def rows(self, each, kind=np.float64):
        return np.concatenate([x.reshape(len(x), -1) for x in each], axis=1, dtype=kind)

    def inner(self, u, w):
        return u @ w.T


def case(values, signatures, seen):
    """An arena and a fit of effects with these signatures (k, C, n) to what is seen (C, n)."""
    k = len(values)
    blocks = [Block(str(i), "effect", (i,), np.eye(1) * 9.0, -3.0, i) for i in range(k)]
    part = SimpleNamespace(
        drive=0, at=slice(None), mask=np.ones(N, dtype=bool), channels=("force_balance", "kinematic")
    )
    arena = SimpleNamespace(
        parts=(part,), sd=np.ones(k), blocks=blocks, evidence=SimpleNamespace(columns=[(i,) for i in range(k)])
    )
    left = seen - np.tensordot(values, signatures, axes=1)
    found = SimpleNamespace(
        off=np.array(values), names=[(i, "x") for i in range(k)], members=list(range(k)), signatures=(signatures,),
        residuals=(left,),
    )  # fmt: skip
    return arena, found


def evidence(values, signatures, seen):
    arena, found = case(values, signatures, seen)
    return search._evidence(arena, found, range(len(values)), Plain(), 0.5 * float((seen**2).sum()))[0]


def drawn():
    rng = np.random.default_rng(7)
    h = rng.standard_normal((2, N)) * 3.0
    other = np.stack([h[0], np.zeros(N)])  # does what the first does, in one channel alone
    return h, other, rng.standard_normal((2, N))


def test_a_response_that_is_a_little_larger_in_one_channel_takes_no_second_effect(monkeypatch):
    h, other, noise = drawn()
    seen = h * np.array([[1.05], [1.0]]) * 2.0 + noise
    one = evidence([2.05], h[None], seen)
    two = evidence([2.0, 0.1], np.stack([h, other]), seen)
    assert one > two
    monkeypatch.setattr(search, "DOUBT", 1e-9)
    assert evidence([2.05], h[None], seen) < evidence([2.0, 0.1], np.stack([h, other]), seen)


def test_a_second_effect_of_its_own_size_is_still_found():
    h, other, noise = drawn()
    seen = h * np.array([[2.0], [1.0]]) * 2.0 + noise
    assert evidence([2.0, 2.0], np.stack([h, other]), seen) > 10.0 + evidence([2.5], h[None], seen)


def test_what_is_large_beside_the_noise_is_doubted_in_all_channels_of_its_unit():
    h, _, noise = drawn()
    h[1] *= 0.01
    seen = 2.0 * h + noise
    arena, found = case([2.0], h[None], seen)
    (each,) = search._doubtful(arena, found)
    assert each.shape == (2, 2, N)
    for i in (0, 1):  # in its own channel, then in the other one
        assert np.array_equal(each[i, i], 2.0 * h[0])
        assert not each[i, 1 - i].any()
    arena.parts[0].channels = ("force_balance", "slip_fl")
    (each,) = search._doubtful(arena, found)
    assert each.shape == (1, 2, N)
