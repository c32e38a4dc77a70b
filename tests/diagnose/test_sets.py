"""Sets of blocks: the search visits the right one, shares add up by name, a form needs what no effect explains."""

from types import SimpleNamespace

import numpy as np
import pytest

from aqualog.diagnose.arena import Field
from aqualog.diagnose.competition import Block, evidence_of, first_of, fitted_in, ranked, searched
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.unexplained import clear_forms
from aqualog.model.effects import EFFECTS

RNG = np.random.default_rng(5)
X = RNG.standard_normal((400, 6))


def inner(y):
    rows = np.concatenate([X, y[:, None]], axis=1)
    return rows.T @ rows


def block(i, columns, kind="effect"):
    return Block(f"b{i}", kind, columns, np.eye(len(columns)), np.log(0.03), i)


BLOCKS = [*(block(i, (i,)) for i in range(4)), block(4, (4, 5), "shape")]


def field_of(blocks):
    def name(m):
        return blocks[m].key

    return SimpleNamespace(blocks=tuple(blocks), name=name, mechanism=name)


def always(state, other):
    return True


def test_search_finds_the_set_and_its_values():
    G = inner(X @ [0.0, 1.0, 0.0, -0.7, 0.0, 0.0] + 0.5 * RNG.standard_normal(400))
    found = ranked(searched(BLOCKS, 4.0 * G, always), lambda m: BLOCKS[m].key)
    assert found.best == (1, 3)
    assert found.probability.sum() == pytest.approx(1.0)
    assert found.marginal["b1"] > 0.99
    assert fitted_in(BLOCKS, 4.0 * G, found.best).mean == pytest.approx([1.0, -0.7], abs=0.1)


def test_first_candidates_are_different_effects():
    G = inner(X @ [1.0, 0.9, 0.8, 0.7, 0.0, 0.0])
    assert first_of(BLOCKS, G, lambda i: "ab"[i // 2]) == [0, 2]
    assert first_of(BLOCKS, G, lambda i: str(i), (0,)) == [1, 2, 3]
    # what one drive alone has is tried beside what all share
    assert first_of(BLOCKS, G, lambda _: "a", apart={1, 2}) == [0, 1]


def test_first_candidates_are_shapes_over_time_others_and_the_road():
    right = 400.0 * np.linspace(1.0, 0.2, 9)[:, None]
    G = np.block([[400.0 * np.eye(9), right], [right.T, 1e4]])
    kinds = ["road", "road", "shape", "shape", "shape", "shape", "shape", "shape", "effect"]
    blocks = [block(i, (i,), kind) for i, kind in enumerate(kinds)]
    assert first_of(blocks, G, lambda i: str(i)) == [8, 2, 3, 4, 5, 0]
    # what is over time leaves places for the others
    assert first_of(blocks, G, lambda i: str(i), along={2, 3, 5}) == [8, 2, 3, 4, 6, 7, 0]


def test_a_block_that_may_not_join_does_not():
    G = inner(X @ [0.0, 1.0, 0.0, -0.7, 0.0, 0.0] + 0.5 * RNG.standard_normal(400))
    sets = searched(BLOCKS, 4.0 * G, lambda state, other: {*state.members, BLOCKS.index(other)} != {1, 3})
    assert (1, 3) not in sets
    assert (1,) in sets
    assert (3,) in sets


def test_a_form_is_clear_where_no_effect_explains_it():
    def forms(y):
        G = 4.0 * inner(y + 0.5 * RNG.standard_normal(400))
        sets = ranked(searched(BLOCKS, G, always), lambda m: BLOCKS[m].key)
        return [c.own for c in clear_forms(field_of(BLOCKS), sets, G)], sets, G

    shaped, sets, G = forms(X @ [0.0, 1.0, 0.0, 0.0, 0.8, 0.8])
    assert shaped == [(4,)]
    assert evidence_of(BLOCKS, G, sets.best) > evidence_of(BLOCKS, G, (1,)) + 5.0
    assert forms(X @ [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])[0] == []


def test_a_form_that_does_not_show_takes_nothing_from_the_others():
    blocks = [*BLOCKS[:3], block(3, (3,), "shape"), BLOCKS[4]]
    field = field_of(blocks)
    G = 4.0 * inner(X @ [0.0, 0.0, 0.0, 2.0, 0.4, 0.4] + 0.5 * RNG.standard_normal(400))
    sets = ranked(searched(blocks, G, always), lambda m: blocks[m].key)
    assert set(sets.best) == {3, 4}
    assert [c.own for c in clear_forms(field, sets, G)] == [(3,)]
    assert [c.own for c in clear_forms(field, sets, G, lambda own: own != (3,))] == [(4,)]


def test_probabilities_add_up_over_wheels_and_not_over_signals():
    places = [("signal_delay", "a_x"), ("signal_delay", "v_x"), ("slip_stiffness", "fl"), ("slip_stiffness", "r")]
    asked = tuple(Hypothesis(EFFECTS[e], w, ()) for e, w in places)
    blocks = tuple(Block(h.key, "effect", (i,), np.eye(1), 0.0, i) for i, h in enumerate(asked))
    found = ranked({(i,): 0.0 for i in range(4)}, Field(SimpleNamespace(asked=asked), blocks, np.ones(4), ()).name)
    assert found.marginal == pytest.approx({"signal_delay@a_x": 0.25, "signal_delay@v_x": 0.25, "slip_stiffness": 0.5})
