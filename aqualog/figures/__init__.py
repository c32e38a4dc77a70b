"""The thesis' figures, made again: each with its claims and their result in the runs."""
