"""The symbolic functions of a robot for CasADi and acados: `<robot>.casadi`, `<robot>_casadi.c`.

The first file holds serialised `casadi.Function`s, one after the other; the second has CasADi's own
ABI, with Jacobians, for `casadi.external` and for solvers that compile an optimal control problem.
π is an input of every function; matrices are not flattened.
"""

import tempfile
from pathlib import Path
from typing import Any

import casadi as ca

from runtime.common.files import replacing
from symgen.catalogue import make_catalogue
from symgen.chain import read_chain
from symgen.kernel import Kernel
from symgen.make.request import BuildRequest
from symgen.mechanics.loop_range import within_loops

EXPORTED = ("inverse_dynamics", "mass_matrix", "bias_forces", "forward_dynamics", "end_effector")
"""Kernels that become functions; gravity is the bias at rest."""


def write_casadi(request: BuildRequest, folder: Path) -> tuple[Path, Path]:
    """Write both files of a robot into its generated folder."""
    chain = within_loops(read_chain(request.urdf, request.options))
    kernels = {k.name: k for k in make_catalogue(chain, request.config.collision).kernels}
    functions = [_function(kernels[name]) for name in EXPORTED]
    functions.insert(3, _gravity(functions[EXPORTED.index("bias_forces")]))
    paths = folder / f"{request.name}.casadi", folder / f"{request.name}_casadi.c"
    texts = (_serialised(functions), _code(functions, paths[1].name))
    for path, text in zip(paths, texts, strict=True):
        with replacing(path) as file:
            file.write(text.encode())
    return paths


def _function(kernel: Kernel) -> Any:
    """A kernel with matrices in place of their rows one after the other."""
    symbols = kernel.function.sx_in()
    rows = kernel.function.call(symbols)
    results = [
        ca.reshape(row, a.shape[1], a.shape[0]).T if len(a.shape) == 2 else row
        for a, row in zip(kernel.outputs, rows, strict=True)
    ]
    entries, names = ([a.name for a in side] for side in (kernel.inputs, kernel.outputs))
    return ca.Function(kernel.name, symbols, results, entries, names, {"cse": True})


def _gravity(bias: Any) -> Any:
    """g(q, π): the bias forces at rest."""
    q, dq, pi = bias.sx_in()
    held = ca.substitute(bias(q, dq, pi), dq, ca.DM.zeros(dq.numel()))
    return ca.Function("gravity", [q, pi], [ca.densify(held)], ["q", "pi"], ["g"], {"cse": True})


def _serialised(functions: list[Any]) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "functions")
        file = ca.FileSerializer(str(path))
        for function in functions:
            file.pack(function)
        del file  # written as a whole when it is closed
        return path.read_text(encoding="ascii")


def _code(functions: list[Any], name: str) -> str:
    generator = ca.CodeGenerator(name, {"with_header": False})
    for function in functions:
        generator.add(function)
        generator.add(function.jacobian())
    return str(generator.dump())
