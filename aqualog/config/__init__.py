"""TOML files into frozen records."""
