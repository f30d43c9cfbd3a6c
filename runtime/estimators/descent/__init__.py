"""Gradient descent in λ: λ-Adam and Levenberg–Marquardt on samples or statistics."""
