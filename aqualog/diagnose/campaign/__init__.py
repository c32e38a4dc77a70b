"""Diagnosis of the tyre and water model from a campaign's slip slope and resistance."""

from aqualog.diagnose.campaign.run import diagnose_campaign

__all__ = ["diagnose_campaign"]
