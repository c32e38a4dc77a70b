"""The thesis made again: its claims and figures as data, their evidence, one judge."""
