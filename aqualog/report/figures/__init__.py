"""One figure per file: a drive's result into rows of one stack over time."""
