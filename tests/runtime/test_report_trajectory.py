"""runtime.report.trajectory: what the picture shows is the motion, and it can be written."""

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from runtime import load
from runtime.certificate import KINDS, joint_bounds
from runtime.errors import RuntimeFault
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.report.trajectory import uses, write_picture


def test_uses_are_those_of_the_certificate(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Oracle: the largest drawn share is the proven bound, to the step of the samples."""
    t = np.linspace(0, 10, 10_001)
    shares = uses(lib, trajectories[0], trajectories[0].at(lib, t))
    bounds, _ = joint_bounds(lib, trajectories[0])
    assert tuple(shares) == KINDS
    for share, bound in zip(shares.values(), bounds, strict=True):
        assert share.max(axis=0) == pytest.approx(bound, rel=1e-5)


def test_the_picture_is_a_png(
    lib: Library, trajectories: tuple[Trajectory, ...], tmp_path: Path, tiny_built: Path
) -> None:
    """Property: a picture per motion, the same bytes twice; rest and few limits draw as well."""
    first, again = tmp_path / "a.png", tmp_path / "b.png"
    write_picture(lib, trajectories[0], first)
    write_picture(lib, trajectories[0], again)
    assert first.read_bytes() == again.read_bytes()
    picture = matplotlib.image.imread(first)
    assert picture.shape[:2] == (1319, 1300)
    assert picture[..., :3].std() > 0.05
    tiny = load(tiny_built)
    write_picture(tiny, Trajectory(tiny.home, np.zeros((1, 2)), 3.0), tmp_path / "c.png")
    assert len(list(tmp_path.iterdir())) == 3
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RuntimeFault, match="cannot write"):
        write_picture(lib, trajectories[0], tmp_path / "file" / "a.png")
