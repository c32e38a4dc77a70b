"""Errors of the simulation: residuals, causes, causes that cannot be distinguished, extended model and its gain."""
