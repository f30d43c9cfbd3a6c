"""Estimators: a `Problem` in, a `Fit` out."""
