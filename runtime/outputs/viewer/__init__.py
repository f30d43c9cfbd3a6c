"""Viewer of a moving robot in a browser, by viser."""

from runtime.outputs.viewer.player import PlayedMotion, Player, read_motion
from runtime.outputs.viewer.scene import Scene
from runtime.outputs.viewer.shapes import Look, look_of

__all__ = ["Look", "PlayedMotion", "Player", "Scene", "look_of", "read_motion"]
