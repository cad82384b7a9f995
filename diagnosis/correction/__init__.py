"""The corrected model: as numbers, along another motion, as MJCF, in closed loop."""
