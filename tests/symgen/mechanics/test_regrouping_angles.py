"""Table 3.2 on an arm whose axes enclose any angle: every sine and cosine of it counts."""

import numpy as np
import pytest

from symgen.chain import ChainOptions, read_chain
from symgen.mechanics.base_parameters import numeric_base
from symgen.mechanics.dynamics import sampled_regressor
from tests.regrouping_rules import regrouped_base

JOINT = """
<joint name="j{k}" type="revolute"><origin xyz="{x!r} {y!r} {z!r}" rpy="{alpha!r} 0 0"/>
  <parent link="l{before}"/><child link="l{k}"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" velocity="3" effort="40"/></joint>
<link name="l{k}"><inertial><origin xyz="0.02 0.03 0.1"/><mass value="1"/>
  <inertia ixx="0.01" ixy="0" ixz="0.0005" iyy="0.01" iyz="0" izz="0.004"/></inertial></link>
"""


def arm(rows: list[tuple[float, float, float]]) -> str:
    """Serial arm Rot_x(α) Trans_x(a) Trans_z(d), joint by joint."""
    parts = [
        JOINT.format(
            k=k, before=k - 1, alpha=alpha, x=a, y=-d * float(np.sin(alpha)),
            z=d * float(np.cos(alpha)),
        )
        for k, (alpha, a, d) in enumerate(rows, start=1)
    ]  # fmt: skip
    return '<robot name="arm"><link name="l0"/>' + "".join(parts) + "</robot>"


@pytest.mark.parametrize("seed", range(4))
def test_numeric_equals_symbolic_at_any_angle(seed: int) -> None:
    """Oracle: the rank decision and K of the sampled regressor, α, a and d drawn at random."""
    rng = np.random.default_rng(seed)
    rows = [(0.0, 0.0, 0.3), *rng.uniform([0.3, -0.4, -0.4], [1.3, 0.4, 0.4], (4, 3)).tolist()]
    chain = read_chain(arm(rows), ChainOptions())
    numeric = numeric_base(chain, sampled_regressor(chain))
    columns, matrix = regrouped_base(chain)
    assert numeric.columns == columns
    # Least squares over normalised columns of condition some 10²: rounding × condition × |K|.
    np.testing.assert_allclose(numeric.matrix, matrix, rtol=0, atol=1e-12)
