"""Capsules of the bundled robots: every link has one, home is free, folded postures are not."""

import casadi as ca
import numpy as np
import pytest

from symgen.chain import Chain, read_chain
from symgen.collision.distance import clearance
from symgen.collision.model import BASE, CollisionModel
from symgen.make import ROBOTS
from symgen.make.config import home_of, read_config

FOLDED = {
    "ur5e": {
        "forearm on upper arm": [0.0, -1.57, 3.1, 0.0, 0.0, 0.0],
        "wrist 3 in forearm": [0.0, -1.57, 1.57, -3.0, 3.1, 0.0],
        "wrist in base": [0.0, 0.4, 2.6, 0.0, 0.0, 0.0],
    },
    "fr3": {"hand in base": [0.0, 1.7, 0.0, -3.0, 0.0, 0.6, 0.0]},
}


def bundled(robot: str) -> tuple[Chain, CollisionModel, np.ndarray]:
    chain = read_chain((ROBOTS / f"{robot}.urdf").read_text())
    known = read_config(ROBOTS / f"{robot}.toml")
    return chain, known.collision, np.array(home_of(chain, known))


def gaps(chain: Chain, model: CollisionModel, q: np.ndarray) -> np.ndarray:
    """Distance of every pair less its margin, m."""
    symbol = ca.SX.sym("q", len(chain.joints))
    distance = ca.Function("d", [symbol], [clearance(chain, model, symbol)[0]])
    return np.asarray(distance(q)).ravel() - np.array([pair.margin for pair in model.pairs])


@pytest.mark.parametrize("robot", FOLDED)
def test_every_link_has_a_proxy_and_home_is_free(robot: str) -> None:
    """Property: links and base are covered, the arm may rest at home with room to begin."""
    chain, model, home = bundled(robot)
    links = {BASE, *(joint.link for joint in chain.joints)}
    assert {proxy.link for proxy in model.proxies} == links
    assert gaps(chain, model, home).min() > 0.005


@pytest.mark.parametrize(("robot", "posture"), [(r, p) for r in FOLDED for p in FOLDED[r]])
def test_folded_postures_are_collisions(robot: str, posture: str) -> None:
    """Property: an arm folded into itself breaks a margin."""
    chain, model, _ = bundled(robot)
    assert gaps(chain, model, np.array(FOLDED[robot][posture])).min() < 0
