"""Read TOML files into frozen records."""
