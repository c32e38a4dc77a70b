"""MDF 3 and 4: one walk over the blocks checks them, counts what is lost, and yields what is read."""
