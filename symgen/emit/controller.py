"""Some kernels as one C file and one header for microcontrollers, in single or double precision."""

from collections.abc import Sequence

from symgen.emit.files import in_comment, renderer
from symgen.emit.forms import composed_body, compositions
from symgen.emit.sample import DOUBLE, Numbers, c_body
from symgen.errors import BuildError
from symgen.kernel import Kernel

PRECISIONS = {"double": DOUBLE, "single": Numbers("float", "{}f", "f")}


def controller_files(
    name: str,
    kernels: Sequence[Kernel],
    chosen: Sequence[str],
    precision: str,
    versions: dict[str, str],
) -> dict[str, str]:
    """Text of NAME.c and NAME.h with the chosen kernels and those that they call."""
    by_name = {kernel.name: kernel for kernel in kernels if not kernel.factors}
    unknown = [kernel for kernel in chosen if kernel not in by_name]
    if unknown or precision not in PRECISIONS:
        raise BuildError(
            f"expected the setting precision single or double and the setting kernels of "
            f"{', '.join(by_name)}; got "
            f"'{precision}' and '{', '.join(unknown) or ', '.join(chosen)}'"
        )
    composed = {kernel.name for kernel in compositions(by_name)}
    needed: list[str] = []

    def add(kernel: str) -> None:
        for called in by_name[kernel].through if kernel in composed else ():
            add(called)
        if kernel not in needed:
            needed.append(kernel)

    for kernel in chosen:
        add(kernel)
    numbers = PRECISIONS[precision]
    bodies = {}
    for kernel in needed:
        if kernel in composed:
            lines = composed_body(name, by_name[kernel], by_name)
            bodies[kernel] = [line.replace("double ", f"{numbers.type} ") for line in lines]
        else:
            bodies[kernel] = c_body(by_name[kernel], numbers)
    context = {
        "name": in_comment(name),
        "type": numbers.type,
        "kernels": [by_name[kernel] for kernel in needed],
        "chosen": [*chosen],
        "bodies": bodies,
        "versions": versions,
    }
    return {f"{name}.{end}": renderer()(f"controller.{end}.jinja2", context) for end in ("c", "h")}
