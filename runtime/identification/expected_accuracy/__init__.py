"""Expected standard deviations of a planned or recorded motion, and the gain of recording more."""
