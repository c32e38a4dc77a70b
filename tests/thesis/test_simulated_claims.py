"""Claims of chapter 2 that the simulation bears out must go on doing so; those that it does not are named here."""

import pytest

from aqualog.thesis.checks import resistance, slip_slope, spins
from aqualog.thesis.claims import DIFFERENCE, NOT_REPRODUCED, REPRODUCED, combined
from aqualog.thesis.evidence.seeds import PASS_SEEDS, Plan

SEEDS = tuple(range(2001, 2007))
# the rear wheels spin up later than the front ones stop (C16); the
# film's and the shift's drag grow with depth (C38); pressure changes the contact and with it the resistance: C43 and C45
# cannot both hold (audit E21); a regression lies below the mean initial slope (C49); at high pressure the slope falls
# less, so that the curves cross instead of meeting (C53)
ELSE = {
    "C16": DIFFERENCE, "C38": DIFFERENCE, "C43": NOT_REPRODUCED, "C48": DIFFERENCE,
    "C49": DIFFERENCE, "C53": DIFFERENCE, "C55": DIFFERENCE,
}  # fmt: skip
# resistance and first dip come at the same 91 to 93 km/h (C3); one pass in four has a dip at 89 km/h (C14); two or four
# cases of acceleration in 27 are mixed (C21); left and right differ by 0.01 (C23); the depth moves the rear slope by
# about as much as runs scatter (C50); the interval of six seeds is wider than the 10 km/h it must lie in (C17): which side
# they fall on is the business of the seeds
AT_THE_EDGE = {"C3", "C14", "C17", "C21", "C23", "C50"}
MAKERS = {
    m.claims[0]: m.checks for module in (spins, resistance, slip_slope) for m in module.CHECKS if m.seeds == PASS_SEEDS
}


@pytest.mark.parametrize("claim", [c for c in MAKERS if c not in AT_THE_EDGE])
def test_claim(claim):
    checks = MAKERS[claim](Plan(SEEDS))
    assert {c.claim for c in checks} == {claim}
    assert combined(c.verdict for c in checks) == ELSE.get(claim, REPRODUCED), "; ".join(c.found for c in checks)


@pytest.mark.parametrize("claim", sorted(AT_THE_EDGE))
def test_a_claim_at_the_edge_says_what_was_found(claim):
    for c in MAKERS[claim](Plan(SEEDS)):
        assert c.value is not None
        assert c.ci95 is not None
        assert c.ci95[0] <= c.value <= c.ci95[1]
