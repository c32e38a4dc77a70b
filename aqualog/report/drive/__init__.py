"""The result of one drive for a reader."""
