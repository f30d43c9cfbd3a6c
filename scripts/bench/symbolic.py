"""Expressions of a kernel and their operation counts, from the generator."""

from dataclasses import dataclass
from typing import Any

from runtime.library import Library


@dataclass(frozen=True, slots=True)
class Symbolic:
    """Expressions of one kernel."""

    function: Any  # of CasADi
    inputs: tuple[str, ...]  # their names
    operations: int  # per sample, without what depends on shared inputs alone
    sines: int  # how many of them are sines and cosines


def symbolic(lib: Library, names: tuple[str, ...]) -> dict[str, Symbolic]:
    """Generate a library's kernels once more, from the URDF and options that it was built from."""
    from symgen.catalogue import make_catalogue
    from symgen.chain import read_chain
    from symgen.make.request import request_from_folder

    request = request_from_folder(lib.folder)
    catalogue = make_catalogue(read_chain(request.urdf, request.options))
    return {k.name: facts_of(k) for k in catalogue.kernels if k.name in names}


def facts_of(kernel: Any) -> Symbolic:
    """Counts of a kernel's instruction list; a sine or cosine is one operation."""
    import casadi as ca

    operations = sines = 0
    per_sample: dict[int, bool] = {}
    for op, ins, outs, _ in kernel.instructions:
        if op == ca.OP_INPUT:
            per_sample[outs[0]] = not kernel.inputs[ins[0]].shared
        elif op == ca.OP_CONST:
            per_sample[outs[0]] = False
        elif op != ca.OP_OUTPUT:
            per_sample[outs[0]] = any(per_sample[i] for i in ins)
            operations += per_sample[outs[0]]
            sines += per_sample[outs[0]] and op in {ca.OP_SIN, ca.OP_COS}
    return Symbolic(kernel.function, tuple(a.name for a in kernel.inputs), operations, sines)
