"""Gradient descent in λ: λ-Adam and Levenberg–Marquardt on samples or statistics."""

PRESET_NAMES = ("simulation", "real", "full")
"""Names of `PRESETS` in `fit`, for help texts without its import."""
