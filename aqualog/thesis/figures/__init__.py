"""Families of figures: what each draws, and the claims it judges."""
