"""A campaign for a reader: regressions, test matrix, and the folder of pages and tables."""
