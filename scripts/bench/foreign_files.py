"""The run behind `scripts/check_files`: robot files of others against parsers of others.

Each file is read in a process of its own, whose processor time is limited. Couplings and loops are
left out of both sides: compared is the mass matrix of all joints of the tree,

    max |M − M_other| ≤ ALLOWED · max |M_other|   over the joints that both name.
"""

import contextlib
import multiprocessing
import os
import re
import resource
import signal
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio

from bench.front import Sheet
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.document import first_element
from symgen.chain.mechanism import Mechanism
from symgen.chain.model import ROUNDING
from symgen.errors import SymgenError
from symgen.mechanics.dynamics import mass_matrix
from symgen.mechanics.inertia import pi_from_com
from symgen.ros.packages import Packages
from symgen.sources import Source, read_source, urdf_text

SECONDS, PATIENCE = 60, 600.0
"""Processor time in which a file is read, and time that a crowded machine may take [s]."""
STATES = 3
ALLOWED = 1e-6
"""Between texts of 17 digits and MuJoCo's principal inertias; entries of M of links that MJCF needs
between two joints (1e-9 kg) are below it, too."""
SUFFIXES = {".urdf", ".xacro", ".sdf", ".xml"}
OTHERS = {"robot": "Pinocchio", "mujoco": "MuJoCo", "sdf": "Drake"}
READ, REFUSED, NO_ROBOT = "read", "refused", "no robot"
CRASH = "crash"
Other = tuple[list[str], float, list[np.ndarray]]
"""Names of joints, mass of the bodies that they move, and M at the drawn positions."""


@dataclass(frozen=True, slots=True)
class Row:
    """One file."""

    repository: str
    file: str
    form: str  # first element
    outcome: str = CRASH  # read, refused, no robot, hang, crash, differs
    sentence: str = ""
    others: str = ""  # parser that reads moving joints in it
    error: float | None = None  # of M and of the mass, relative

    @property
    def is_right(self) -> bool:
        """Read or refused in a sentence, and equal where another parser reads it."""
        return self.outcome in {READ, REFUSED, NO_ROBOT}


def study(folder: Path, most: int | None = None) -> Iterator[Row]:
    """A row per robot file, of each repository at most so many, evenly chosen by their names."""
    for repository in sorted(each for each in folder.iterdir() if each.is_dir()):
        found = [path for path in sorted(repository.rglob("*")) if path.suffix in SUFFIXES]
        forms = {path: _form(path) for path in found if path.is_file()}
        robots = [path for path, form in forms.items() if form in OTHERS]
        step = max(1.0, len(robots) / most) if most else 1.0
        for k in range(round(len(robots) / step)):
            path = robots[int(k * step)]
            row = Row(repository.name, str(path.relative_to(repository)), forms[path])
            yield _in_child(row, path, folder)


def _form(path: Path) -> str:
    try:
        return first_element(urdf_text(path))
    except SymgenError:
        return ""


def _in_child(row: Row, path: Path, folder: Path) -> Row:
    """What a process says of a file: how it was read, then how it compares."""
    context = multiprocessing.get_context("fork")
    mine, theirs = context.Pipe()
    child = context.Process(target=_answer, args=(theirs, row, path, folder))
    child.start()
    theirs.close()
    with contextlib.suppress(EOFError):
        while mine.poll(PATIENCE):
            row = mine.recv()
    child.join(1.0)
    if row.outcome == CRASH and child.exitcode in {None, -signal.SIGXCPU, -signal.SIGKILL}:
        row = replace(row, outcome="hang")
    child.kill()
    child.join()
    return row


def _answer(pipe: Any, row: Row, path: Path, folder: Path) -> None:
    warnings.simplefilter("ignore")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # other parsers write to it
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, 3 * SECONDS))
    packages = Packages((folder / row.repository, *{p.parent for p in _packages(path)}))
    chain, text = None, ""
    try:
        source = Source(path, packages=packages)
        text, mechanism = read_source(source, Mechanism())
        try:
            chain = _chain(text, mechanism)
        except SymgenError as error:  # as the refusal of a fixed base advises
            advised = re.search(r"--floating --base (\S+) for", str(error))
            if advised is None:
                raise
            mechanism = mechanism.replace(spring=())  # a free base takes none
            chain = _chain(text, mechanism, floating=True, base=advised[1])
        row = replace(row, outcome=READ)
    except SymgenError as error:
        row = replace(row, outcome=REFUSED, sentence=str(error))
    pipe.send(replace(row, outcome=NO_ROBOT if chain is None else READ))
    resource.setrlimit(resource.RLIMIT_CPU, (3 * SECONDS, 3 * SECONDS))
    names, mass, matrices = _other(row.form, path, text or urdf_text(path), chain)
    if not names:
        return
    row = replace(row, others=OTHERS[row.form])
    if chain is not None and not chain.assumed:
        error = _difference(chain, names, mass, matrices)
        row = replace(row, outcome=READ if error <= ALLOWED else "differs", error=error)
    pipe.send(row)


def _chain(text: str, mechanism: Mechanism, **base: Any) -> Chain:
    return read_chain(text, ChainOptions(mechanism=mechanism, masses={}, **base))


def _packages(path: Path) -> list[Path]:
    return [each for each in path.parents if (each / "package.xml").is_file()]


def positions(names: list[str], state: int) -> dict[str, float]:
    """Position of each joint [rad, m]; that of a joint depends on its name only."""

    def drawn(name: str) -> float:
        return float(np.random.default_rng([state, *name.encode()]).uniform(-0.5, 0.5))

    return {name: drawn(name) for name in names}


def _difference(chain: Chain, names: list[str], mass: float, matrices: list[np.ndarray]) -> float:
    """Largest relative difference of mass and M."""
    tree = replace(chain, coupling=None, loops=None)
    joints = [joint.name for joint in tree.single_joints]
    q = ca.SX.sym("q", len(joints))
    bodies = [pi_from_com(j.mass, ca.DM(j.com), ca.DM(np.array(j.inertia))) for j in tree.joints]
    function = ca.Function("M", [q], [mass_matrix(tree, q, ca.SX(ca.vertcat(*bodies)))])
    shared = [name for name in joints if name in names]
    if sorted(shared) != sorted(names):
        missing = sorted({*names} - {*shared})
        return float("inf") if missing else 0.0
    ours, theirs = [joints.index(n) for n in shared], [names.index(n) for n in shared]
    error = abs(sum(joint.mass for joint in tree.joints) - mass) / max(mass, ROUNDING)
    for state, other in enumerate(matrices):
        at = positions(joints, state)
        m = np.array(function([at[name] for name in joints]))[-len(joints) :, -len(joints) :]
        m = m[np.ix_(ours, ours)]
        expected = other[np.ix_(theirs, theirs)]
        error = max(error, float(np.abs(m - expected).max() / np.abs(expected).max()))
    return error


def _other(form: str, path: Path, text: str, chain: Chain | None) -> Other:
    read = {"robot": _of_pinocchio, "mujoco": _of_mujoco, "sdf": _of_drake}[form]
    try:
        return read(path, text, chain)
    except Exception:  # another parser refuses in its own ways
        return [], 0.0, []


def _of_pinocchio(path: Path, text: str, chain: Chain | None) -> Other:
    del path, chain
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    names = list(model.names)[1:]
    matrices = []
    for state in range(STATES):
        at, q = positions(names, state), pinocchio.neutral(model)
        for k, name in enumerate(names, 1):
            joint = model.joints[k]
            turned = [at[name]] if joint.nq == 1 else [np.cos(at[name]), np.sin(at[name])]
            q[joint.idx_q : joint.idx_q + joint.nq] = turned
        m = pinocchio.crba(model, data, q)
        matrices.append(np.triu(m) + np.triu(m, 1).T)
    return names, sum(body.mass for body in list(model.inertias)[1:]), matrices


def _of_mujoco(path: Path, text: str, chain: Chain | None) -> Other:
    del text
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    single = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    joints = [k for k in range(model.njnt) if int(model.jnt_type[k]) in single]
    named = {k: model.joint(k).name or f"joint_{k}" for k in joints}
    if chain is not None:  # joints of objects of the scene, and joints below a ball, are left out
        inside = {joint.name for joint in chain.joints}
        named = {k: name for k, name in named.items() if name in inside}
    places = [int(model.jnt_dofadr[k]) for k in named]
    moved = np.zeros(model.nbody, dtype=bool)
    links = {joint.link for joint in chain.joints} if chain is not None else set()
    for body in range(1, model.nbody):
        own = any(int(model.jnt_bodyid[k]) == body for k in named)
        own = own or (chain is not None and chain.floating and model.body(body).name in links)
        moved[body] = own or moved[model.body_parentid[body]]
    matrices = []
    for state in range(STATES):
        at = positions([*named.values()], state)
        for k, name in named.items():
            data.qpos[model.jnt_qposadr[k]] = at[name]
        mujoco.mj_forward(model, data)
        m = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, m)
        m -= np.diag(model.dof_armature)
        matrices.append(m[np.ix_(places, places)])
    return [*named.values()], float(model.body_mass[moved].sum()), matrices


def _of_drake(path: Path, text: str, chain: Chain | None) -> Other:
    del text
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.0)
    models = Parser(plant).AddModels(str(path))
    plant.Finalize()
    inside = None if chain is None else {joint.name for joint in chain.joints}
    joints = [
        plant.get_joint(k)
        for model in models
        for k in plant.GetJointIndices(model)
        if plant.get_joint(k).num_velocities() == 1
    ]
    joints = [joint for joint in joints if inside is None or joint.name() in inside]
    context = plant.CreateDefaultContext()
    names, matrices = [joint.name() for joint in joints], []
    places = [joint.velocity_start() for joint in joints]
    for state in range(STATES):
        at = positions(names, state)
        for joint in joints:
            plant.SetPositions(context, _placed(plant, context, joint, at[joint.name()]))
        matrices.append(plant.CalcMassMatrix(context)[np.ix_(places, places)])
    bodies = plant.GetBodiesKinematicallyAffectedBy([joint.index() for joint in joints])
    return names, sum(plant.get_body(b).default_mass() for b in bodies), matrices


def _placed(plant: Any, context: Any, joint: Any, value: float) -> np.ndarray:
    q = plant.GetPositions(context)
    q[joint.position_start()] = value
    return q


def sheet(rows: list[Row]) -> Sheet:
    """One line per repository, and their sum."""
    head = ("repository", "files", "read", "compared", "largest error", "refused, read by another",
            "no robot", "differ", "crash or hang")  # fmt: skip
    groups = {name: [row for row in rows if row.repository == name] for name in
              sorted({row.repository for row in rows})} | {"all": rows}  # fmt: skip
    lines = []
    for name, of in groups.items():
        count, errors = Counter(r.outcome for r in of), [r.error for r in of if r.error is not None]
        largest = f"{max(errors):.1e}" if errors else ""
        cells = (len(of), count[READ] + count["differs"], len(errors), largest, count[REFUSED])
        cells = (*cells, count[NO_ROBOT], count["differs"], count["crash"] + count["hang"])
        lines.append((name, *map(str, cells)))
    return Sheet("", head, lines, rows, f"errors of M and mass, {STATES} positions each")
