"""File formats of a certified motion, one module each."""
