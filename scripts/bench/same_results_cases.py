"""Cases of `scripts/same_results`: commands as data, and the logs and files that they read.

Of `{NAME}` in a command: a robot is the folder of the case `robot-NAME`, data and models are those
of the shared folder, inputs are written below, tree is the checkout. Commands run in the folder of
their case. The word `python` runs one of `SCRIPTS`.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

_ICUB_LOCKS = " ".join(
    f"--lock {side}_wrist_{name}=0" for side in "lr" for name in ("prosup", "pitch", "yaw")
)
_TIAGO_LOCKS = " ".join(
    f"--lock {name}_joint=0"
    for name in ("head_1", "head_2", "gripper_finger", "gripper_right_finger")
)
_BUILD = "build --level portable --out ."  # the same bits on every machine
_GO2 = "{examples}/go2_description/urdf/go2.urdf"
_GO2_AIR = "identify {data}/unitree_air/go2.npz --robot {go2} --cutoff 10 --delay auto --out out"
_PANDA = "identify panda_gaz --robot {fr3} --out out"
_FR3 = "identify fr3_simulated --robot {fr3} --cutoff 10 --out"
_DVRK = "identify {data}/dvrk"

CASES: dict[str, tuple[str, ...]] = {
    "models": ("list", "inspect {tree}/symgen/robots/ur5e.urdf --json", "describe nothing"),
    "robot-fr3": (f"{_BUILD} --robot fr3",),
    "robot-tx40": (
        f"{_BUILD} --urdf {{models}}/staubli_tx40/tx40_mdh_modified.urdf --name tx40 --project",
    ),
    "robot-kuka_lwr4": (
        f"{_BUILD} --urdf {{models}}/kuka_lwr4/kuka_lwr4.urdf --name kuka_lwr4",
    ),
    "robot-z1": (f"{_BUILD} --urdf {{models}}/unitree_z1/z1.urdf --name z1",),
    "robot-go2": (f"{_BUILD} --urdf {_GO2} --name go2",),
    "robot-go2_free": (f"{_BUILD} --urdf {_GO2} --name go2_free --floating --project",),
    "robot-icub": (
        f"{_BUILD} --urdf {{data}}/icub_feet/model.urdf --name icub --floating --project"
        f" --snap 1e-4 {_ICUB_LOCKS}",
    ),
    "robot-tiago": (
        f"{_BUILD} --urdf {{data}}/tiago/tiago_48_schunk.urdf --name tiago --project"
        f" --base torso_fixed_link {_TIAGO_LOCKS}",
    ),
    "robot-mtm": (f"{_BUILD} --urdf {{tree}}/scripts/dvrk/mtm.toml --name mtm",),
    "robot-psm": (f"{_BUILD} --urdf {{tree}}/scripts/dvrk/psm.toml --name psm",),
    "robot-ur10": (
        f"{_BUILD} --urdf {{models}}/universal_robots/ur10_robot.urdf --name ur10",
    ),
    "robot-so101": (
        f"{_BUILD} --urdf {{models}}/so101/so101_new_calib.urdf --name so101",
    ),
    # One log with measured torque.
    "panda-map": (f"{_PANDA} --save-statistics", "evaluate out fr3_simulated --robot {fr3} --json"),
    "panda-no-refit": (f"{_PANDA} --no-refit --no-report --friction viscous,coulomb",),
    "panda-simulation": (f"{_PANDA} --preset simulation",),
    "panda-real": (f"{_PANDA} --preset real",),
    "panda-full": (f"{_PANDA} --method adam --preset full --seed 3",),
    **{
        f"panda-{method}": (f"{_PANDA} --method {method}",)
        for method in ("adam", "lm", "log-cholesky", "pc-ols", "ols", "wls", "iv", "ekf", "nn")
    },
    "panda-robust": (f"{_PANDA} --robust",),
    "panda-auto": (f"{_PANDA} --friction auto,rotor --cutoff auto",),
    "panda-momentum": (f"{_PANDA} --regressor momentum --cutoff 5 --friction none",),
    "panda-energy": (f"{_PANDA} --regressor energy --cutoff 5",),
    "panda-delay": (f"{_PANDA} --delay auto --encoder-bias",),
    "panda-prior": (f"{_PANDA} --prior {{inputs}}/arm.toml",),
    "tx40": ("identify tx40_figaroh --robot {tx40} --out out",),
    "tx40-pc-ols": ("identify tx40_figaroh --robot {tx40} --method pc-ols --out out",),
    "lwr4": ("identify lwr4_flobaroid --robot {kuka_lwr4} --out out",),
    "lwr4-streamed": ("identify lwr4_flobaroid --robot {kuka_lwr4} --stream --out out",),
    "lwr4-two": ("identify lwr4_flobaroid --robot {kuka_lwr4} --run 1,2 --out out",
                 "evaluate out lwr4_flobaroid --robot {kuka_lwr4} --run 3"),
    "lwr4-three": ("identify lwr4_flobaroid --robot {kuka_lwr4} --run 1,2,3 --out out",),
    "fr3": (f"{_FR3} out", f"{_FR3} all --split all", "evaluate all fr3_simulated --robot {fr3}"),
    "fr3-streamed": (f"{_FR3} out --stream",),
    "dvrk-mtm": (
        "inspect {data}/dvrk/mtm_one.csv --robot {mtm} --log-rate 200 --recipe-out recipe.toml",
        f"{_DVRK}/mtm_one.csv --robot {{mtm}} --recipe recipe.toml --out out",
        "evaluate out {data}/dvrk/mtm_two.csv --robot {mtm} --recipe recipe.toml",
    ),
    "dvrk-psm": (
        "inspect {data}/dvrk/psm_one_no_weight.csv --robot {psm} --log-rate 200"
        " --recipe-out recipe.toml",
        f"{_DVRK}/psm_one_no_weight.csv --robot {{psm}} --recipe recipe.toml --out out",
        "evaluate out {data}/dvrk/psm_two.csv --robot {psm} --recipe recipe.toml",
        "friction out {data}/dvrk/psm_two.csv --robot {psm} --recipe recipe.toml --out friction",
    ),
    # Commanded torque, motor currents, a free base.
    "z1": ("identify {data}/unitree_air/z1.npz --robot {z1} --cutoff 10 --delay auto --out out",),
    "go2": (f"{_GO2_AIR}",),
    "go2-tied": (f"{_GO2_AIR} --symmetric FL:FR --symmetric RL:RR --tie",),
    "tiago": (
        "inspect {data}/tiago --robot {tiago} --recipe-out recipe.toml",
        "identify {data}/tiago --robot {tiago} --recipe recipe.toml --out out",
    ),
    "icub-walking": (
        "identify {inputs}/icub_walking.npz --robot {icub} --rows base --cutoff 3 --split 0.5"
        " --out out",
    ),
    "go2-walking": (
        "identify {inputs}/go2_walking.npz --robot {go2_free} --rows all --cutoff 10 --out out",
    ),
}  # fmt: skip

SCRIPTS: dict[str, str] = {}
"""Programs of the word `python`."""


def _icub(place: Path, shared: Path) -> None:
    """Walking iCub with the errors of its vertical force sensors, as in `bench.walking`."""
    with np.load(shared / "data/icub_feet/walking.npz") as log:
        arrays = {key: log[key] for key in ("q", "joints", "base_rpy")} | {
            "t": log["t"] - log["t"][0],
            "base_position": log["base_pos"],
            "contact_force_z": np.stack([log["lf_fz"], log["rf_fz"]], axis=1),
        }
    np.savez(
        place,
        **arrays,
        contact_links=np.array(["l_ankle_2", "r_ankle_2"]),
        contact_position=np.array([(-0.0035, 0.0, -0.0605)] * 2),
        contact_force_z_sigma=np.full(2, 6.6),
        contact_force_z_sharing=np.array(0.1),
        contact_force_z_crosstalk=np.array((0.0, 0.5)),
        contact_force_z_cutoff=np.array(3.0),
    )


def _go2_walking(place: Path, shared: Path) -> None:
    """Virtual Go2 with known wrenches of its four feet."""
    import pinocchio

    from tests.free_base_logs import Experiment, virtual_log

    robots = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots"
    urdf = (robots / "go2_description/urdf/go2.urdf").read_text(encoding="utf-8")
    feet = tuple(f"{leg}_calf" for leg in ("FL", "FR", "RL", "RR"))
    noise = Experiment(
        count=1200,
        rate_hz=200.0,
        joint=None,
        torque_noise=0.001,
        force_noise=0.25,
        moment_noise=0.005,
    )
    np.savez(place, **virtual_log(urdf, feet, 0, noise).arrays)


INPUTS: dict[str, Callable[[Path, Path], None]] = {
    "icub_walking.npz": _icub,
    "go2_walking.npz": _go2_walking,
    "arm.toml": lambda place, shared: _write(
        place,
        'trust = "cad"\ntotal_mass = [17.0, 18.5]\n\n[link.fr3_link7]\nmass = [0.5, 1.5]\n'
        'com_box = [[-0.05, -0.05, -0.1], [0.05, 0.05, 0.1]]\nsymmetry = ["xz"]\n',
    ),
}
"""File → what writes it at a place, from the shared folder."""


def _write(place: Path, text: str) -> None:
    place.write_text(text, encoding="utf-8")
