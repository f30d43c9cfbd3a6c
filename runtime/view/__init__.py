"""The moving robot in a browser, with viser; nothing here is needed to compute."""

from runtime.view.motion import Motion, read_motion
from runtime.view.player import Player
from runtime.view.scene import Scene
from runtime.view.shapes import Look, look_of

__all__ = ["Look", "Motion", "Player", "Scene", "look_of", "read_motion"]
