"""A result on the disk and a reader of its page, for tests of reports."""

import json
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

from runtime.outputs.report.report import write_report

Change = Callable[[dict[str, Any]], object]

VOID = {"meta", "link", "br", "hr", "img", "input"}


def result() -> dict[str, Any]:
    """A full result of two joints, a turning and a sliding one."""
    return {
        "format": 1,
        "method": "adam",
        "robot": "toy",
        "status": "stopped: the validation loss has not improved for 50 iterations",
        "joints": ["shoulder", "rail"],
        "units": ["N*m", "N"],
        "recording": {
            "name": "log.csv",
            "duration": 12.5,
            "samples": {"train": 700, "validation": 150, "test": 400},
            "history": ["low-pass at 20 Hz", "central differences"],
            "split": "70/15/15 in time",
        },
        "torque_error_percent": {
            "before": [31.41, 22.22],
            "after": [4.321, 5.432],
            "before_overall": 27.18,
            "after_overall": 4.669,
        },
        "torque_rms": {"before": [1.2345, 6.789], "after": [0.1357, 0.2468]},
        "links": [
            {
                "name": f"link{k}",
                "mass": 1.5 + k,
                "mass_before": 2.0,
                "com": [0.0, 0.012, 0.1],
                "com_before": [0.0, 0.0, 0.1],
                "min_relative_eigenvalue": 1.5e-4,
            }
            for k in (1, 2)
        ],
        "consistent": True,
        "gap_to_convex_optimum": 3.2e-9,
        "weights": [1.0, 0.25],
        "friction": {
            "columns": ["viscous", "Coulomb"],
            "coulomb_speed": 0.02,
            "values": [[0.1111, 0.2222], [0.3333, 0.4444]],
        },
        "convergence": {
            "iteration": [0, 10, 20],
            "training": [3.0, 0.3, 0.03],
            "validation": [3.3, None, 0.04],
        },
        "iterations": 20,
        "seconds": 1.234,
        "warnings": ["rail is hardly excited"],
        "pi": [0.0] * 20,
        "lam": [0.0] * 20,
        "beta": [0.0],
        "condition_number": 87.3,
        "provenance": {
            "command": "python -m runtime identify log.csv",
            "versions": {"symgen": "0.1.0"},
            "files": {"log.csv": "ab" * 32},
            "model_hash": "cd" * 32,
            "seed": 7,
        },
    }


def predictions(samples: int = 400, joints: int = 2) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    arrays = {key: rng.normal(size=(samples, joints)) for key in ("measured", "before", "after")}
    return {"t": np.arange(samples) * 0.01, **arrays}


def write(folder: Path, change: Change | None = None, samples: int = 400, joints: int = 2) -> Path:
    raw = result()
    if change:
        change(raw)
    folder.mkdir(exist_ok=True)
    (folder / "result.json").write_text(json.dumps(raw))
    np.savez(folder / "predictions.npz", **predictions(samples, joints))
    return folder


class Reader(HTMLParser):
    """Text, tags and addresses of a page; raises when tags do not nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.ids += [value or "" for key, value in attrs if key == "id"]
        self.addresses += [v or "" for k, v in attrs if k in {"href", "src", "xlink:href"}]

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data.replace("\N{NO-BREAK SPACE}", " "))

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def read(folder: Path) -> Reader:
    return Reader(write_report(folder).read_text(encoding="utf-8"))
