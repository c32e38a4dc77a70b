"""Results into pages; no physics here."""
