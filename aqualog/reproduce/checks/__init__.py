"""Checks of the claims, one module a topic."""
