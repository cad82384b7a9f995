"""The gap between simulator and robot: where it lies, which effect causes it, how far it shrinks."""
