"""Dynamics of one robot on arrays of torch or JAX: the functions, their arguments and shapes."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from runtime.errors import ShapeError
from runtime.library import Library, require_library
from runtime.tapes.derivatives import Tensor


class TapeFunctions(ABC):
    """τ, M, h, g, ddq and the loss of a robot as differentiable functions.

    Arrays have the shape (..., size); leading axes are samples and broadcast. Those of a free base
    begin with its coordinates: see `runtime.BaseMotion`. Single precision is computed in double. An
    argument of another shape, or one that is no array of real numbers, raises ShapeError.

        q, dq, ddq   (..., n) positions, velocities, accelerations [rad, m, s]
        tau          (..., n) joint torques, of `regressor_loss` measured ones [N·m, N]
        pi           (..., 10 L) inertial parameters; default those of the URDF
        lam          (..., 10 L) coordinates λ in place of π
        rotor        (..., n) inertia J of the rotors [kg·m², kg]; default zero
    """

    def __init__(self, lib: Library) -> None:
        require_library(lib)
        self.lib = lib
        self._size = {"pi": lib.pi0.size, "lam": lib.pi0.size}
        self._constants: dict[Any, Tensor] = {}

    @abstractmethod
    def _array(self, name: str, value: Any, like: Tensor | None = None) -> Tensor:
        """The value as an array, of the dtype of another if given."""

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
        """Bias forces h = τ(q, dq, 0), (..., n) [N·m, N], gravity included. Source: Eq. 2.34."""
        return self._call("bias_forces", *self._motion(q=q, dq=dq, pi=pi, lam=lam))

    def gravity(self, q: Any, pi: Any = None, *, lam: Any = None) -> Tensor:
        """Torques that hold the robot at rest, g = τ(q, 0, 0), (..., n) [N·m, N]."""
        q, pi = self._motion(q=q, pi=pi, lam=lam)
        return self._call("bias_forces", q, self._zeros(q), pi)

    def forward_dynamics(
        self, q: Any, dq: Any, tau: Any, pi: Any = None, rotor: Any = None, *, lam: Any = None
    ) -> Tensor:
        """Accelerations ddq = (M + diag(J))⁻¹ (τ − h), (..., n) [rad/s², m/s²]."""
        q, dq, tau, pi = self._motion(q=q, dq=dq, tau=tau, pi=pi, lam=lam)
        inertia = self._zeros(q) if rotor is None else self._entry("rotor", rotor, q)
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
        """Loss L = Σ ½ rᵀ W r over all samples, r = Y π − τ. Source: Eqs. 4.5, 4.6.

        W is diagonal, `weight` (n,), default 1; π or λ, (10 L,), is the same for all samples.
        """
        *state, pi = self._motion(q=q, dq=dq, ddq=ddq, tau=tau, pi=pi, lam=lam)
        diagonal = self._zeros(pi[..., : self.lib.n_rows]) + 1
        if weight is not None:
            diagonal = self._entry("weight", weight, pi)
        for name, value in (("pi", pi), ("weight", diagonal)):
            if value.ndim != 1:
                raise ShapeError(
                    f"regressor_loss needs one {name} for all samples, got {tuple(value.shape)}; "
                    "use vmap for several"
                )
        beta = pi @ self._constant("base_matrix", pi)
        lead = np.broadcast_shapes(*(tuple(x.shape[:-1]) for x in state))
        rows = [self._rows(x, lead) for x in state]
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

    def _constant(self, name: str, like: Tensor) -> Tensor:
        """π of the URDF or a matrix of the base parameters, kept per dtype."""
        key = (name, like.dtype)
        if key not in self._constants:
            value = self.lib.pi0 if name == "pi0" else self.lib.base_matrix.T
            self._constants[key] = self._array(name, value, like)
        return self._constants[key]

    @staticmethod
    @abstractmethod
    def _zeros(like: Tensor) -> Tensor:
        """Zeros of one sample, (size,), of the dtype of another array."""

    @staticmethod
    @abstractmethod
    def _rows(value: Tensor, lead: tuple[int, ...]) -> Tensor:
        """One row per sample: (N, size) of the leading axes."""
