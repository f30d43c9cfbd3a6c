"""Kernels → C, header, manifest, README: text only, no robots and no compilers.

`c_body` walks CasADi's instruction list and writes static single assignment C; the files around
it come from `templates/`, which hold loops and names, never maths. Equal input gives equal bytes.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import jinja2

from symgen.errors import BuildError
from symgen.kernel import Argument, Kernel

_TEMPLATES = Path(__file__).parent / "templates"

_EXPRESSIONS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_ATAN2: "atan2({0}, {1})",
    ca.OP_FABS: "fabs({0})",
    ca.OP_FMIN: "fmin({0}, {1})",
    ca.OP_FMAX: "fmax({0}, {1})",
    ca.OP_LT: "(double)({0} < {1})",
    ca.OP_LE: "(double)({0} <= {1})",
    ca.OP_EQ: "(double)({0} == {1})",
    ca.OP_NE: "(double)({0} != {1})",
    ca.OP_NOT: "(double)({0} == 0.0)",
    ca.OP_AND: "(double)({0} != 0.0 && {1} != 0.0)",
    ca.OP_OR: "(double)({0} != 0.0 || {1} != 0.0)",
    ca.OP_IF_ELSE_ZERO: "{0} != 0.0 ? {1} : 0.0",
}


@dataclass(frozen=True, slots=True)
class EmittedRobot:
    """File name → text of one generated folder, and the hash that ties library and manifest."""

    files: dict[str, str]
    model_hash: str


def c_body(kernel: Kernel) -> list[str]:
    """Statements of one kernel: one constant per instruction, outputs by index.

    Raises:
        BuildError: an instruction has no C text yet.
    """
    f = kernel.function
    names: dict[int, str] = {}
    lines: list[str] = []
    for k in range(f.n_instructions()):
        op, inputs, outputs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if op == ca.OP_INPUT:
            names[outputs[0]] = f"{kernel.inputs[inputs[0]].name}[{inputs[1]}]"
        elif op == ca.OP_CONST:
            names[outputs[0]] = c_constant(f.instruction_constant(k))
        elif op == ca.OP_OUTPUT:
            lines.append(f"{kernel.outputs[outputs[0]].name}[{outputs[1]}] = {names[inputs[0]]};")
        elif op in _EXPRESSIONS:
            text = _EXPRESSIONS[op].format(*(names[i] for i in inputs))
            names[outputs[0]] = f"t{k}"
            lines.append(f"const double t{k} = {text};")
        else:
            raise BuildError(
                f"kernel '{kernel.name}' uses the CasADi instruction {op}, for which the emitter "
                "has no C text; add it to symgen.emit"
            )
    return lines


def c_constant(value: float) -> str:
    """17 significant digits, always a double, negative numbers in parentheses."""
    text = f"{value:.17g}"
    if not any(mark in text for mark in ".eni"):
        text += ".0"
    return f"({text})" if text.startswith("-") else text


def emit(
    name: str, kernels: tuple[Kernel, ...], facts: dict[str, Any], versions: dict[str, str]
) -> EmittedRobot:
    """Render every file of a generated folder.

    Args:
        name: C prefix and folder name.
        kernels: in the order in which they appear in the files.
        facts: the model's own part of the manifest, JSON-ready.
        versions: tool → version, for the banner and the manifest.
    """
    bodies = {kernel.name: c_body(kernel) for kernel in kernels}
    manifest = {
        "format": 1,
        "robot": name,
        "versions": versions,
        **facts,
        "kernels": [_kernel_entry(kernel) for kernel in kernels],
    }
    digest = hashlib.sha256()
    digest.update(json.dumps(manifest, sort_keys=True).encode())
    digest.update(json.dumps(bodies, sort_keys=True).encode())
    manifest["model_hash"] = digest.hexdigest()
    context = {
        "name": name,
        "kernels": kernels,
        "bodies": bodies,
        "manifest": manifest,
        "versions": versions,
    }
    render = _renderer()
    files = {
        "manifest.json": json.dumps(manifest, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        "kernels.c": render("kernels.c.jinja2", context),
        "batch.c": render("batch.c.jinja2", context),
        f"{name}.h": render("header.h.jinja2", context),
        "README.md": render("README.md.jinja2", context),
    }
    return EmittedRobot(files, manifest["model_hash"])


def _kernel_entry(kernel: Kernel) -> dict[str, Any]:
    def arguments(items: tuple[Argument, ...]) -> list[dict[str, Any]]:
        return [
            {"name": a.name, "shape": list(a.shape), "unit": a.unit}
            | ({"summed": True} if a.summed else {})
            for a in items
        ]

    return {
        "name": kernel.name,
        "per": kernel.per,
        "equation": kernel.equation,
        "inputs": arguments(kernel.inputs),
        "outputs": arguments(kernel.outputs),
        "operations": kernel.operations,
    }


def _renderer() -> Callable[[str, dict[str, Any]], str]:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701  C and Markdown, not HTML
    )
    return lambda template, context: environment.get_template(template).render(context)
