"""C code of the rigid-body model of a robot arm: URDF → chain → kernels → generated/<robot>/.

Build time only (casadi, pinocchio, jinja2); the `runtime` package never imports it.
The rooms from the ground up: `errors`, `documents`, `kernel`, `chain`, `mechanics`, `collision`,
`catalogue`, `emit`, `inspect`, `build`, `cli`, `console`; `robots` and `templates` hold data.
"""

__version__ = "0.1.0"
