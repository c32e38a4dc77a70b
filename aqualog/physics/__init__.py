"""Pure functions of vehicle, tyre and water; no state, no files."""
