"""Files into channels, and signals into files."""
