"""Motions that excite a robot: trajectories, criteria, limits, design."""
