"""C code of the kernels by CasADi: the reference for all other forms.

The functions that `casadi.CodeGenerator` writes are kept verbatim. Its entry points, sparsity
tables and macros are left out: they would export names that other robots export as well.
"""

import re
from dataclasses import dataclass

import casadi as ca

from symgen.errors import BuildError
from symgen.kernel import Kernel


@dataclass(frozen=True, slots=True)
class ReferenceCode:
    """Text by CasADi.

    Attributes:
        helpers: static functions that the bodies call.
        bodies: kernel → its static function, in the order of the file.
        functions: kernel → name of its function.
    """

    helpers: str
    bodies: dict[str, str]
    functions: dict[str, str]


def reference_code(kernels: tuple[Kernel, ...]) -> ReferenceCode:
    """Return CasADi's C code of the kernels."""
    generator = ca.CodeGenerator("reference", {"casadi_int": "long"})
    for kernel in kernels:
        generator.add(kernel.function)
    text = generator.dump()
    _, visibility, rest = text.partition(_BEFORE_HELPERS)
    helpers, configuration, rest = rest.partition(_AFTER_HELPERS)
    bodies, functions = {}, {}
    for match in _HEAD.finditer(rest):
        end = rest.index("\n}\n", match.end()) + len("\n}\n")
        bodies[match["name"]] = rest[match.start("definition") : end]
        functions[match["name"]] = match["function"]
    if not visibility or not configuration or list(bodies) != [k.name for k in kernels]:
        raise BuildError(
            f"the C code of CasADi {ca.CasadiMeta.version()} is laid out differently from what "
            "symgen.emit.reference reads; install the version that pyproject.toml names"
        )
    return ReferenceCode(_DEFINITION.sub(r"static \g<0>", helpers).strip(), bodies, functions)


_BEFORE_HELPERS = "    #define CASADI_SYMBOL_EXPORT\n  #endif\n#endif\n"
_AFTER_HELPERS = "/* Configuration this file was compiled with */"
_HEAD = re.compile(
    r"^/\* (?P<name>\w+):\(.*\n(?P<definition>static int (?P<function>casadi_f\d+)\()", re.MULTILINE
)
_DEFINITION = re.compile(r"^casadi_real (?=casadi_\w+\()", re.MULTILINE)
