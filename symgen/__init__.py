"""symgen writes the physics of a robot arm as C: URDF → chain → kernels → generated/<robot>/.

Build time only (casadi, pinocchio, jinja2); the `runtime` package never imports it.
The rooms, in the order in which data flow: `chain`, `inertia`, `dynamics`, `base_parameters`,
`excitation`, `catalogue`, `emit`, `compiler`, `build`.
"""

__version__ = "0.1.0"
