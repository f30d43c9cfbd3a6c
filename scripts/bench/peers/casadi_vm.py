"""CasADi's virtual machine on the expressions from which our C is generated."""

import time
from importlib.metadata import version
from typing import Any

import numpy as np

from bench.batch import Batch
from bench.peers.peer import Contender, Peer
from runtime.library import Array


def casadi_vm(functions: dict[str, tuple[Any, tuple[str, ...]]], batch: Batch) -> Peer:
    """Expressions of our C code in CasADi's virtual machine; one sample, repeated."""

    def contender(function: Any, names: tuple[str, ...]) -> Contender:
        buffer, trigger = function.buffer()
        arrays = [batch.named(name) for name in names]
        inputs = [np.array(x[-1] if x.ndim == 2 else x) for x in arrays]
        outputs = [np.zeros(function.numel_out(k)) for k in range(function.n_out())]
        for k, x in enumerate(inputs):
            buffer.set_arg(k, x.data)
        for k, x in enumerate(outputs):
            buffer.set_res(k, x.data)

        kept = (buffer, inputs)  # the trigger holds only addresses

        def run(calls: int, _kept: object = kept) -> float:
            start = time.perf_counter_ns()
            for _ in range(calls * batch.size):
                trigger()
            return (time.perf_counter_ns() - start) / (calls * batch.size)

        def last() -> Array:
            return outputs[-1]

        return Contender("Function", run, last)

    contenders = {name: contender(f, names) for name, (f, names) in functions.items()}
    return Peer(f"casadi {version('casadi')}", contenders)
