"""Foreign work within limits: reading libraries run in processes of their own, with time, memory and disk bounded."""
