"""Which fitted effects are reported, how probable each is, and what a diagnosis holds."""
