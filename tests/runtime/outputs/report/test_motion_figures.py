"""runtime.outputs.report.motion_figures: the panels show the profile, and they can be written."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from runtime import load
from runtime.errors import RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.certificate import certified
from runtime.library import Library
from runtime.outputs.report.canvas import VERMILION, blank, settings
from runtime.outputs.report.motion_figures import (
    MotionProfile,
    draw_motion,
    draw_space,
    draw_speed,
    profile_of,
    write_pictures,
)

SAFETY = Safety(table=0.0, box=(-1.0, 1.0, -1.0, 1.0, 0.1, np.inf), viscous=(0.5,))
NAMES = ["a.png", "a-speed.png", "a-space.png"]


@pytest.fixture(scope="module")
def shown(lib: Library, trajectories: tuple[Trajectory, ...]) -> MotionProfile:
    return profile_of(certified(lib, trajectories[0], SAFETY))


def drawn_by(draw: Callable[[Figure, MotionProfile], None], profile: MotionProfile) -> Figure:
    with blank((8.0, 6.0), settings()) as figure:
        draw(figure, profile)
    return figure


def curve(axis: Axes, k: int = 0) -> np.ndarray:
    return np.asarray(axis.lines[k].get_ydata(), dtype=float)


def limits_of(axis: Axes) -> list[float]:
    lines = [k for k, line in enumerate(axis.lines) if line.get_color() == VERMILION]
    return [float(y[0]) for y in (curve(axis, k) for k in lines) if y.size]


def test_every_joint_has_its_panels(shown: MotionProfile) -> None:
    """Property: q, dq, ddq, torque per row with units, limits drawn or in the title; use."""
    figure = drawn_by(draw_motion, shown)
    rows = np.array(figure.axes).reshape(7, 5)
    for j, row in enumerate(rows):
        assert row[0].get_title("left").startswith(shown.joints[j])
        units = [axis.get_ylabel() for axis in row]
        assert units == ["rad", "rad/s", "rad/s²", "N·m", "%"]
        for kind, axis in zip(
            ("position", "velocity", "acceleration", "torque"), row, strict=False
        ):
            assert np.array_equal(curve(axis), shown.motion[kind][:, j])
            ends = [shown.bands[kind].lower[j], shown.bands[kind].upper[j]]
            drawn = limits_of(axis)
            assert drawn == pytest.approx(ends[-len(drawn) :] if drawn else [])
            assert len(drawn) == 2 or "limit" in axis.get_title("left")
        assert [line.get_label() for line in row[4].lines[:-1]] == list(shown.shares)
    assert rows[0, 3].get_title("right") == "torque with friction"
    assert [axis.get_xlabel() for axis in rows[-1]] == ["time [s]"] * 5
    text = figure.get_suptitle()
    assert "do NOT all hold" in text
    assert "torque" in text


def test_velocity_over_position(shown: MotionProfile) -> None:
    """Property: a panel per joint with its motion and both bounds."""
    figure = drawn_by(draw_speed, shown)
    panels = [axis for axis in figure.axes if axis.axison]
    assert [axis.get_title("left") for axis in panels] == list(shown.joints)
    for j, axis in enumerate(panels):
        assert np.array_equal(curve(axis), shown.motion["velocity"][:, j])
        drawn = [curve(axis, k) for k, x in enumerate(axis.lines) if x.get_color() == VERMILION]
        assert np.array_equal(drawn[0], shown.envelopes[j].upper)
        assert np.array_equal(drawn[1], shown.envelopes[j].lower)
        assert axis.get_xlabel() == "q [rad]"


def test_path_and_distances(shown: MotionProfile) -> None:
    """Property: the tip's path, twelve edges of the box, the table; the closest four are bold."""
    figure = drawn_by(draw_space, shown)
    path, *panels = (axis for part in figure.subfigs for axis in part.axes)
    assert [axis.get_title("left") for axis in panels] == [
        "distance between links [m]",
        "height above the table [m]",
    ]
    tip = np.array(next(line for line in path.lines if line.get_label() == "tip").get_data_3d()).T
    assert np.array_equal(tip, shown.tip)
    assert sum(line.get_color() == VERMILION for line in path.lines) == 12
    assert [part.get_label() for part in path.collections] == ["table"]
    for axis, kind in zip(panels, ("self-collision", "table"), strict=True):
        gaps = sorted((g for g in shown.gaps if g.kind == kind), key=lambda g: g.left)
        names = [str(line.get_label()) for line in axis.lines]
        bold = [k for k, name in enumerate(names) if name.endswith("mm")]
        for k, gap in zip(bold, gaps[:4], strict=True):
            assert names[k].startswith(f"{gap.label}: {1e3 * gap.least:.1f} / {1e3 * gap.margin:g}")
            assert np.array_equal(curve(axis, k), gap.values)
        assert set(limits_of(axis)) == {gap.margin for gap in gaps}
        broken = any(gap.left < 0 for gap in gaps)
        assert bool(axis.patches) == broken


def test_unchecked_limits_are_listed(shown: MotionProfile) -> None:
    """Property: no gaps is no clearance; unchecked distances say so."""
    for left, words in (
        (replace(shown, gaps=(), table=None, box=None), "no collision proxies"),
        (
            replace(shown, certificate=replace(shown.certificate, unchecked=("self-collision",))),
            "NOT checked",
        ),
    ):
        figure = drawn_by(draw_space, left)
        panel = figure.subfigs[1].axes[0]
        texts = [panel.get_title("left"), *(text.get_text() for text in panel.texts)]
        assert any(words in text for text in texts)


def test_the_pictures_are_pngs(shown: MotionProfile, tmp_path: Path, tiny_built: Path) -> None:
    """Property: three pictures per motion, the same bytes twice; a small robot draws as well."""
    first = write_pictures(shown, tmp_path / "a.png")
    assert [path.name for path in first] == NAMES
    sizes = [(1300, 1950), (754, 1560), (728, 1690)]
    for path, size in zip(first, sizes, strict=True):
        picture = matplotlib.image.imread(path)
        assert picture.shape[:2] == size
        assert picture[..., :3].std() > 0.05
    tiny = load(tiny_built)
    small = profile_of(certified(tiny, Trajectory(tiny.home, np.zeros((1, 2)), 3.0)))
    twice = [write_pictures(small, tmp_path / name) for name in ("b.png", "c.png")]
    for one, other in zip(*twice, strict=True):
        assert one.read_bytes() == other.read_bytes()
    assert len(list(tmp_path.iterdir())) == 9
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RuntimeFault, match="cannot write"):
        write_pictures(small, tmp_path / "file" / "a.png")
    assert (tmp_path / "file").read_text() == "mine"
