"""One scorer for sealed cases of any world: it reads the JSON of `aqualog diagnose` and nothing of the engine's inside."""
