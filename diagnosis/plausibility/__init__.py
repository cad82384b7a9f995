"""Plausibility of fitted effects: their sizes against healthy robots, other joints and sensor errors."""
