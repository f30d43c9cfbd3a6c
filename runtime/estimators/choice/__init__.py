"""Choices made by cross-validation on a log: friction model, cut-off, form of the equations."""
