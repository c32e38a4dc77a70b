"""Tests of `aqualog.io.messages`."""
