"""The manifest of an emitted robot: flags of arguments, and a hash of what is stated."""

import json

import casadi as ca

from symgen.emit.files import emit
from symgen.kernel import Argument, make_kernel
from tests.symgen.compiled_toys import FACTS, VERSIONS


def test_flags_and_a_hash_that_no_order_changes() -> None:
    """Property: arguments state what they are, and nothing else; facts count in any order."""
    x, s = ca.SX.sym("x"), ca.SX.sym("s")
    kernel = make_kernel(
        "doubled",
        {Argument("x", (1,), "1"): x, Argument("s", (1,), "m", shared=True): s},
        {Argument("y", (1,), "m", summed=True): s * x, Argument("z", (1,), "1"): 2 * x},
        "y = s x, z = 2 x",
    )
    first = emit("toy", (kernel,), FACTS, VERSIONS)
    manifest = json.loads(first["manifest.json"])
    entry = manifest["kernels"][0]
    assert entry["inputs"] == [
        {"name": "x", "shape": [1], "unit": "1"},
        {"name": "s", "shape": [1], "unit": "m", "shared": True},
    ]
    assert entry["outputs"] == [
        {"name": "y", "shape": [1], "unit": "m", "summed": True},
        {"name": "z", "shape": [1], "unit": "1"},
    ]
    other = emit("toy", (kernel,), dict(reversed(FACTS.items())), VERSIONS)
    assert json.loads(other["manifest.json"])["model_hash"] == manifest["model_hash"]
