"""Files that a training run imports: whole draws, each used equally often, and ranges."""

import json
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from runtime.library.parameters import links, mass
from tests.runtime.conftest import Command
from tests.runtime.monitoring.conftest import Monitored

COUNT = 12


@pytest.fixture
def folder(command: Command, monitored: Monitored, tmp_path: Path) -> Path:
    """Every file of `--to` for a dozen draws."""
    words = ("--count", COUNT, "--to", "json,playground,mjlab,isaaclab", "--out", "a")
    ran = command("sample", monitored.folder, *words)
    assert ran.code == 0, ran.err
    return tmp_path / "a"


def test_arrays_are_those_of_the_draws(folder: Path) -> None:
    """Oracle: π and φ of samples.npz; principal axes and moments give the inertia back."""
    facts = json.loads((folder / "randomisation.json").read_text())
    draws = {key: np.array(values) for key, values in facts["draws"].items()}
    with np.load(folder / "samples.npz") as file:
        pi, phi = file["pi"], file["phi"]
    assert len(facts["links"]) == 7
    np.testing.assert_allclose(draws["mass"], mass(links(pi.ravel())).reshape(COUNT, 7))
    np.testing.assert_allclose(draws["damping"], phi[:, :, 0])
    w, *vector = np.moveaxis(draws["axes"], -1, 0)
    x, y, z = vector
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], -1)
    moved = np.einsum("nlij,nlj->nli", draws["inertia"], first)
    np.testing.assert_allclose(moved, draws["moments"][..., :1] * first, atol=1e-9)
    low, high = np.array(facts["ranges"]["mass"])
    inside = (draws["mass"] >= low) & (draws["mass"] <= high)
    assert 0.7 < inside.mean() < 1.0
    with np.load(folder / "randomisation.npz") as file:
        np.testing.assert_array_equal(file["mass"], draws["mass"])


class View:
    """Tensors of PhysX for four environments, with the functions that Isaac Lab documents."""

    def __init__(self, torch: Any) -> None:
        self.values = {"masses": (4, 8), "inertias": (4, 8, 9), "coms": (4, 8, 7)}
        self.values = {key: torch.zeros(size) for key, size in self.values.items()}

    def __getattr__(self, name: str) -> Any:
        """get_masses(), set_masses(values, env_ids) and so on."""
        verb, _, key = name.partition("_")
        if verb == "get":
            return self.values[key].clone
        return lambda values, env_ids: self.values[key].__setitem__(env_ids, values[env_ids])


def test_isaac_lab_gets_whole_draws(folder: Path) -> None:
    """Property: bodies and joints of an environment are of one draw; others stay as they are.

    Isaac Lab itself is no package of the index: a stub has the functions of its documentation.
    """
    torch = pytest.importorskip("torch", reason="SKIPPED LOUDLY: no torch on this machine")
    module = runpy.run_path(str(folder / "randomise_isaaclab.py"))
    draws, written = module["DRAWS"], {}

    def write(key: str) -> Any:
        def into(values: Any, joint_ids: list[int], env_ids: Any) -> None:
            written[key] = (values.numpy(), joint_ids, env_ids.tolist())

        return into

    view = View(torch)
    names = ("armature", "friction_coefficient", "viscous_friction_coefficient")
    asset = SimpleNamespace(
        root_physx_view=view,
        device="cpu",
        body_names=["base", *module["LINKS"]],
        joint_names=list(reversed(module["JOINTS"])),
        **{f"write_joint_{name}_to_sim": write(name) for name in names},
    )
    env = SimpleNamespace(scene={"robot": asset})
    taken = module["randomize"](env, torch.tensor([1, 3]), SimpleNamespace(name="robot")).tolist()
    assert len(set(taken)) == 2
    masses, inertias = view.values["masses"].numpy(), view.values["inertias"].numpy()
    np.testing.assert_allclose(masses[[1, 3], 1:], draws["mass"][taken], rtol=1e-6)
    right = draws["inertia"][taken].reshape(2, 7, 9)
    np.testing.assert_allclose(inertias[[1, 3], 1:], right, rtol=1e-5)
    np.testing.assert_allclose(view.values["coms"][3, 1:, :3], draws["com"][taken[1]], rtol=1e-5)
    assert not masses[[0, 2]].any()
    assert not masses[:, 0].any()
    values, joints, environments = written["viscous_friction_coefficient"]
    np.testing.assert_allclose(values, draws["damping"][taken], rtol=1e-6)
    assert joints == [6, 5, 4, 3, 2, 1, 0]
    assert environments == [1, 3]


def test_files_for_mujoco_are_python(folder: Path) -> None:
    """Property: they compile; `scripts/check_randomisation` runs them in their simulators."""
    for name in ("playground", "mjlab"):
        text = (folder / f"randomise_{name}.py").read_text()
        compile(text, name, "exec")
        assert f"{COUNT} draws" in text
