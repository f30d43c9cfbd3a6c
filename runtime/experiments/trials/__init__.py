"""Monte Carlo trials of the experiments."""
