"""The documents of aqualog: pages, search, and the reference that is generated from tables in the code."""
