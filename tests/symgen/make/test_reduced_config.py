"""Limits and proxies of a robot that is cut or locked."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from runtime.library import Library
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.cli import app
from symgen.collision.model import BASE, Proxy
from symgen.collision.selection import poses_of_link
from symgen.errors import BuildError
from symgen.make import pipeline
from symgen.make.config import RobotConfig, reduced_config
from symgen.make.request import BuildRequest, bundled_request, request_from_folder

LOCKED = {"fr3_joint3": 0.4, "fr3_joint7": -1.1}


def reduced(options: ChainOptions) -> tuple[Chain, Chain, RobotConfig, RobotConfig]:
    """The FR3 before and after, each with its configuration."""
    request = bundled_request("fr3")
    whole, chain = read_chain(request.urdf), read_chain(request.urdf, options)
    return whole, chain, request.config, reduced_config(request.config, whole, chain)


def ends(chain: Chain, proxy: Proxy, q: np.ndarray) -> np.ndarray:
    """Both ends of a proxy in the base frame, (N, 2, 3) m."""
    poses = poses_of_link(chain, proxy.link, q)
    points = np.array([proxy.start, proxy.end])
    return np.einsum("tij,pj->tpi", poses[:, :3, :3], points) + poses[:, None, :3, 3]


def test_limits_are_those_of_the_joints_that_move() -> None:
    """Property: by name, for every vector and both sides of braking; the tip speed stays."""
    _, chain, before, after = reduced(ChainOptions(locks=LOCKED))
    names = [f"fr3_joint{k}" for k in (1, 2, 4, 5, 6)]
    assert [joint.name for joint in chain.joints] == names
    left = [0, 1, 3, 4, 5]
    for key, values in before.vectors().items():
        assert after.vectors()[key] == tuple(values[k] for k in left), key
    assert after.tip_speed == before.tip_speed


def test_proxies_stay_where_they_are_in_space() -> None:
    """Oracle: places of the whole robot at random poses with the locked joints at their values."""
    whole, chain, before, after = reduced(ChainOptions(locks=LOCKED))
    q = np.random.default_rng(0).uniform(-2, 2, (20, 5))
    full = np.insert(np.insert(q, 2, LOCKED["fr3_joint3"], axis=1), 6, LOCKED["fr3_joint7"], axis=1)
    assert {p.name for p in after.collision.proxies} == {p.name for p in before.collision.proxies}
    for proxy in after.collision.proxies:
        expected = ends(whole, before.collision.named(proxy.name), full)
        # The URDF of the locked robot has angles and positions to rounding.
        assert ends(chain, proxy, q) == pytest.approx(expected, abs=1e-12)
    on = {proxy.name: proxy.link for proxy in after.collision.proxies}
    assert on["link3"] == "fr3_link2"
    pairs = {(p.first, p.second): p.margin for p in after.collision.pairs}
    for pair in before.collision.pairs:
        together = on[pair.first] == on[pair.second]
        assert pairs.get((pair.first, pair.second)) == (None if together else pair.margin)


def test_links_that_are_cut_off_take_their_proxies_along() -> None:
    """Property: beyond the tip, and below a new base, whose proxies become those of the base."""
    _, _, before, after = reduced(ChainOptions(tip="fr3_link5"))
    left = {proxy.link for proxy in after.collision.proxies}
    assert left == {BASE, *(f"fr3_link{k}" for k in range(1, 6))}
    assert 0 < len(after.collision.pairs) < len(before.collision.pairs)
    assert after.acceleration is not None
    assert len(after.acceleration) == 5
    _, chain, _, raised = reduced(ChainOptions(base="fr3_link2", gravity=(0.0, 0.0, -9.81)))
    assert {proxy.link for proxy in raised.collision.proxies} == {
        BASE,
        *(joint.link for joint in chain.joints),
    }
    assert raised.collision.named("link2").link == BASE


@pytest.fixture
def requested(monkeypatch: pytest.MonkeyPatch) -> list[BuildRequest]:
    """Requests that reach the build, which does nothing."""
    seen: list[BuildRequest] = []

    def build(request: BuildRequest, root: Path, *_: object) -> pipeline.BuildResult:
        seen.append(request)
        return pipeline.BuildResult(root / request.name, False, ())

    monkeypatch.setattr("symgen.cli.make.build", build)
    return seen


@pytest.mark.parametrize("by_path", [False, True])
def test_a_bundled_robot_keeps_them(
    requested: list[BuildRequest], tmp_path: Path, by_path: bool
) -> None:
    """Property: by name and by its file; a copy under another name keeps all of them."""
    file = tmp_path / "mine.urdf"
    file.write_text(bundled_request("ur5e").urdf, encoding="utf-8")
    source = ("--urdf", str(file)) if by_path else ("--robot", "ur5e")
    for words in (("--name", "six"), ("--name", "five", "--lock", "wrist_3_joint=0")):
        ran = CliRunner().invoke(app, ["build", *source, *words, "--out", str(tmp_path)])
        assert ran.exception is None
    bundled = bundled_request("ur5e").config
    assert requested[0].config == bundled
    assert requested[1].name == "five"
    assert requested[1].config.collision.pairs
    assert requested[1].config.home == bundled.home[:5]  # type: ignore[index]


def test_a_built_robot_is_mounted_otherwise(
    requested: list[BuildRequest], fr3: Library, tmp_path: Path
) -> None:
    """Property: by the name or path of its folder; only gravity changes."""
    arm = tmp_path / "arm"
    arm.mkdir()
    shutil.copy(fr3.folder / "manifest.json", arm)
    shutil.copy(fr3.folder / "fr3.urdf", arm / "arm.urdf")
    for robot in ("arm", str(arm)):
        words = ["--robot", robot, "--name", "tilted", "--gravity=1,0,-9.75"]
        ran = CliRunner().invoke(app, ["build", *words, "--out", str(tmp_path)])
        assert ran.exception is None
    before = request_from_folder(arm)
    options = replace(before.options, gravity=(1.0, 0.0, -9.75))
    assert requested == [replace(before, name="tilted", options=options)] * 2


def test_a_changed_robot_needs_a_name() -> None:
    """Property: one sentence; the bundled folder stays that of the bundled robot."""
    for words in (["--lock", "fr3_joint7=0"], ["--tip", "fr3_link5", "--name", "fr3"]):
        error = CliRunner().invoke(app, ["build", *words]).exception
        assert isinstance(error, BuildError)
        assert str(error).startswith("a changed 'fr3' needs a --name")
