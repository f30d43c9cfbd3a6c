"""Estimators: a `Problem` in, a `Fit` out; `methods.METHODS` lists them by name."""
