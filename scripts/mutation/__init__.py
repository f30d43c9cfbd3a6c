"""Seeded mutation runs: altered lines of the product, and the tests that should notice them."""
