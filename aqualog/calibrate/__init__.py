"""Estimate what detectors must know of a car from its dry drives."""
