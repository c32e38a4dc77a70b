"""Evidence for the thesis' claims: campaigns, scenes, simulated passes, drawn drives, the half-car."""
