"""Ranges of the independent joints of closed chains that keep away from singular postures.

Within the box of the ranges every posture closes, the margin of every loop (`loop_equations`)
stays above a share of the best one, and the dependent joints stay within their limits. The box is
searched from the assembly pose on a grid along each joint, and shrunk until random postures in it
and its corners comply. A joint without limits gets none where a whole turn complies and ends at the
same posture: it turns without end.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symgen.chain import Chain, Joint
from symgen.chain.model import Turn
from symgen.errors import UrdfError
from symgen.kernel import Array
from symgen.mechanics.closure import supplied
from symgen.mechanics.kinematics import all_positions
from symgen.mechanics.loop_equations import closed_chain, seed_values

Sampler = Callable[[Array], tuple[Array, NDArray[np.bool_], Array]]

SHARE = 0.2  # least margin of a posture in the range, of the best one along the joints
_AT_MOST = 0.5  # least margin is at most this, so that the assembly pose (1) is always inside
_GRID, _POSTURES, _MOST_CORNERS = 180, 400, 8
_SHRINK = tuple(np.linspace(1.0, 0.05, 20))
_EDGE = 1e-9  # rad or m beyond a limit that are rounding error
_BACK = 1e-6  # turns by which a closed posture may differ after a turn: Newton leaves 1e-12
_NARROW = 0.02  # rad or m: a range below this leaves nothing to move


def within_loops(chain: Chain) -> Chain:
    """The chain with the ranges of its independent joints narrowed."""
    if chain.loops is None:
        return chain
    home = np.array([chain.loops.assembly[k] for k in chain.loops.independent])
    ends = np.array([_ends(chain, k, home[k]) for k in range(len(home))])
    q = ca.SX.sym("q", len(home))
    margins = seed_values(closed_chain(chain), q)[1]
    looped = range(len(home) if margins.numel() else 0)
    moving = [k for k in looped if ca.which_depends(margins, q[k])[0]]
    sample = _sampler(chain)
    grids: dict[int, Array] = {}
    results: dict[int, tuple[Array, NDArray[np.bool_]]] = {}
    turns: dict[int, Turn | None] = {}
    for k in moving:
        line = np.repeat(home[None], 2 * _GRID + 1, axis=0)
        steps = np.linspace(0, 1, _GRID + 1)
        low, high = (home[k] + steps * (end - home[k]) for end in ends[k])
        line[:, k] = np.concatenate([low[:0:-1], high])
        grids[k] = line[:, k]
        margin, inside, positions = sample(line)
        results[k] = margin, inside
        turns[k] = _turn(chain, k, positions)
    best = max((np.nanmax(margin) for margin, _ in results.values()), default=1.0)
    least = min(SHARE * float(best), _AT_MOST)
    for k in moving:
        margin, inside = results[k]
        good = (margin > least) & inside
        if not good[_GRID]:
            raise UrdfError(
                f"a joint of {chain.loops.closures[0].name} is outside its limits in the assembly "
                "pose; correct the limits, or state another pose under [assembly]"
            )
        first = _GRID - int(np.argmin(np.append(good[_GRID::-1], False))) + 1
        last = _GRID + int(np.argmin(np.append(good[_GRID:], False))) - 1
        ends[k] = grids[k][first], grids[k][last]
    ends[moving] = _shrunk(sample, home, ends, moving, least)[moving]
    joints = list(chain.joints)
    for k in moving:
        joint, turn = chain.coordinates[k], turns[k]
        if turn is not None and ends[k, 1] - ends[k, 0] > 2 * np.pi - _EDGE:
            continue
        turns[k] = None
        if ends[k, 1] - ends[k, 0] < _NARROW:
            raise UrdfError(
                f"joint '{joint.name}' can move by {ends[k, 1] - ends[k, 0]:.2g} rad or m only "
                f"before {chain.loops.closures[0].name} is singular or its joints reach their "
                "limits; state another pose under [assembly]"
            )
        lower, upper = (float(f"{end:.6g}") for end in ends[k])
        joints[chain.joints.index(joint)] = replace(joint, lower=lower, upper=upper)
    endless = tuple(turn for turn in turns.values() if turn is not None)
    return replace(chain, joints=tuple(joints), loops=replace(chain.loops, turns=endless))


def _turn(chain: Chain, k: int, positions: Array) -> Turn | None:
    """Joints moved by one turn of a joint without limits; None where it does not come back."""
    joint = chain.coordinates[k]
    if chain.loops is None or chain.coupling is not None or len(chain.joints) != len(positions.T):
        return None
    if joint.kind == "prismatic" or _is_limited(joint):
        return None
    moved = (positions[-1] - positions[0]) / (2 * np.pi)
    counts = np.round(moved)
    fixed = np.array([each.kind == "prismatic" or _is_limited(each) for each in chain.joints])
    if not (np.abs(moved - counts) < _BACK).all() or counts[fixed].any():
        return None
    return Turn(k, tuple(int(counts[place]) for place in chain.loops.dependent))


def _is_limited(joint: Joint) -> bool:
    return joint.lower is not None or joint.upper is not None


def _ends(chain: Chain, k: int, home: float) -> tuple[float, float]:
    """Limits of a joint, or a turn about the assembly pose."""
    joint = chain.coordinates[k]
    lower = home - np.pi if joint.lower is None else min(joint.lower, home)
    upper = home + np.pi if joint.upper is None else max(joint.upper, home)
    return lower, upper


def _sampler(chain: Chain) -> Sampler:
    """Function of postures (N, n): least margin, NaN where refused, limits kept, and positions."""
    q = ca.SX.sym("q", len(chain.coordinates))
    margin = seed_values(closed_chain(chain), q)[1]
    everything = supplied(chain, all_positions(chain, q), q)
    function = ca.Function("margin", [q], [ca.mmin(margin), everything], {"cse": True})
    lower, upper = np.array([joint.ends() for joint in chain.joints]).T

    def sample(postures: Array) -> tuple[Array, NDArray[np.bool_], Array]:
        least, positions = (np.asarray(x) for x in function.map(len(postures))(postures.T))
        inside = (lower - positions.T <= _EDGE) & (positions.T - upper <= _EDGE)
        return least.ravel(), np.asarray(inside.all(axis=1)), positions.T

    return sample


def _shrunk(sample: Sampler, home: Array, ends: Array, moving: list[int], least: float) -> Array:
    """The box about the assembly pose, shrunk until its postures comply."""
    if len(moving) < 2:
        return ends
    rng = np.random.default_rng(0)
    shares = rng.uniform(0, 1, (_POSTURES, len(home)))
    if len(moving) <= _MOST_CORNERS:
        corners = np.full((2 ** len(moving), len(home)), 0.5)
        corners[:, moving] = list(product((0.0, 1.0), repeat=len(moving)))
        shares = np.vstack([corners, shares])
    box = ends
    for shrink in _SHRINK:
        box = home[:, None] + shrink * (ends - home[:, None])
        postures = np.repeat(home[None], len(shares), axis=0)
        span = box[:, 1] - box[:, 0]
        postures[:, moving] = (box[:, 0] + shares * span)[:, moving]
        margin, inside, _ = sample(postures)
        if ((margin > least) & inside).all():
            break
    return box
