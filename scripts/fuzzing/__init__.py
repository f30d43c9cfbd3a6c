"""Fuzzing of every reader: a damaged file is read, or refused in one sentence."""
