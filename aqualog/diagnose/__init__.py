"""What the simulation gets wrong: residuals, causes, what cannot be told apart, the extended model and its gain."""
