"""Peers that compute the same: Pinocchio in C++ and from Python, MuJoCo, CasADi's VM, NumPy.

Every peer gets the same states and the same model, and its result for the last sample of the
batch is compared with ours before its time counts.
"""

from bench.peers.casadi_vm import casadi_vm
from bench.peers.mujoco_python import mujoco_python
from bench.peers.numpy_stored import numpy_stored
from bench.peers.peer import Contender, Peer
from bench.peers.pinocchio_cpp import pinocchio_cpp
from bench.peers.pinocchio_model import pinocchio_model
from bench.peers.pinocchio_python import pinocchio_python

__all__ = [
    "Contender",
    "Peer",
    "casadi_vm",
    "mujoco_python",
    "numpy_stored",
    "pinocchio_cpp",
    "pinocchio_model",
    "pinocchio_python",
]
