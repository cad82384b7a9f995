"""Logs to equations: what was lost mended, filtered and decimated once, and which joints move."""
