"""Standing judges: recordings of real robots and independent simulated plants, diagnosed and scored."""
