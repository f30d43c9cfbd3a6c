"""Kernels as operators of torch: one custom operator, its derivative, and its rule for vmap.

`symgen::kernel(values, robot, kernel)` calls a kernel of a library that this process has loaded,
by its address, on the memory of the tensors: contiguous tensors of doubles are not copied. Shapes
are in the manifest, so that torch.compile traces the operator without running it. Where no tensor
needs a derivative and nothing is traced, the C function is called without the operator, whose
dispatch takes a tenth of the time of 4096 torques of an arm.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from torch.autograd.forward_ad import unpack_dual

from runtime.errors import LibraryError, ShapeError
from runtime.library import Library
from runtime.tapes.derivatives import DIFFERENTIABLE, KernelCall
from runtime.tapes.functions import TapeFunctions

SECOND = (
    "expected first derivatives, got a second one: '{}' is a derivative already; detach it, or "
    "take differences of the first derivatives"
)
LIBRARIES: dict[str, "Functions"] = {}  # by hash: torch takes tensors and text only


class Functions(TapeFunctions):
    """Differentiable functions of a robot on tensors; see `TapeFunctions`."""

    xp, cast = torch, "to"

    def __init__(self, lib: Library) -> None:
        super().__init__(lib)
        self.key = f"{lib.manifest.model_hash[:16]}_{lib.level}"
        LIBRARIES.setdefault(self.key, self)
        for dtype in (torch.float64, torch.float32):  # torch.compile makes no arrays of NumPy
            for name in ("pi0", "base_matrix", "zeros", "ones"):
                self._constant(name, torch.empty(0, dtype=dtype, device="cpu"))

    def _here(self, name: str, value: Any) -> torch.Tensor:
        if not isinstance(value, torch.Tensor):
            return torch.from_numpy(np.asarray(value, dtype=float, order="C"))
        if not value.is_cpu:
            raise ShapeError(
                f"{name} is on the device '{value.device}', the kernels of '{self.lib.name}' run "
                "on the CPU; give tensor.cpu()"
            )
        return value

    def _call(self, kernel: str, *values: torch.Tensor) -> torch.Tensor:
        return outputs_of(self.key, kernel, values)[0]


def outputs_of(robot: str, kernel: str, values: Sequence[torch.Tensor]) -> Sequence[torch.Tensor]:
    """All outputs of a kernel, on the tape that the inputs need."""
    if torch.compiler.is_compiling() or torch.jit.is_tracing():
        return run_kernel(list(values), robot, kernel)
    if _needs_derivative(values):
        outputs: tuple[torch.Tensor, ...] = Recorded.apply(robot, kernel, *values)
        return outputs
    return _run(values, robot, kernel)


def _needs_derivative(values: Sequence[torch.Tensor]) -> bool:
    """Whether a tensor is recorded, has a tangent, or no memory, as those of torch.func."""
    recording = torch.is_grad_enabled()
    try:
        for value in values:
            value.data_ptr()
            if (recording and value.requires_grad) or unpack_dual(value).tangent is not None:
                return True
    except RuntimeError:
        return True
    return False


def _run(values: Sequence[torch.Tensor], robot: str, kernel: str) -> list[torch.Tensor]:
    """All outputs of a kernel, (..., *shape), from inputs (..., size), in doubles."""
    lead, steps, spreads, shapes = _plan(robot, kernel, tuple([value.shape for value in values]))
    arrays = []  # temporaries among them would be freed before the call
    for value, spread in zip(values, spreads, strict=True):
        array = value.expand(*lead, value.shape[-1]) if spread else value
        if array.dtype != torch.float64 or not array.is_contiguous():
            array = array.to(torch.float64).contiguous()
        arrays.append(array)
    results = [values[0].new_empty(shape, dtype=torch.float64) for shape in shapes]
    places, targets = ([array.data_ptr() for array in side] for side in (arrays, results))
    LIBRARIES[robot].lib.binding.run(kernel, lead.numel(), places, steps, targets)
    dtype = values[0].dtype
    return results if dtype == torch.float64 else [x.to(dtype) for x in results]


@lru_cache
def _plan(
    robot: str, kernel: str, inputs: tuple[torch.Size, ...]
) -> tuple[torch.Size, list[int], list[bool], list[tuple[int, ...]]]:
    """Leading axes, steps between samples, which inputs are repeated, and shapes of the outputs."""
    lead, shapes = _shapes(inputs, robot, kernel)
    single = [shape.numel() == shape[-1] for shape in inputs]
    spreads = [not one and shape[:-1] != lead for one, shape in zip(single, inputs, strict=True)]
    steps = [0 if one else shape[-1] for one, shape in zip(single, inputs, strict=True)]
    return lead, steps, spreads, shapes


def _fake(values: list[torch.Tensor], robot: str, kernel: str) -> list[torch.Tensor]:
    _, shapes = _shapes([value.shape for value in values], robot, kernel)
    return [values[0].new_empty(shape) for shape in shapes]


def _shapes(
    inputs: Sequence[torch.Size], robot: str, kernel: str
) -> tuple[torch.Size, list[tuple[int, ...]]]:
    """Leading axes of the inputs, and the shapes of the outputs."""
    lead = torch.broadcast_shapes((), *(shape[:-1] for shape in inputs))
    outputs = LIBRARIES[robot].lib.binding.kernel(kernel).outputs
    return lead, [a.shape if a.summed else (*lead, *a.shape) for a in outputs]


def _rule(ctx: Any) -> KernelCall:
    """The call that a context has kept; its further outputs are derivatives."""
    if ctx.kernel not in DIFFERENTIABLE:
        raise LibraryError(SECOND.format(ctx.kernel))
    first, *others = ctx.saved_tensors[ctx.count :]

    def call(name: str, *given: torch.Tensor) -> Sequence[torch.Tensor]:
        return outputs_of(ctx.robot, name, given)

    outputs = first, *(Derivative.apply(ctx.kernel, x) for x in others)
    values, lib = ctx.saved_tensors[: ctx.count], LIBRARIES[ctx.robot].lib
    return KernelCall(torch, call, lib, ctx.kernel, values, outputs)


def _slopes(ctx: Any, slope: torch.Tensor, needed: Sequence[bool]) -> list[torch.Tensor | None]:
    """Slope of a cost by the inputs of a kernel from that by its first output."""
    rule = _rule(ctx)
    axes = "ij"[: len(rule.lib.binding.kernel(ctx.kernel).outputs[0].shape)]
    with torch.device("cpu"):  # whatever the default device is
        parts = rule.derivatives(needed)
    answer: list[torch.Tensor | None] = []
    for value, part, use in zip(rule.inputs, parts, needed, strict=True):
        if part is None or not use:
            answer.append(None)
        elif ctx.kernel == "loss_gradient":
            answer.append((slope * part).reshape(value.shape))
        else:
            full = torch.einsum(f"...{axes},...{axes}x->...x", slope, part)
            answer.append(full.sum_to_size(value.shape))
    return answer


def _setup(ctx: Any, inputs: tuple[Any, ...], output: list[torch.Tensor]) -> None:
    values, ctx.robot, ctx.kernel = inputs
    ctx.count = len(values)
    ctx.save_for_backward(*values, *output)


def _backward(ctx: Any, slopes: list[torch.Tensor]) -> tuple[list[torch.Tensor | None], None, None]:
    return _slopes(ctx, slopes[0], ctx.needs_input_grad[0]), None, None


def _vmap(
    info: Any, places: Any, values: list[torch.Tensor], robot: str, kernel: str
) -> tuple[list[torch.Tensor], list[int]]:
    """A mapped axis is one more leading axis; a sum over samples runs once per entry of it."""
    pairs = list(zip(values, places[0], strict=True))
    if any(a.summed for a in LIBRARIES[robot].lib.binding.kernel(kernel).outputs):
        each = [
            run_kernel([x if at is None else x.select(at, k) for x, at in pairs], robot, kernel)
            for k in range(info.batch_size)
        ]
        return [torch.stack(outputs) for outputs in zip(*each, strict=True)], [0] * len(each[0])
    first = [x.unsqueeze(0) if at is None else x.movedim(at, 0) for x, at in pairs]
    most = max(x.ndim for x in first)
    aligned = [x.reshape(len(x), *(1,) * (most - x.ndim), *x.shape[1:]) for x in first]
    outputs = run_kernel(aligned, robot, kernel)
    return outputs, [0] * len(outputs)


torch.library.define("symgen::kernel", "(Tensor[] values, str robot, str kernel) -> Tensor[]")
torch.library.impl("symgen::kernel", "cpu", _run)
torch.library.register_fake("symgen::kernel", _fake)
torch.library.register_vmap("symgen::kernel", _vmap)
torch.library.register_autograd("symgen::kernel", _backward, setup_context=_setup)
run_kernel = torch.ops.symgen.kernel.default


class Recorded(torch.autograd.Function):
    """The same operator for torch.func: its transforms take no operator with a list of tensors."""

    generate_vmap_rule = True

    @staticmethod
    def forward(robot: str, kernel: str, *values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Outputs of a kernel."""
        return tuple(run_kernel(list(values), robot, kernel))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[torch.Tensor, ...]) -> None:
        """Keep what the derivatives need."""
        _setup(ctx, (list(inputs[2:]), *inputs[:2]), list(output))
        ctx.save_for_forward(*inputs[2:], *output)

    @staticmethod
    def backward(ctx: Any, slope: torch.Tensor, *_: torch.Tensor) -> tuple[Any, ...]:
        """Slopes by the inputs."""
        return None, None, *_slopes(ctx, slope, ctx.needs_input_grad[2:])

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> tuple[torch.Tensor | None, ...]:
        """Tangent of the first output, the only one that leaves this module."""
        rule = _rule(ctx)
        with torch.device("cpu"):
            return rule.tangent(tangents[2:]), *map(torch.zeros_like, rule.outputs[1:])


class Derivative(torch.autograd.Function):
    """An output of a kernel that is a derivative of another one: it has none itself."""

    generate_vmap_rule = True

    @staticmethod
    def forward(kernel: str, value: torch.Tensor) -> torch.Tensor:
        """The same numbers."""
        return value.view_as(value)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[str, torch.Tensor], output: torch.Tensor) -> None:
        """Keep the name of the kernel."""
        ctx.kernel, _ = inputs

    @staticmethod
    def backward(ctx: Any, *slopes: torch.Tensor) -> None:
        """Refuse."""
        raise LibraryError(SECOND.format(ctx.kernel))

    jvp = backward
