"""The thesis' figures, made again: each with the claims it stands for and what the runs say about them."""
