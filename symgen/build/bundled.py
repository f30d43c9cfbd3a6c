"""Names and files of the robots that come with symgen; nothing of the build is imported."""

from pathlib import Path

ROBOTS = Path(__file__).parents[1] / "robots"
"""Folder with a URDF and a configuration per robot."""


def bundled_robots() -> list[str]:
    """Names of the robots that come with symgen."""
    return sorted(path.stem for path in ROBOTS.glob("*.urdf"))
