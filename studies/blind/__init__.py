"""Withheld effects: cases whose answer is sealed, and how often the diagnosis finds it."""
