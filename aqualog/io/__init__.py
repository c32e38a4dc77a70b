"""Read files into channels, and write signals into files."""
