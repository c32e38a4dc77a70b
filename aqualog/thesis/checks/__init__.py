"""Checks of the claims beside those that figures hold, one module a topic."""
