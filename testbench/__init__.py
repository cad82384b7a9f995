"""The simulated robot, its recordings, and the chain from a scenario to a report."""
