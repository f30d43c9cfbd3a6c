"""The programs that a file is for, each asked what it read; missing ones answer None.

This is the only room that may import pinocchio, mujoco, pydrake and yaml.
"""

from runtime.outputs.model_files.engines.answer import Reloaded, Unreadable, random_states

__all__ = ["Reloaded", "Unreadable", "random_states"]
