"""Whether the simulation of a car is valid on measured drives: boundaries in cross plots, and a rating over time."""
