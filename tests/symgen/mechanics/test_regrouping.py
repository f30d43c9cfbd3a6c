"""π regrouped towards the base, and kernels that are calls of another one."""

import casadi as ca
import numpy as np
import pytest

from symgen.catalogue import make_catalogue
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.emit.forms import forms_of
from symgen.kernel import Kernel
from symgen.make.request import bundled_request
from symgen.mechanics.base_parameters import regrouped
from symgen.mechanics.dynamics import sampled_regressor
from symgen.mechanics.inertia import N_PARAMETERS, PI_NAMES
from tests.oracle import random_states
from tests.robots import DATA

WRIST = """
<joint name="wrist" type="revolute"><origin xyz="0 0 0.3" rpy="0 0 {tilt}"/>
  <parent link="fore"/><child link="hand"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="3" effort="40"/></joint>
<link name="hand"><inertial><origin xyz="0.02 0.03 0.1"/><mass value="1"/>
  <inertia ixx="0.01" ixy="0" ixz="0.0005" iyy="0.01" iyz="0" izz="0.004"/></inertial></link>
"""


def chain_of(name: str) -> Chain:
    if name == "fr3":
        return read_chain(bundled_request("fr3").urdf, ChainOptions())
    return read_chain((DATA / f"{name}.urdf").read_text(), ChainOptions())


def tilted(tilt: float) -> Chain:
    """Three joints, all but parallel."""
    text = (DATA / "double.urdf").read_text()
    return read_chain(text.replace("</robot>", WRIST.format(tilt=tilt) + "</robot>"))


def kept(chain: Chain, link: int) -> set[str]:
    """Names of the entries that a link keeps."""
    entries = regrouped(chain, ca.SX.sym("pi", N_PARAMETERS * len(chain.joints)))
    block = entries[N_PARAMETERS * link : N_PARAMETERS * (link + 1)]
    return {name for k, name in enumerate(PI_NAMES) if not block[k].is_zero()}


@pytest.mark.parametrize("name", ["fr3", "tree", "gantry", "double"])
def test_moves_the_robot_alike(name: str) -> None:
    """Oracle: Y π' = Y π for any π, of axes along and across the frames, slides and forks."""
    chain = chain_of(name)
    n = len(chain.joints)
    symbol = ca.SX.sym("pi", N_PARAMETERS * n)
    numbers = ca.Function("regrouped", [symbol], [ca.densify(regrouped(chain, symbol))])
    pi = np.random.default_rng(0).normal(size=N_PARAMETERS * n)
    y = sampled_regressor(chain)(*random_states(n, 50, 1))
    tau = y @ pi
    # 10³ roundings of 1e-16 in terms of the size of τ; 4e-15 is what comes out.
    assert np.abs(y @ np.asarray(numbers(pi)).ravel() - tau).max() < 1e-13 * np.abs(tau).max()


def test_what_stays_with_a_link() -> None:
    """Closed form: Table 3.2 about z for the FR3; a slide keeps m, mc; an odd axis all."""
    fr3, gantry = chain_of("fr3"), chain_of("gantry")
    about_z = {"mX", "mY", "XX", "ZZ", "XY", "XZ", "YZ"}
    assert [kept(fr3, k) for k in range(7)] == [about_z] * 7
    assert [joint.name for joint in gantry.joints] == ["slide", "turn", "plunge", "spin"]
    assert kept(gantry, 1) == set(PI_NAMES)
    assert kept(gantry, 2) == {"m", "mX", "mY", "mZ"}
    assert kept(gantry, 3) == {"mY", "mZ", "XX", "YY", "XY", "XZ", "YZ"}


def kernels_of(chain: Chain) -> dict[str, Kernel]:
    return {kernel.name: kernel for kernel in make_catalogue(chain).kernels}


def test_torque_goes_through_base_parameters_that_lose_nothing() -> None:
    """Property: at a tilt whose base parameters leave 3e-13, π itself serves."""
    base = ("base_parameters", "base_inverse_dynamics")
    assert kernels_of(chain_of("fr3"))["inverse_dynamics"].through == base
    assert kernels_of(tilted(0.0))["inverse_dynamics"].through == base
    assert kernels_of(tilted(1e-6))["inverse_dynamics"].through == ()
    assert kernels_of(tilted(0.1))["inverse_dynamics"].through == base


def test_a_kernel_whose_parts_are_missing_is_written_out() -> None:
    """Property: calls where all parts are there, else the kernel's own statements."""
    kernels = kernels_of(tilted(0.0))
    torque = kernels["torque"]
    parts = (*(kernels[name] for name in torque.through), torque)
    together, alone = forms_of("r", parts), forms_of("r", parts[1:])
    assert together.bodies["torque"][-1] == "r_base_inverse_dynamics(q, dq, ddq, beta, tau);"
    assert any("exp(" in line for line in alone.bodies["torque"])
    assert together.tiles["torque"].operations == alone.tiles["torque"].operations
