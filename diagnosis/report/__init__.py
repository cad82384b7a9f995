"""The readable diagnosis: the JSON, one page, ten lines for the terminal, and a session for Rerun."""
