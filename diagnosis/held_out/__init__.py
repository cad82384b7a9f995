"""What runs that were left out say of a fit: how much of it to keep, and whether the runs are alike."""
