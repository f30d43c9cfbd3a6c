"""Files of a generated folder: C, header, manifest, README; equal input gives equal bytes.

The files are rendered from `templates/`, which hold loops and names, never mathematics. Names of
links and joints come from a URDF and may hold anything; they are escaped in comments and Markdown.
"""

import hashlib
import html
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

from symgen.emit.cuda import cuda_context
from symgen.emit.forms import forms_of
from symgen.emit.programs import programs
from symgen.emit.sample import LONG, parts_of, reference_code
from symgen.emit.stack import BLOCK, stack_bounds
from symgen.kernel import Argument, Kernel

_TEMPLATES = Path(__file__).parents[1] / "templates"


@dataclass(frozen=True, slots=True)
class EmittedRobot:
    """Text of a generated folder."""

    files: dict[str, str]  # name → text
    # hash of all that library and manifest share, compared when the library is loaded
    model_hash: str


Early = Callable[[str, str], None]
"""Callback with name and text of a file that is ready before the others, to compile it early."""


def ignored(name: str, text: str) -> None:
    """Do nothing: the `Early` callback of callers that wait for all files."""


def emit(
    name: str,
    kernels: tuple[Kernel, ...],
    facts: dict[str, Any],
    versions: dict[str, str],
    early: Early = ignored,
    longest_reference: int | None = None,
) -> EmittedRobot:
    """Render all files of a generated folder."""
    render = renderer()
    referenced = kernels
    if longest_reference is not None:
        # Without `torque` the run time does not list the level of this file.
        referenced = tuple(
            k for k in kernels if k.operations <= longest_reference and k.name != "torque"
        )
    reference = reference_code(referenced)
    context: dict[str, Any] = {"name": name, "kernels": kernels, "versions": versions}
    shown = {"reference": reference, "kernels": referenced}
    reference_c = render("reference.c.jinja2", context | shown)
    early("reference.c", reference_c)
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
    manifest["model_hash"] = digest.hexdigest()
    context |= {
        "bodies": forms.bodies,
        "parts": {
            kernel: parts_of(lines) for kernel, lines in forms.bodies.items() if len(lines) > LONG
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
        "manifest.json": json.dumps(manifest, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
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
        cuda = cuda_context(name, kernels, forms)
        files[f"{name}.cuh"] = render("cuda.cuh.jinja2", context | cuda)
    for extra in extras:
        for included in extra.includes:
            files[included] = (_TEMPLATES / included).read_text(encoding="utf-8")
        files[extra.file] = render(f"{extra.file}.jinja2", context | extra.context)
    return EmittedRobot(files, manifest["model_hash"])


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
    """Name within a comment of C.

    `*/` ends a comment; so do its spellings by a trigraph (`??/` is a backslash) and a line splice.
    """
    return re.sub(r"[*?\\]|[^\S ]|[^\w\s!-~]", "_", name)


def in_markdown(name: str) -> str:
    """Name within a paragraph or a cell of a table in Markdown."""
    flat = "".join(c if c.isprintable() else "_" for c in name)
    return re.sub(r"([\\`*\[\]|])", r"\\\1", html.escape(flat, quote=False))


def in_code(name: str) -> str:
    """Name within a code span of Markdown, where nothing can be escaped."""
    return re.sub(r"[`<>]|[^\S ]", "_", name)
