"""Claims of chapter 2 that the simulation bears out must go on doing so; those that it does not are named here."""

import pytest
from thesis.simulated_claims import CLAIMS

SEEDS = tuple(range(2001, 2009))
# the rear wheels spin up later than the front ones stop (C16); the film's and the shift's drag grow with depth (C38);
# pressure changes the contact and with it the resistance: C43 and C45 cannot both hold (audit E21); at high pressure
# the slope falls less, so that the curves cross instead of meeting (C53, in part)
NOT_BORNE_OUT = {"c16", "c38", "c43", "c53"}
# resistance and first dip come at the same 91 to 92 km/h (C3); the depth moves the rear slope by about as much as runs
# scatter (C50); one pass in five has a dip at 89 km/h (C14): which side they fall on is the business of the seeds
AT_THE_EDGE = {"c3", "c14", "c50"}


@pytest.mark.parametrize("claim", [c for c in CLAIMS if c.__name__ not in AT_THE_EDGE], ids=lambda c: c.__name__)
def test_claim(claim):
    outcome = claim(SEEDS)
    assert outcome.holds == (claim.__name__ not in NOT_BORNE_OUT), f"{outcome.claim}: {outcome.figure}"
