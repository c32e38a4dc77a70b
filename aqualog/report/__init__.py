"""Turns results into pages, tables and documents; computes no physics."""
