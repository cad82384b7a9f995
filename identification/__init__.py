"""Identification of robot dynamics: arrays in, arrays out. No files, no stepping, no printing."""
