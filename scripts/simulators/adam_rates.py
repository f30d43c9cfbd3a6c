"""Dynamics of adam by JAX or torch; runs where adam-robotics[jax,pytorch] is installed.

argv: jax or torch, URDF, file of states (q, dq, tau; M, h, ddq to compare with). A line of standard
input names a function; the answer is a line with the seconds of one call over all states.
"""

import sys
import time

import numpy as np

backend, urdf, states = sys.argv[1:]
given = np.load(states)
names, n = list(given["joints"]), given["q"].shape[1]
root = np.eye(4)
gravity = np.concatenate([given["gravity"], np.zeros(3)])
if backend == "jax":
    import jax

    jax.config.update("jax_enable_x64", True)
    from adam.jax import KinDynComputations

    robot = KinDynComputations(urdf, names, gravity=jax.numpy.asarray(gravity))

    array, solve = jax.numpy.asarray, jax.numpy.linalg.solve
    over_samples, finish = lambda f: jax.jit(jax.vmap(f)), jax.block_until_ready
else:
    import torch
    from adam.pytorch import KinDynComputations

    torch.set_num_threads(1)
    robot = KinDynComputations(
        urdf, names, torch.device("cpu"), torch.float64, gravity=torch.as_tensor(gravity)
    )

    array, solve = torch.as_tensor, torch.linalg.solve
    over_samples, finish = torch.vmap, np.asarray

pose, rest = array(root), array(np.zeros(6))
q, dq, tau = (array(given[name]) for name in ("q", "dq", "tau"))
functions = {
    "mass_matrix": (lambda q: robot.mass_matrix(pose, q)[6:, 6:], (q,), "M"),
    "bias": (lambda q, dq: robot.bias_force(pose, q, rest, dq)[6:], (q, dq), "h"),
}
# A fixed base has no ABA there: M⁻¹ (τ − h), as a user of its floating base writes it.
functions["forward_dynamics"] = (
    lambda q, dq, tau: solve(
        robot.mass_matrix(pose, q)[6:, 6:], tau - robot.bias_force(pose, q, rest, dq)[6:]
    ),
    (q, dq, tau),
    "ddq",
)
# τ = M ddq + h: there is no inverse dynamics of joints.
functions["inverse_dynamics"] = (
    lambda q, dq, ddq: (
        robot.mass_matrix(pose, q)[6:, 6:] @ ddq + robot.bias_force(pose, q, rest, dq)[6:]
    ),
    (q, dq, array(given["ddq"])),
    "tau",
)
ready = {}
for line in sys.stdin:
    name = line.strip()
    function, inputs, right = functions[name]
    if name not in ready:
        ready[name] = over_samples(function)
        error = np.abs(np.asarray(finish(ready[name](*inputs))) - given[right]).max()
        if not error <= 1e-8 * np.abs(given[right]).max():
            sys.exit(f"{name} differs by {error:.1e}")
    start = time.perf_counter()
    finish(ready[name](*inputs))
    print(time.perf_counter() - start, flush=True)
