"""Functions for CasADi, written by a process of symgen; their C code, run by a C compiler."""

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np

from runtime.common.child import ExceededError, Limits, answer_of
from runtime.errors import ExportError
from runtime.library import Array
from runtime.outputs.model_files.bodies import digits
from runtime.outputs.model_files.engines import compiler

WRITER = "symgen.make.casadi_files"
LIMITS = Limits(seconds=600, patience=900.0, memory=8 * 2**30, file=2**28)
"""Of the process; a robot of 30 joints takes a minute."""


def written(job: Mapping[str, Any]) -> dict[str, str]:
    """Files of a model by name."""
    if find_spec("casadi") is None or find_spec("symgen") is None:
        raise ExportError(
            "not written: expected CasADi, found none; run: pip install 'symgen[build]'"
        )
    try:
        texts = answer_of(WRITER, job, LIMITS)
    except ExceededError as error:
        raise ExportError(f"not written: the functions take more than {error}") from None
    if "error" in texts:
        raise ExportError(f"not written: {texts['error']}")
    return texts


def torques(code: str, *motion: Array) -> Array | None:
    """τ (N, n) of the function `torque` of a C file at q, dq and ddq (N, n)."""
    q, _, _ = motion
    rows = ",\n".join(", ".join(map(digits, row)) for row in np.hstack(motion))
    program = _PROGRAM.format(count=len(q), n=q.shape[1], rows=rows)
    printed = compiler.numbers_of({"functions.c": code, "main.c": program})
    return None if printed is None else np.reshape(printed, q.shape)


_PROGRAM = """#include <stdio.h>
#include <stdlib.h>
#include "functions.c"
static const double states[{count}][3 * {n}] = {{
{rows}
}};
int main(void)
{{
    casadi_int sizes[4];
    double tau[{n}];
    torque_work(sizes, sizes + 1, sizes + 2, sizes + 3);
    const double **arg = malloc((sizes[0] + 1) * sizeof *arg);
    double **res = malloc((sizes[1] + 1) * sizeof *res);
    casadi_int *iw = malloc((sizes[2] + 1) * sizeof *iw);
    double *w = malloc((sizes[3] + 1) * sizeof *w);
    for (int k = 0; k < {count}; ++k) {{
        for (int i = 0; i < 3; ++i) arg[i] = states[k] + {n} * i;
        res[0] = tau;
        torque(arg, res, iw, w, 0);
        for (int i = 0; i < {n}; ++i) printf("%a\\n", tau[i]);
    }}
    return 0;
}}
"""
