"""Detectors of the prior art that the thesis cites, in the frame of its own: small, from the published idea."""
