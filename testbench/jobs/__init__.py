"""The jobs behind the commands and the public functions."""
