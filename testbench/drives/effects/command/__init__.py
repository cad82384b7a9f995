"""Effects on the way of the command to the drive."""
