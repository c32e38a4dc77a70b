"""The thesis' claims, one by one, with aqualog's findings."""
