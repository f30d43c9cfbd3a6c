"""Configuration of a robot whose URDF was cut or locked: what remains of its limits and proxies.

Values per joint are those of the joints that still move. A proxy follows its link: the link of a
locked joint is fixed to its parent, in whose frame the proxy gets the pose of the joint at the
locked value; links beyond --tip and below --base are cut off with their proxies.
"""

from dataclasses import asdict, replace

import numpy as np
import pinocchio

from symgen.build.config import Braking, RobotConfig, Vector
from symgen.chain import Chain
from symgen.chain.document import Document
from symgen.chain.reading import parse_with_pinocchio
from symgen.collision import BASE, CollisionModel, Proxy


def reduced_config(config: RobotConfig, whole: Chain, chain: Chain) -> RobotConfig:
    """Configuration of a chain from that of the whole robot."""
    names = [joint.name for joint in whole.coordinates]
    kept = [names.index(joint.name) for joint in chain.coordinates]

    def of_joints(values: Vector | None) -> Vector | None:
        if values is None or len(values) != len(names):
            return values
        return tuple(values[k] for k in kept)

    braking = config.braking
    if braking is not None:
        sides = {key: of_joints(value) for key, value in asdict(braking).items()}
        braking = Braking(**sides)  # type: ignore[arg-type]
    return replace(
        config,
        home=of_joints(config.home),
        acceleration=of_joints(config.acceleration),
        jerk=of_joints(config.jerk),
        torque_rate=of_joints(config.torque_rate),
        braking=braking,
        collision=_collision(config.collision, whole, chain),
    )


def _collision(model: CollisionModel, whole: Chain, chain: Chain) -> CollisionModel:
    robot = parse_with_pinocchio(Document(chain.urdf))
    carried = (_carried(proxy, robot, whole, chain) for proxy in model.proxies)
    proxies = tuple(proxy for proxy in carried if proxy is not None)
    carrier = {proxy.name: proxy.link for proxy in proxies}
    pairs = tuple(
        pair
        for pair in model.pairs
        if pair.first in carrier
        and pair.second in carrier
        and carrier[pair.first] != carrier[pair.second]  # their distance does not change
    )
    return CollisionModel(proxies, pairs)


def _carried(proxy: Proxy, robot: pinocchio.Model, whole: Chain, chain: Chain) -> Proxy | None:
    """The proxy on the link that carries it now; None where its link was cut off."""
    link = whole.base if proxy.link == BASE else proxy.link
    if not robot.existFrame(link, pinocchio.BODY):
        return None
    frame = robot.frames[robot.getFrameId(link, pinocchio.BODY)]
    joint = int(frame.parentJoint) - 1
    carrier = BASE if joint < 0 else chain.joints[joint].link
    if carrier == proxy.link:
        return proxy
    ends = [frame.placement.act(np.array(point)) for point in (proxy.start, proxy.end)]
    start, end = (tuple(float(x) for x in point) for point in ends)
    return replace(proxy, link=carrier, start=start, end=end)  # type: ignore[arg-type]
