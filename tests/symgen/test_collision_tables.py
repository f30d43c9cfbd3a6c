"""Tables of proxies in a configuration: every fault is named."""

import pytest

from symgen.collision.model import BASE, CollisionModel, Proxy
from symgen.errors import BuildError, CollisionError
from symgen.make.config import config_from_table

BALL = {"name": "a", "link": BASE, "start": [0, 0, 0], "end": [0, 0, 1], "radius": 0.1}


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"proxy": [BALL, BALL]}, "two proxies are called 'a'"),
        ({"proxy": [BALL | {"radius": 0.0}]}, "radius above 0"),
        (
            {"proxy": [BALL | {"radius": float("nan")}]},
            r"proxy\[0\]\.radius expects a finite number",
        ),
        ({"proxy": [BALL | {"start": [0, 0]}]}, r"proxy\[0\]\.start expects a list of length 3"),
        ({"proxy": [BALL | {"colour": 1}]}, r"the unknown key 'colour' in proxy\[0\]"),
        ({"proxy": [BALL], "pair": [{"first": "a", "second": "b", "margin": 0}]}, "proxy 'b'"),
        ({"proxy": [BALL], "pair": [{"first": "a", "second": "a", "margin": 0}]}, "two proxies"),
        ({"tip_speed": -1.0}, "tip_speed expects a number above 0"),
        ({"braking": {"k": [1.0]}}, "expects the key c in braking, got none; add it"),
        (
            {"braking": {k: [0.0] for k in ("k", "c", "upper", "lower")}},
            r"braking\.k expects limits above 0 for every joint, got",
        ),
        ({"jerk": [1.0, 0.0]}, "jerk expects limits above 0 for every joint, got \\[1.0, 0.0\\]"),
        (
            {"acceleration": [-2.0]},
            "acceleration expects limits above 0 for every joint, got \\[-2.0\\]",
        ),
        ({"torque_rate": [float("inf")]}, r"torque_rate\[0\] expects a finite number"),
    ],
)
def test_tables_that_contradict_themselves(table: dict, sentence: str) -> None:
    """Property: each fault is named."""
    with pytest.raises((CollisionError, BuildError), match=sentence):
        config_from_table(table, "here")


def test_proxies_of_another_robot_are_refused() -> None:
    """Property: a link that the chain does not move is named with those that it does."""
    model = CollisionModel((Proxy("a", "fr3_link1", (0, 0, 0), (0, 0, 1), 0.1),))
    with pytest.raises(CollisionError, match=r"'fr3_link1', which does not move.*l0"):
        model.joint_of(model.proxies[0], ["l0"])
