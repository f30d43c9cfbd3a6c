"""The symbolic functions of a robot for CasADi and acados: `<robot>.casadi`, `<robot>_casadi.c`.

The first file holds serialised `casadi.Function`s, one after the other; the second has CasADi's own
ABI, with Jacobians, for `casadi.external` and for solvers that compile an optimal control problem.
π is an input of every function; matrices are not flattened.

As a program it fixes π, writes `<robot>_identified` of both kinds, and adds

    torque = Y π + J ddq + friction(q, dq)
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca

from runtime.common.child import serve
from runtime.common.files import write_text
from symgen.catalogue import make_catalogue
from symgen.chain import read_chain
from symgen.errors import SymgenError
from symgen.kernel import Kernel
from symgen.make.request import BuildRequest, request_from_folder
from symgen.mechanics.loop_range import within_loops

EXPORTED = ("inverse_dynamics", "mass_matrix", "bias_forces", "forward_dynamics", "end_effector")
"""Kernels that become functions; gravity is the bias at rest."""


def write_casadi(request: BuildRequest, folder: Path) -> tuple[Path, Path]:
    """Write both files of a robot into its generated folder."""
    functions = _functions(request)
    paths = folder / f"{request.name}.casadi", folder / f"{request.name}_casadi.c"
    texts = (_serialised(functions), _code(functions, paths[1].name))
    for path, text in zip(paths, texts, strict=True):
        write_text(path, text)
    return paths


def _functions(request: BuildRequest) -> list[Any]:
    chain = within_loops(read_chain(request.urdf, request.options))
    kernels = {k.name: k for k in make_catalogue(chain, request.config.collision).kernels}
    functions = [_function(kernels[name]) for name in EXPORTED]
    functions.insert(3, _gravity(functions[EXPORTED.index("bias_forces")]))
    return functions


COLUMNS: dict[str, Callable[[Any, dict[str, float]], Any]] = {
    "viscous": lambda dq, _: dq,
    "coulomb": lambda dq, width: ca.tanh(dq / width["coulomb_speed"]),
    "offset": lambda dq, _: ca.SX.ones(dq.shape),
    "asymmetric": lambda dq, width: dq * ca.tanh(dq / width["coulomb_speed"]),
    "stribeck": lambda dq, width: (
        ca.tanh(dq / width["coulomb_speed"]) * ca.exp(-((dq / width["stribeck_speed"]) ** 2))
    ),
}
"""Friction columns of q and dq; `export` compares them with those of the run time."""


def identified_texts(job: dict[str, Any]) -> dict[str, str]:
    """Both files with π, inertia of rotors and friction of a result; or the reason for none."""
    folder, known = Path(job["folder"]), {"pi": job["pi"], "rotor": job["armature"]}
    try:
        functions = [
            _fixed(function, known) for function in _functions(request_from_folder(folder))
        ]
    except SymgenError as error:
        return {"error": str(error)}
    q, dq, ddq = (ca.SX.sym(name, len(job["armature"])) for name in ("q", "dq", "ddq"))
    friction = ca.SX.zeros(dq.shape)
    for name, values in job["friction"].items():
        friction += ca.DM(values) * COLUMNS[name](dq, job["widths"])
    torque = functions[0](q, dq, ddq) + ca.DM(job["armature"]) * ddq + friction
    names = ["q", "dq", "ddq"]
    functions += [
        ca.Function("friction", [q, dq], [friction], names[:2], ["tau"]),
        ca.Function("torque", [q, dq, ddq], [torque], names, ["tau"], {"cse": True}),
    ]
    name = f"{folder.name}_identified"
    code = _code(functions, f"{name}.c")
    return {f"{name}.casadi": _serialised(functions), f"{name}.c": job["head"] + code}


def torques_of(job: dict[str, Any]) -> dict[str, Any]:
    """τ (n, N) of the last function of a serialised file at q, dq and ddq (n, N)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "functions")
        path.write_text(job["text"], encoding="ascii")
        file = ca.FileDeserializer(str(path))
        *_, torque = (file.unpack() for _ in range(len(EXPORTED) + 3))
    return {"tau": torque(*map(ca.DM, job["motion"])).full().tolist()}


def _fixed(function: Any, known: dict[str, list[float]]) -> Any:
    """The function with numbers in place of some inputs."""
    symbols = dict(zip(function.name_in(), function.sx_in(), strict=True))
    value = function(*(known.get(name, symbol) for name, symbol in symbols.items()))
    free = {name: symbol for name, symbol in symbols.items() if name not in known}
    return ca.Function(
        function.name(), [*free.values()], [value], [*free], function.name_out(), {"cse": True}
    )


def _function(kernel: Kernel) -> Any:
    """A kernel with matrices in place of their rows one after the other."""
    symbols = kernel.function.sx_in()
    results = [
        ca.reshape(row, a.shape[1], a.shape[0]).T if len(a.shape) == 2 else row
        for a, row in zip(kernel.outputs, kernel.function.call(symbols), strict=True)
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


if __name__ == "__main__":
    serve(lambda job: torques_of(job) if "text" in job else identified_texts(job))
