"""Every kind of log with every feature: it works, or is refused for the reason of the table."""

import json
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime import identify, read_free_base
from runtime.library import Library, load
from symgen.chain import ChainOptions
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import ONE_LEVEL
from tests.runtime import combinations
from tests.runtime.combinations import AFTERWARDS, FEATURES, KINDS, REASONS
from tests.runtime.conftest import Command

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "combinations.md"


def stated() -> dict[tuple[str, str], str]:
    """(feature, kind of log) → cell of the page."""
    rows = [
        [cell.strip() for cell in line.strip("|\n").split("|")]
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith("|")
    ]
    head, lines = rows[0], rows[2:]
    return {
        (line[0], name): cell
        for line in lines
        for name, cell in zip(head[1:], line[1:], strict=True)
    }


@pytest.fixture(scope="module")
def pair(root: Path) -> Library:
    """Two mirrored arms of two joints."""
    return load(build(BuildRequest("pair", combinations.PAIR), root, levels=ONE_LEVEL).folder)


@pytest.fixture(scope="module")
def walker(root: Path) -> Library:
    """The same on a free base."""
    request = BuildRequest("walker", combinations.WALKER, ChainOptions(floating=True))
    return load(build(request, root, levels=ONE_LEVEL).folder)


@pytest.fixture(scope="module")
def logs(pair: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the logs of all kinds, and of the results."""
    folder = tmp_path_factory.mktemp("logs")
    combinations.write_logs(pair, folder)
    combinations.write_walk(folder)
    return folder


@pytest.fixture
def tmp_path(logs: Path) -> Path:
    """The one folder of all cells: the first result of a kind serves what follows."""
    return logs


@pytest.mark.parametrize("feature", [*FEATURES, *AFTERWARDS])
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_cell(
    kind: combinations.Kind,
    feature: str,
    pair: Library,
    walker: Library,
    logs: Path,
    command: Command,
) -> None:
    """Property: the answer of the command is that of the page."""
    lib = pair if kind.robot == "pair" else walker
    before, words = combinations.words_of(kind, feature, lib.folder)
    if before and not (logs / kind.name.replace(" ", "-")).exists():
        assert command(*before).code == 0
    ran = command(*words)
    assert combinations.cell_of(ran.code, ran.err) == stated()[feature, kind.name], ran.err
    assert feature != "rerun" or "same digits: result.json" in ran.out, ran.out


def test_mirrored_limbs_of_a_walk_are_tied(walker: Library, logs: Path) -> None:
    """Property: both sides get one body and nearly one friction, whose comparison is stated."""
    walk = read_free_base(logs / "walk.npz")
    settings = {"friction": "viscous,coulomb", "symmetric": ("left:right",)}
    apart, tied = (identify(walk, walker, **settings, tie=tie) for tie in (False, True))
    for result, is_tied in ((apart, False), (tied, True)):
        masses = dict(zip(walker.link_names, result.pi[::10], strict=True))
        differences = [
            masses[f"left_{part}"] - masses[f"right_{part}"] for part in ("upper", "fore")
        ]
        # Equations hold to the accuracy of the conic solver.
        assert (np.abs(differences).max() < 1e-6) == is_tied
        assert {each.quantity for each in result.record.symmetric} == {"friction"}
    assert any("are tied to their mean within 10 %" in note for note in tied.record.warnings)
    # The walk has equal friction on both sides.
    assert all(each.agrees for each in apart.record.symmetric)


def test_methods_are_compared_on_several_logs(pair: Library, logs: Path, command: Command) -> None:
    """Oracle: least squares over Pinocchio's regressor of the training rows of both logs."""
    model = pinocchio.buildModelFromXML(combinations.PAIR)
    data, trained, tested = model.createData(), list[np.ndarray](), list[np.ndarray]()
    for name in ("one", "two"):
        log = dict(np.load(logs / f"{name}.npz"))
        t, ddq = log["t"], np.gradient(log["dq"], log["t"], axis=0)
        np.savez(logs / f"{name}-ddq.npz", **log, ddq=ddq)
        rows = [
            np.column_stack([pinocchio.computeJointTorqueRegressor(model, data, *motion), tau])
            for *motion, tau in zip(log["q"], log["dq"], ddq, log["tau"], strict=True)
        ]
        share = (t - t[0]) / (t[-1] - t[0])
        trained += [row for row, x in zip(rows, share, strict=True) if x < 0.48]
        tested += [row for row, x in zip(rows, share, strict=True) if x >= 0.6]
    fitted, unseen = np.concatenate(trained), np.concatenate(tested)
    pi = np.linalg.lstsq(fitted[:, :-1], fitted[:, -1], rcond=1e-10)[0]
    rest = unseen[:, -1] - unseen[:, :-1] @ pi
    error = 100 * np.linalg.norm(rest) / np.linalg.norm(unseen[:, -1])
    words = ("one-ddq.npz", "two-ddq.npz", "--robot", pair.folder, "--friction", "none")
    assert command("compare", *words, "--methods", "map,ols", "--out", "methods").code == 0
    rows = json.loads((logs / "methods" / "compare.json").read_text())["rows"]
    # Both solve normal equations of one condition number, some 500, to rounding.
    assert rows[1]["test_percent"] == pytest.approx(error, rel=1e-9)
    assert rows[0]["test_percent"] != pytest.approx(error, rel=1e-3)


def test_reasons_are_few() -> None:
    """Property: every letter of the page has a reason, every reason is used, ten at most."""
    cells = set(stated().values()) - {"yes"}
    assert cells == set(REASONS)
    assert len(cells) <= 10
