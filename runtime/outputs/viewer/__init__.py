"""Viewer of a moving robot in a browser, by viser."""
