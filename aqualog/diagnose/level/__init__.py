"""What a campaign's slip slope and resistance say is wrong with the model of tyre and water."""

from aqualog.diagnose.level.run import diagnose_campaign

__all__ = ["diagnose_campaign"]
