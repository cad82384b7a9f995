"""Held-out runs against a fit: how much of it to keep, and whether the runs are alike."""
