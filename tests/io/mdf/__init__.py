"""Tests of `aqualog.io.mdf`."""
