"""Fits of a hypothesis: bounded normal equations, scores of candidates, likelihood, shapes, linearisation."""
