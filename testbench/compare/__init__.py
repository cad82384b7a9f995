"""The source's comparisons, repeated over seeds and noise levels: criteria, estimators, differentiation,
trajectories.

A comparison is a grid of independent cases. Each finished case is a file, so that an interrupted
comparison goes on where it stopped.
"""
