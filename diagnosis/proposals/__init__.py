"""Effects that need a search of their own: ripples, limits, pushes, low-speed friction, plays, springs."""
