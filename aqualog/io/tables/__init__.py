"""Logs that are one table: CSV and Parquet."""
