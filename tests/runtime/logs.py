"""Small logs of two joints as text and as files."""

from pathlib import Path

import numpy as np

HEADER = "t,q1,q2,dq1,dq2,tau1,tau2"


def motion(n: int = 400, rate: float = 100.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(n) / rate
    q = np.stack([np.sin(2 * t), 0.5 * np.cos(3 * t)], axis=1)
    dq = np.stack([2 * np.cos(2 * t), -1.5 * np.sin(3 * t)], axis=1)
    return t, q, dq


def csv_text(t, q, dq, tau=None, header: str = HEADER, separator: str = ",") -> str:
    tau = np.ones_like(q) if tau is None else tau
    rows = np.hstack([t[:, None], q, dq, tau])
    lines = [separator.join(f"{value:.17g}" for value in row) for row in rows]
    return "\n".join([header.replace(",", separator), *lines]) + "\n"


def written(folder: Path, content: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path
