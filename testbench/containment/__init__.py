"""Files of strangers: read in a process of their own, within bounds of size, time and memory."""
