"""The search for the best motion: criteria, optimisers, starts."""
