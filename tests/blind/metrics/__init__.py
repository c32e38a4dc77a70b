"""The acceptance metrics: rows of blind cases in, measured figures with intervals out."""
