"""The build: from a request to a compiled library; here the robots that come with symgen."""

from pathlib import Path

VERSION = "0.1.0"  # version of symgen
ROBOTS = Path(__file__).parents[1] / "robots"  # folder with a URDF and a configuration per robot


def bundled_robots() -> list[str]:
    """Names of the robots that come with symgen."""
    return sorted(path.stem for path in ROBOTS.glob("*.urdf"))


def bundled_name(text: str) -> str | None:
    """Name of the bundled robot whose URDF has this text; None for other robots."""
    for name in bundled_robots():
        if (ROBOTS / f"{name}.urdf").read_text(encoding="utf-8") == text:
            return name
    return None
