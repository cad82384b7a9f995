"""The next experiment: what stays open, and the motion that separates it best."""
