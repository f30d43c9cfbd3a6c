"""Files of a fleet's folder that are no statistics."""

from pathlib import Path

import pytest

from runtime.errors import IdentificationError
from runtime.library import load
from runtime.monitoring.fleet.gather import gather


def test_a_link_to_nothing_among_the_units_is_refused(tiny_built: Path, tmp_path: Path) -> None:
    """Property: a sentence that names the file, not the error of the system."""
    (tmp_path / "u0").mkdir()
    (tmp_path / "u0" / "statistics.npz").symlink_to(tmp_path / "nothing")
    with pytest.raises(IdentificationError, match=r"no statistics at '.*u0/statistics.npz'"):
        gather(load(tiny_built), tmp_path, tmp_path / "parts")
