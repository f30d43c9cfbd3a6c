"""`runtime.torch` and `runtime.jax`: dynamics of one robot on arrays of either."""

from abc import ABC, abstractmethod
from importlib import import_module
from typing import Any

import numpy as np

from runtime.common.optional import optional
from runtime.errors import LibraryError, ShapeError
from runtime.library import Array, Library, require_library
from runtime.tapes.derivatives import Tensor


class TapeFunctions(ABC):
    """τ, M, h, g, ddq and the loss of a robot as differentiable functions.

    Arrays have the shape (..., size); leading axes are samples and broadcast. Those of a free base
    begin with its coordinates: see `runtime.BaseMotion`. π is that of the URDF where neither `pi`
    nor `lam` is given. Single precision is computed in double. An argument of another shape, or
    that is no array of real numbers, raises ShapeError.

    Args:
        q: (..., n) joint positions [rad, m].
        dq: (..., n) joint velocities [rad/s, m/s].
        ddq: (..., n) joint accelerations [rad/s², m/s²].
        tau: (..., n) joint torques [N·m, N].
        pi: (..., 10 L) inertial parameters.
        lam: (..., 10 L) coordinates λ in place of π.
        rotor: J (..., n), inertia of the rotors [kg·m², kg]; None: zero.
        weight: (n,) diagonal of W; None: 1.
    """

    xp: Any
    """Module of the arrays."""
    cast: str
    """Method of an array that changes its type of numbers."""

    def __init__(self, lib: Library) -> None:
        require_library(lib)
        self.lib = lib
        self._size = {"pi": lib.pi0.size, "lam": lib.pi0.size}
        self._constants: dict[Any, Tensor] = {}

    @abstractmethod
    def _here(self, name: str, value: Any) -> Tensor:
        """The array or the numbers on the CPU."""

    @abstractmethod
    def _call(self, kernel: str, *values: Tensor) -> Tensor:
        """First output of a kernel, on the tape."""

    def inverse_dynamics(
        self, q: Any, dq: Any, ddq: Any, pi: Any = None, *, lam: Any = None
    ) -> Tensor:
        """Joint torques τ = Y(q, dq, ddq) π, (..., n) [N·m, N]. Source: Eq. 4.3."""
        return self._call("inverse_dynamics", *self._motion(q=q, dq=dq, ddq=ddq, pi=pi, lam=lam))

    def mass_matrix(self, q: Any, pi: Any = None, *, lam: Any = None) -> Tensor:
        """Mass matrix M(q), (..., n, n). Source: Eq. 2.34."""
        return self._call("mass_matrix", *self._motion(q=q, pi=pi, lam=lam))

    def bias(self, q: Any, dq: Any, pi: Any = None, *, lam: Any = None) -> Tensor:
        """Bias forces h = τ(q, dq, 0), (..., n) [N·m, N]. Source: Eq. 2.34."""
        return self._call("bias_forces", *self._motion(q=q, dq=dq, pi=pi, lam=lam))

    def gravity(self, q: Any, pi: Any = None, *, lam: Any = None) -> Tensor:
        """Torques that hold the robot at rest, g = τ(q, 0, 0), (..., n) [N·m, N]."""
        q, pi = self._motion(q=q, pi=pi, lam=lam)
        return self._call("bias_forces", q, self._constant("zeros", q), pi)

    def forward_dynamics(
        self, q: Any, dq: Any, tau: Any, pi: Any = None, rotor: Any = None, *, lam: Any = None
    ) -> Tensor:
        """Accelerations ddq = (M + diag(J))⁻¹ (τ − h), (..., n) [rad/s², m/s²]."""
        q, dq, tau, pi = self._motion(q=q, dq=dq, tau=tau, pi=pi, lam=lam)
        inertia = self._constant("zeros", q) if rotor is None else self._entry("rotor", rotor, q)
        return self._call("forward_dynamics", q, dq, tau, pi, inertia)

    def regressor_loss(
        self,
        q: Any,
        dq: Any,
        ddq: Any,
        tau: Any,
        pi: Any = None,
        weight: Any = None,
        *,
        lam: Any = None,
    ) -> Tensor:
        """Loss Σ ½ rᵀ W r over all samples of one π or λ, r = Y π − τ. Source: Eqs. 4.5, 4.6.

        Returns:
            () loss.
        """
        *state, pi = self._motion(q=q, dq=dq, ddq=ddq, tau=tau, pi=pi, lam=lam)
        ones = self._constant("ones", pi)
        diagonal = ones if weight is None else self._entry("weight", weight, pi)
        for name, value in (("pi", pi), ("weight", diagonal)):
            if value.ndim != 1:
                raise ShapeError(
                    f"regressor_loss needs one {name} for all samples, got {tuple(value.shape)}; "
                    "use vmap for several"
                )
        beta = pi @ self._constant("base_matrix", pi)
        lead = np.broadcast_shapes(*(tuple(x.shape[:-1]) for x in state))
        whole = (self.xp.broadcast_to(x, (*lead, x.shape[-1])) for x in state)
        rows = [x.reshape(-1, x.shape[-1]) for x in whole]
        return self._call("loss_gradient", *rows, diagonal, beta)[0]

    def pi_from_lam(self, lam: Any) -> Tensor:
        """Inertial parameters π of coordinates λ, (..., 10 L). Source: Eqs. 4.25 to 4.31."""
        value = self._entry("lam", lam)
        links = self._call("pi_from_lam", value.reshape(*value.shape[:-1], self.lib.n_links, -1))
        return links.reshape(value.shape)

    def _motion(self, *, pi: Any, lam: Any, **state: Any) -> list[Tensor]:
        """State and π as arrays of one dtype, their shapes checked."""
        if pi is not None and lam is not None:
            raise ShapeError("expected pi or lam, got both; leave one of them out")
        arrays: list[Tensor] = []
        for name, value in state.items():
            arrays.append(self._entry(name, value, arrays[0] if arrays else None))
        if lam is not None:
            return [*arrays, self.pi_from_lam(self._entry("lam", lam, arrays[0]))]
        if pi is None:
            return [*arrays, self._constant("pi0", arrays[0])]
        return [*arrays, self._entry("pi", pi, arrays[0])]

    def _entry(self, name: str, value: Any, like: Tensor | None = None) -> Tensor:
        size = self._size.get(name, self.lib.n_rows)
        array = self._array(name, value, like)
        if not array.ndim or array.shape[-1] != size:
            raise ShapeError(
                f"{name} of '{self.lib.name}' needs the shape (..., {size}), "
                f"got {tuple(array.shape)}"
            )
        return array

    def _array(self, name: str, value: Any, like: Tensor | None = None) -> Tensor:
        """The value as an array, of the dtype of another if given."""
        try:
            array = self._here(name, value)
        except (TypeError, ValueError):
            raise ShapeError(f"{name} needs an array of numbers, got {value!r:.60}") from None
        if like is not None:
            return array if array.dtype == like.dtype else getattr(array, self.cast)(like.dtype)
        if array.dtype not in (self.xp.float64, self.xp.float32):
            raise ShapeError(f"{name} needs float64 or float32, got {array.dtype}")
        return array

    def _constant(self, name: str, like: Tensor) -> Tensor:
        """π of the URDF, a matrix of the base parameters, zeros or ones of rows, per dtype."""
        key = (name, like.dtype)
        if key not in self._constants:
            values: dict[str, Array] = {
                "pi0": self.lib.pi0,
                "base_matrix": self.lib.base_matrix.T,
                "zeros": np.zeros(self.lib.n_rows),
                "ones": np.ones(self.lib.n_rows),
            }
            self._constants[key] = self._array(name, values[name], like)
        return self._constants[key]


def torch(lib: Library) -> TapeFunctions:
    """Dynamics of a robot as differentiable functions of torch, on the CPU.

    Args:
        lib: library of the robot.

    Returns:
        `inverse_dynamics`, `mass_matrix`, `bias`, `gravity`, `forward_dynamics` and
        `regressor_loss` on tensors (..., n), with autograd, vmap and torch.compile.

    Raises:
        LibraryError: torch is not installed, or the argument is no library.
    """
    return _functions("torch", "runtime.tapes.torch_functions", lib)


def jax(lib: Library) -> TapeFunctions:
    """Dynamics of a robot as differentiable functions of JAX, on the CPU.

    Args:
        lib: library of the robot.

    Returns:
        `inverse_dynamics`, `mass_matrix`, `bias`, `gravity`, `forward_dynamics` and
        `regressor_loss` on arrays (..., n), with grad, vmap and jit.

    Raises:
        LibraryError: JAX is not installed, or the argument is no library.
    """
    return _functions("jax", "runtime.tapes.jax_functions", lib)


def _functions(name: str, module: str, lib: Library) -> TapeFunctions:
    optional(name, "a differentiable robot", name, LibraryError)
    functions: TapeFunctions = import_module(module).Functions(lib)
    return functions
