"""Report what is wrong with a log, what was lost of it, and what to do."""
