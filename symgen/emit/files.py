"""Files of a generated folder: C, header, manifest, README; equal input gives equal bytes.

The files are rendered from `templates/`, which hold loops and names, never mathematics. Names of
links and joints come from a URDF and may hold anything; they are escaped in comments and Markdown.

The stack of the emitted functions is bounded for any compiler. A straight-line function keeps at
most each value, argument and buffer on the stack once: a compiler may share places, but never needs
more. Bounds are for the deepest chain of calls within a file; functions of the C library come on
top.

The CUDA header has one thread per sample, arrays of entries, both precisions.

A body is a template over the type T of its numbers and over what it reads from, since inputs that
all samples share are read where they lie and the others from registers.

Loss and gradient of many parameter vectors β on the same samples, r = √W (Y_b β − τ):

    L(β) = r'r / 2      ∂L/∂β = (√W Y_b)' r

One thread per sample writes the nonzeros of √W Y_b and √W τ once. Then one thread per β keeps β and
gradient in registers, and its block reads the rows through shared memory: two multiply-adds per
nonzero, and no traffic but the β and their gradients.
"""

import hashlib
import html
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

from runtime.common.files import json_text
from symgen.emit import sample
from symgen.emit.forms import (
    Forms,
    composed_body,
    composed_numbers,
    compositions,
    forms_of,
    is_composed,
)
from symgen.emit.programs import programs
from symgen.emit.ssa import TileProgram
from symgen.errors import BuildError
from symgen.kernel import Argument, Kernel, Kernels, KernelsByName

NUMBER = 8  # bytes of a double
ROW = 64  # bytes of one row of a tile
BLOCK = 4  # tiles whose sines are computed together
FRAMES = 4096
"""Bytes of saved registers, alignment and loop counters of all functions in a chain of calls.

Includes the W × W numbers that lanes.h transposes in registers, all spilled.
"""
INLINED = {"sincos": 40, "exp": 24, "all": 0}  # values of a function that may be inlined; others: 2


@dataclass(frozen=True, slots=True)
class StackBounds:
    """Bytes per kernel."""

    one: dict[str, int]  # the function of kernels.c
    reference: dict[str, int]  # the loop of reference.c and the functions it calls
    tiles: dict[int, dict[str, int]]  # lanes W → the deeper of `_batch` and `_tiles`, with callees


def stack_bounds(kernels: Kernels, forms: Forms, reference: sample.ReferenceCode) -> StackBounds:
    """Bounds for every kernel and every vector width."""
    by_name = {k.name: k for k in kernels}
    composed = {k.name: NUMBER * composed_numbers(k, by_name) for k in compositions(by_name)}
    one = {k: FRAMES + NUMBER * _values(lines) for k, lines in forms.bodies.items()}
    for name, images in composed.items():
        one[name] += images + max(one[called] for called in by_name[name].through)
    for name, p in forms.products.items():
        factors = p.joints * p.links * p.size + p.size + p.size**2
        one[name] = FRAMES + NUMBER * factors + max(one[p.regressor], one[p.block])
    tiles: dict[int, dict[str, int]] = {}
    for w in (1, 2, 4, 8):
        tiles[w] = {k.name: _tiles(k, forms.tiles[k.name], w) for k in kernels if not k.rare}
        for name, p in forms.products.items():
            if by_name[name].rare:
                continue
            tiles[w][name] += ROW * p.joints * p.links * p.size + tiles[w][p.regressor]
        for name, images in composed.items():
            *maps, last = by_name[name].through
            tiles[w][name] += images + max([tiles[w][last], *(one[called] for called in maps)])
    return StackBounds(
        {k.name: one[k.name] + NUMBER * _arguments(k) for k in kernels},
        {
            k.name: _reference(k, reference.bodies[k.name])
            for k in kernels
            if k.name in reference.bodies
        },
        tiles,
    )


def _values(lines: list[str]) -> int:
    """Named values, and one per operation or call within an expression."""
    text = "\n".join(lines)
    operators = sum(text.count(f" {sign}") for sign in "-+*/<=!&|?")
    operators -= text.count("= -") + text.count("; ++")  # signs and loop counters
    return len(lines) + operators + text.count("(-") + len(_CALLED.findall(text))


def _arguments(kernel: Kernel) -> int:
    return len(kernel.inputs) + len(kernel.outputs)


def _reference(kernel: Kernel, body: str) -> int:
    summed = sum(a.size for a in kernel.outputs if a.summed)
    values = sum(line.count(",") + 1 for line in _DECLARED.findall(body))
    return FRAMES + NUMBER * (values + summed + 3 * _arguments(kernel))


def _tiles(kernel: Kernel, program: TileProgram, width: int) -> int:
    per_sample = [a for a in kernel.inputs if not a.shared]
    rows = sum(a.size * (2 if a.summed else 1) for a in kernel.outputs)
    for argument in per_sample:
        rows += argument.size * (3 * BLOCK if argument.name == program.turned else 1)
    values = sum(line.startswith("const vd") for line in program.body)
    called = _CALL.findall("\n".join(program.body))
    body = NUMBER * width * (values + sum(INLINED.get(name, 2) for name in called))
    prepare = NUMBER * len(program.prepare)
    fixed = ROW * rows + NUMBER * (program.uniform + 4 * _arguments(kernel))
    return FRAMES + fixed + max(body, prepare)


_DECLARED = re.compile(r"^  casadi_real (a\d.*);$", re.MULTILINE)
_CALLED = re.compile(r"\w\(")
_CALL = re.compile(r"\bvd_(\w+)\(")

SHIPPED = (  # kernels of the header, called functions before their callers
    *("base_parameters", "base_adjoint", "base_inverse_dynamics", "inverse_dynamics"),
    *("mass_matrix", "bias_forces", "forward_dynamics", "end_effector", "base_regressor"),
    *("loss_gradient", "torque_derivatives"),
)
NUMBERS = sample.Numbers("T", "T({})", turn="symgen_turn")
PRECISIONS = {"double": sample.DOUBLE, "single": sample.Numbers("float", "{}f", "f")}
"""Numbers of a microcontroller."""
SHARED_MEMORY = 24576  # bytes of rows in shared memory of a block, half of what every device has
WHOLE = 16  # rows are padded to as many bytes: four numbers in single precision load as one


def cuda_context(name: str, kernels: Kernels) -> dict[str, Any]:
    """Values for the template of the header."""
    by_name = {kernel.name: kernel for kernel in kernels}
    shipped = [by_name[kernel] for kernel in SHIPPED if kernel in by_name]
    bodies = {
        kernel.name: [line.removeprefix("static ") for line in _body("", kernel, by_name, NUMBERS)]
        for kernel in shipped
    }
    rows = _rows(by_name["base_regressor"], bodies["base_regressor"])
    return {"cuda": shipped, "bodies": bodies, "rows": rows}


def controller_files(
    name: str, kernels: Kernels, chosen: Sequence[str], precision: str, versions: dict[str, str]
) -> dict[str, str]:
    """NAME.c and NAME.h for a microcontroller: the chosen kernels and those that they call."""
    by_name = {kernel.name: kernel for kernel in kernels if not kernel.factors}
    unknown = [kernel for kernel in chosen if kernel not in by_name]
    if unknown or precision not in PRECISIONS:
        raise BuildError(
            f"expected the setting precision single or double and the setting kernels of "
            f"{', '.join(by_name)}; got '{precision}' and '{', '.join(unknown or chosen)}'"
        )
    needed: dict[str, Kernel] = {}

    def add(kernel: Kernel) -> None:
        for called in kernel.through if is_composed(kernel, by_name) else ():
            add(by_name[called])
        needed.setdefault(kernel.name, kernel)

    for each in chosen:
        add(by_name[each])
    numbers = PRECISIONS[precision]
    bodies = {k: _body(f"{name}_", kernel, by_name, numbers) for k, kernel in needed.items()}
    context: dict[str, Any] = {"name": in_comment(name), "type": numbers.type}
    context |= {"versions": versions, "chosen": [*chosen]}
    context |= {"kernels": [*needed.values()], "bodies": bodies}
    return {f"{name}.{end}": renderer()(f"controller.{end}.jinja2", context) for end in ("c", "h")}


def _body(
    prefix: str, kernel: Kernel, kernels: KernelsByName, numbers: sample.Numbers
) -> list[str]:
    """Statements for one sample; compositions call functions with the prefix."""
    if not is_composed(kernel, kernels):
        return sample.c_body(kernel, numbers)
    lines = composed_body(prefix, kernel, kernels)
    return [line.replace("double ", f"{numbers.type} ") for line in lines]


def _rows(regressor: Kernel, body: list[str]) -> dict[str, Any]:
    """Nonzeros of the base regressor, joint by joint, and the statements that fill them."""
    (output,) = regressor.outputs
    joints, columns = output.shape
    stores = {int(m[1]): m[2] for line in body if (m := _STORE.fullmatch(line))}
    zero = NUMBERS.constant(0.0)
    filled = sorted(k for k, value in stores.items() if value != zero)
    place = {entry: k for k, entry in enumerate(filled)}
    lines = []
    for line in body:
        store = _STORE.fullmatch(line)
        if store is None:
            lines.append(line)
        elif (entry := int(store[1])) in place:
            lines.append(f"row[{place[entry]}] = root[{entry // columns}] * ({store[2]});")
    of_joint = [[e for e in filled if e // columns == joint] for joint in range(joints)]
    length = len(filled) + joints
    padded = -(-length // (WHOLE // 4)) * (WHOLE // 4)
    return {
        "lines": lines,
        "joints": [[(place[e], e % columns) for e in entries] for entries in of_joint],
        "filled": len(filled),
        "columns": columns,
        "padded": padded,
        "tile": max(SHARED_MEMORY // (8 * padded), 0),
    }


_STORE = re.compile(r"Y_b\[(\d+)\] = (.*);")

_TEMPLATES = Path(__file__).parents[1] / "templates"


def emit(
    name: str,
    kernels: Kernels,
    facts: dict[str, Any],
    versions: dict[str, str],
    longest_reference: int | None = None,
) -> dict[str, str]:
    """Text of all files of a generated folder, by name."""
    render = renderer()
    referenced = kernels
    if longest_reference is not None:
        # Without `torque` the run time does not list the level of this file.
        referenced = tuple(
            k for k in kernels if k.operations <= longest_reference and k.name != "torque"
        )
    reference = sample.reference_code(referenced)
    context: dict[str, Any] = {"name": name, "kernels": kernels, "versions": versions}
    shown = {"reference": reference, "kernels": referenced}
    reference_c = render("reference.c.jinja2", context | shown)
    forms = forms_of(name, kernels)
    manifest = {
        "format": 4,
        "robot": name,
        "versions": versions,
        **facts,
        "kernels": [_kernel_entry(kernel) for kernel in kernels],
    }
    digest = hashlib.sha256()
    digest.update(json.dumps(manifest, sort_keys=True).encode())
    digest.update(json.dumps(forms.bodies, sort_keys=True).encode())
    digest.update(repr((forms.tiles, forms.products)).encode())
    for template in sorted(_TEMPLATES.iterdir()):  # programs and structs are shared by both sides
        if not template.name.startswith("controller."):  # in no library
            digest.update(template.read_bytes())
    manifest["model_hash"] = digest.hexdigest()  # compared when the library is loaded
    context |= {
        "bodies": forms.bodies,
        "parts": {
            kernel: sample.parts_of(lines)
            for kernel, lines in forms.bodies.items()
            if len(lines) > sample.LONG
        },
        "tiles": forms.tiles,
        "products": forms.products,
        "stack": stack_bounds(kernels, forms, reference),
        "block": BLOCK,
        "manifest": manifest,
    }
    extras = programs(kernels, forms.tiles, facts)
    context["programs"] = {extra.file: extra.context for extra in extras}
    files = {
        "manifest.json": json_text(manifest),
        "kernels.c": render("kernels.c.jinja2", context),
        "lanes.h": (_TEMPLATES / "lanes.h").read_text(encoding="utf-8"),
        "sines.h": (_TEMPLATES / "sines.h").read_text(encoding="utf-8"),
        "tiles.h": render("tiles.h.jinja2", context),
        "tiles.c": render("tiles.c.jinja2", context),
        "reference.c": reference_c,
        f"{name}.h": render("header.h.jinja2", context),
        "README.md": render("README.md.jinja2", context),
    }
    if any(kernel.name == "base_regressor" for kernel in kernels):
        cuda = cuda_context(name, kernels)
        files[f"{name}.cuh"] = render("cuda.cuh.jinja2", context | cuda)
    for extra in extras:
        for included in extra.includes:
            files[included] = (_TEMPLATES / included).read_text(encoding="utf-8")
        files[extra.file] = render(f"{extra.file}.jinja2", context | extra.context)
    return files


def _kernel_entry(kernel: Kernel) -> dict[str, Any]:
    def arguments(items: tuple[Argument, ...]) -> list[dict[str, Any]]:
        return [
            {"name": a.name, "shape": list(a.shape), "unit": a.unit}
            | ({"summed": True} if a.summed else {})
            | ({"shared": True} if a.shared else {})
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


@cache
def renderer() -> Callable[[str, dict[str, Any]], str]:
    """Templates and their filters; parsed templates are kept, half of the time of a small robot."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701  C and Markdown, not HTML
    )
    escapes = {"in_comment": in_comment, "in_markdown": in_markdown, "in_code": in_code}
    environment.filters.update(escapes)
    environment.tests["idle_in"] = lambda name, lines: (
        re.search(rf"\b{name}\b", "\n".join(lines)) is None
    )
    environment.tests["containing"] = lambda line, text: text in line
    return lambda template, context: environment.get_template(template).render(context)


def in_comment(name: str) -> str:
    """Name in a comment of C, which `*/`, its trigraph (`??/`) or a line splice would end."""
    return re.sub(r"[*?\\]|[^\S ]|[^\w\s!-~]", "_", name)


def in_markdown(name: str) -> str:
    """Name within a paragraph or a cell of a table in Markdown."""
    flat = "".join(c if c.isprintable() else "_" for c in name)
    return re.sub(r"([\\`*\[\]|])", r"\\\1", html.escape(flat, quote=False))


def in_code(name: str) -> str:
    """Name within a code span of Markdown, where nothing can be escaped."""
    return re.sub(r"[`<>]|[^\S ]", "_", name)
