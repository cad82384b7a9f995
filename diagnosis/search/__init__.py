"""The greedy search for the hypothesis, one effect a round."""
