"""Two mechanisms, built once per session: a palletizing robot with a loop, and coupled joints."""

from pathlib import Path

import numpy as np
import pytest

from runtime.library import Library, load
from symgen.chain import ChainOptions
from symgen.chain.mechanism import mechanism_from_table
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.linkages import palletizer as make_palletizer
from tests.robots import DATA, ONE_LEVEL

PALLETIZER = make_palletizer(np.random.default_rng(7))
WRIST = {
    "coupling": [
        {"joint": "left_roll", "of": {"trunk_turn": 0.5, "left_lift": -1.25}, "offset": 0.2},
        {"joint": "right_lift", "of": {"left_roll": 2.0}, "offset": -0.1},
    ],
    "spring": [
        {"name": "back", "joint": "left_lift", "rest": 0.3},
        {"name": "held", "joint": "left_roll", "stiffness": 2.0},
        {
            "name": "strut",
            "parent": "floor",
            "parent_xyz": [0.5, 0.0, 0.8],
            "child": "left_arm",
            "child_xyz": [0.2, 0.0, 0.05],
            "rest": 0.1,
        },
    ],
    "known_torque": [
        {"joint": "trunk_turn", "polynomial": [0.5, -1.0, 0.25]},
        {"joint": "right_lift", "x": [-1.0, 0.0, 2.0], "torque": [1.0, 0.0, 3.0]},
    ],
}


def _built(root: Path, name: str, urdf: str, mechanism: dict[str, object]) -> Path:
    options = ChainOptions(mechanism=mechanism_from_table(mechanism, "M"))
    return build(BuildRequest(name, urdf, options), root, levels=ONE_LEVEL).folder


@pytest.fixture(scope="session")
def palletizer_folder(root: Path) -> Path:
    """A waist, an arm, and a forearm that a parallelogram of crank and rod moves."""
    return _built(root, "palletizer", PALLETIZER.urdf, PALLETIZER.mechanism)


@pytest.fixture(scope="session")
def palletizer(palletizer_folder: Path) -> Library:
    """Its library."""
    return load(palletizer_folder)


@pytest.fixture(scope="session")
def wrist(root: Path) -> Library:
    """Four joints, two of which follow the others, with springs and torque curves."""
    return load(_built(root, "wrist", (DATA / "tree.urdf").read_text(), WRIST))
