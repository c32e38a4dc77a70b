"""How far a drive is from full aquaplaning."""
