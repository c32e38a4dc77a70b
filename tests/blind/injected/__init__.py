"""Effects hidden in measured drives: real sensors, roads and drivers, with physics written here alone."""
