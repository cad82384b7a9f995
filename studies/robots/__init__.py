"""Published robot models, each taken from its file to a diagnosis."""
