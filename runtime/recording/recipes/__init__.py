"""Recipes: what the columns of a log file mean."""
