"""Effects in the drive: its gains, its limits, its supply."""
