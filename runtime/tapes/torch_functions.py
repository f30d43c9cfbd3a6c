"""Kernels as operators of torch: one custom operator, its derivative, and its rule for vmap.

`symgen::kernel(values, robot, kernel)` calls a kernel of a library that this process has loaded,
by its address, on the memory of the tensors: contiguous tensors of doubles are not copied. Shapes
are in the manifest, so that torch.compile traces the operator without running it. `symgen::plain`
is the same without a derivative, which costs 10 µs per call also where no tensor needs one.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from runtime.errors import LibraryError, ShapeError
from runtime.library import Library
from runtime.tapes.derivatives import DIFFERENTIABLE, derivatives
from runtime.tapes.functions import TapeFunctions

LIBRARIES: dict[str, "TorchFunctions"] = {}
"""Functions by the hash of the model: an operator of torch takes tensors and text only."""


class TorchFunctions(TapeFunctions):
    """Differentiable functions of a robot on tensors; see `TapeFunctions`."""

    def __init__(self, lib: Library) -> None:
        super().__init__(lib)
        self.key = f"{lib.manifest.model_hash[:16]}_{lib.level}"
        LIBRARIES.setdefault(self.key, self)

    def _array(self, name: str, value: Any, like: torch.Tensor | None = None) -> torch.Tensor:
        if not isinstance(value, torch.Tensor):
            try:
                value = torch.as_tensor(np.asarray(value, dtype=float))
            except (TypeError, ValueError):
                raise ShapeError(f"{name} needs a tensor of numbers, got {value!r:.60}") from None
        if not value.is_cpu:
            raise ShapeError(
                f"{name} is on the device '{value.device}', the kernels of '{self.lib.name}' run "
                "on the CPU; give tensor.cpu()"
            )
        if like is not None:
            return value if value.dtype == like.dtype else value.to(like.dtype)
        if value.dtype not in {torch.float64, torch.float32}:
            raise ShapeError(f"{name} needs float64 or float32, got {value.dtype}")
        return value

    def _call(self, kernel: str, *values: torch.Tensor) -> torch.Tensor:
        recorded = torch.is_grad_enabled() and any(x.requires_grad for x in values)
        if recorded and not torch.compiler.is_compiling():
            return Recorded.apply(self.key, kernel, *values)[0]
        run = run_kernel if recorded else run_plain
        return run(list(values), self.key, kernel)[0]

    @staticmethod
    def _zeros(like: torch.Tensor) -> torch.Tensor:
        return like.new_zeros(like.shape[-1])

    @staticmethod
    def _rows(value: torch.Tensor, lead: tuple[int, ...]) -> torch.Tensor:
        return value.expand(*lead, value.shape[-1]).reshape(-1, value.shape[-1])


def _run(values: list[torch.Tensor], robot: str, kernel: str) -> list[torch.Tensor]:
    """All outputs of a kernel, (..., *shape), from inputs (..., size), in doubles."""
    lib = LIBRARIES[robot].lib
    lead, shapes = _shapes(values, lib, kernel)
    places, steps, held = [], [], []
    for value in values:
        array, size = value, value.shape[-1]
        one = value.numel() == size
        if not one and value.shape[:-1] != lead:
            array = value.expand(*lead, size)
        if array.dtype != torch.float64 or not array.is_contiguous():
            array = array.to(torch.float64).contiguous()
        held.append(array)  # a temporary would be freed before the call
        places.append(array.data_ptr())
        steps.append(0 if one else size)
    results = [torch.empty(shape, dtype=torch.float64) for shape in shapes]
    lib.run_kernel(kernel, lead.numel(), places, steps, [x.data_ptr() for x in results])
    dtype = values[0].dtype
    return results if dtype == torch.float64 else [x.to(dtype) for x in results]


def _fake(values: list[torch.Tensor], robot: str, kernel: str) -> list[torch.Tensor]:
    _, shapes = _shapes(values, LIBRARIES[robot].lib, kernel)
    return [values[0].new_empty(shape) for shape in shapes]


def _shapes(
    values: list[torch.Tensor], lib: Library, kernel: str
) -> tuple[torch.Size, list[tuple[int, ...]]]:
    """Leading axes of the inputs, and the shapes of the outputs."""
    leads = {value.shape[:-1] for value in values if value.ndim > 1}
    lead = leads.pop() if len(leads) == 1 else torch.broadcast_shapes((), *leads)
    outputs = lib.kernel_facts(kernel).outputs
    return lead, [a.shape if a.summed else (*lead, *a.shape) for a in outputs]


def _slopes(
    robot: str,
    kernel: str,
    values: Sequence[torch.Tensor],
    outputs: Sequence[torch.Tensor],
    slope: torch.Tensor,
    needed: Sequence[bool],
) -> list[torch.Tensor | None]:
    """Slope of a cost by the inputs of a kernel from that by its first output."""
    if kernel not in DIFFERENTIABLE:
        raise LibraryError(
            f"expected first derivatives, got a second one: '{kernel}' is a derivative already; "
            "detach it, or take differences of the first derivatives"
        )
    functions = LIBRARIES[robot]
    shape = functions.lib.kernel_facts(kernel).outputs[0].shape

    def call(name: str, *given: torch.Tensor) -> list[torch.Tensor]:
        return run_kernel(list(given), robot, name)

    parts = derivatives(torch, call, kernel, values, outputs, needed, functions.lib)
    answer: list[torch.Tensor | None] = []
    for value, part, use in zip(values, parts, needed, strict=True):
        if part is None or not use:
            answer.append(None)
        elif kernel == "loss_gradient":
            answer.append((slope * part).reshape(value.shape))
        else:
            row = slope.reshape(*slope.shape[: slope.ndim - len(shape)], 1, -1)
            lead = part.shape[: part.ndim - len(shape) - 1]
            full = row @ part.reshape(*lead, -1, part.shape[-1])
            answer.append(full[..., 0, :].sum_to_size(value.shape))
    return answer


def _setup(ctx: Any, inputs: tuple[Any, ...], output: list[torch.Tensor]) -> None:
    values, ctx.robot, ctx.kernel = inputs
    ctx.count = len(values)
    ctx.save_for_backward(*values, *output)


def _backward(ctx: Any, slopes: list[torch.Tensor]) -> tuple[list[torch.Tensor | None], None, None]:
    values, outputs = ctx.saved_tensors[: ctx.count], ctx.saved_tensors[ctx.count :]
    needed = ctx.needs_input_grad[0]
    return _slopes(ctx.robot, ctx.kernel, values, outputs, slopes[0], needed), None, None


def _vmap(
    info: Any, places: Any, values: list[torch.Tensor], robot: str, kernel: str
) -> tuple[list[torch.Tensor], list[int]]:
    """A mapped axis is one more leading axis; a sum over samples runs once per entry of it."""
    pairs = list(zip(values, places[0], strict=True))
    if any(a.summed for a in LIBRARIES[robot].lib.kernel_facts(kernel).outputs):
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


for _name in ("symgen::kernel", "symgen::plain"):
    torch.library.define(_name, "(Tensor[] values, str robot, str kernel) -> Tensor[]")
    torch.library.impl(_name, "cpu", _run)
    torch.library.register_fake(_name, _fake)
    torch.library.register_vmap(_name, _vmap)
torch.library.register_autograd("symgen::kernel", _backward, setup_context=_setup)
run_kernel, run_plain = torch.ops.symgen.kernel.default, torch.ops.symgen.plain.default


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

    @staticmethod
    def backward(ctx: Any, slope: torch.Tensor, *_: torch.Tensor) -> tuple[Any, ...]:
        """Slopes by the inputs."""
        values, outputs = ctx.saved_tensors[: ctx.count], ctx.saved_tensors[ctx.count :]
        needed = ctx.needs_input_grad[2:]
        return None, None, *_slopes(ctx.robot, ctx.kernel, values, outputs, slope, needed)
