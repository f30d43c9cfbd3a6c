"""The classical methods: the same `Problem` in, the same `Fit` out."""
