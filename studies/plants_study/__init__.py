"""Robots of independent plants drawn, diagnosed and scored."""
