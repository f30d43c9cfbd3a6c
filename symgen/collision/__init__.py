"""Capsules that enclose the links: their placement, pairs that must keep a distance, their fit."""
