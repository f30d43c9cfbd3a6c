"""Comparison of methods on the same problem: one row each, advice, and files."""
