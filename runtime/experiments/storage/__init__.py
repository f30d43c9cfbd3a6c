"""Files of an experiment: results, chunks, locks."""
