"""A mapping guessed from names, formats and values, each guess with its reason."""

from .guess import Guess, guess_mapping

__all__ = ["Guess", "guess_mapping"]
