"""Tests of `aqualog.io.tables`."""
