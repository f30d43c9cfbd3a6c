"""Cases of `scripts/same_results`: commands as data.

Of `{NAME}` in a command: a robot is the folder of the case `robot-NAME`, data and models are those
of the shared folder, inputs those of `same_results_inputs`, tree is the checkout. Commands run in
the folder of their case. The word `python` runs one of `SCRIPTS`. Below, @KEY=VALUE stands for
--settings KEY=VALUE, and ~ for the variations of the log of the FR3, {inputs}/fr3.
"""

_ICUB_LOCKS = " ".join(
    f"--lock {side}_wrist_{name}=0" for side in "lr" for name in ("prosup", "pitch", "yaw")
)
_TIAGO_LOCKS = " ".join(
    f"--lock {name}_joint=0"
    for name in ("head_1", "head_2", "gripper_finger", "gripper_right_finger")
)
_BUILD = "build @level={level} --out ."
_GO2 = "{examples}/go2_description/urdf/go2.urdf"
_ROBOTS = {
    "fr3": None,
    "tx40": "{models}/staubli_tx40/tx40_mdh_modified.urdf @project=true",
    "kuka_lwr4": "{models}/kuka_lwr4/kuka_lwr4.urdf",
    "z1": "{models}/unitree_z1/z1.urdf",
    "go2": _GO2,
    "go2_free": f"{_GO2} --floating @project=true",
    "icub": f"{{data}}/icub_feet/model.urdf --floating @project=true @snap=1e-4 {_ICUB_LOCKS}",
    "tiago": "{data}/tiago/tiago_48_schunk.urdf @project=true --base torso_fixed_link "
    f"{_TIAGO_LOCKS}",
    "mtm": "{tree}/scripts/dvrk/mtm.toml",
    "psm": "{tree}/scripts/dvrk/psm.toml",
    "ur10": "{models}/universal_robots/ur10_robot.urdf",
    "ur5e": None,
    "gantry": "{tree}/tests/data/gantry.urdf",
    "so101": "{models}/so101/so101_new_calib.urdf",
}
_PANDA = "identify panda_gaz --robot {fr3} --out out"
_FR3 = "identify fr3_simulated --robot {fr3} --cutoff 10 --out"
_DVRK = "identify {data}/dvrk"
_GO2_AIR = "identify {data}/unitree_air/go2.npz --robot {go2} --cutoff 10 --delay auto --out out"
_GO2_WALKS = "identify {inputs}/go2_walking.npz --robot {go2_free}"
_ICUB = "identify {inputs}/icub_walking.npz --robot {icub}"
_SERVO = "identify ~/servo.npz --robot {fr3} --cutoff 10"
_CURRENT = "identify ~/current.csv --robot {fr3} --recipe {inputs}/currents.toml --cutoff 10"
_SIMULATE = "simulate --robot {fr3} --trajectory {tree}/runtime/examples/fr3_trajectory.json"
_EXCITE = "excite --robot {fr3} --duration 5 @harmonics=3 @starts=1 @processes=1"
_UNTIL = "excite --robot {fr3} @harmonics=3 @starts=1 @processes=1 --table 0 --until"
_FREE = " ".join(f"@calibrate=~/{log}.csv" for log in ("unit1", "unit2", "unit3", "empty"))
_SO101 = (
    *("backlash_detection", "chirp_sweep", "friction_gravity", "hold_under_gravity", "multisine"),
    *("prbs_excitation", "single_joint_elbow", "slow_precision", "static_holding"),
    *("step_response", "velocity_ramp", "workspace_sweep"),
)
_READ = (
    "evaluate out {log} --robot {robot};export out --robot {robot} --to urdf,mjcf --out models;"
    "sample out --robot {robot} --count 2 --to urdf --out samples;"
    "observe {log} --model out --robot {robot} @within=0.1 --out observed;"
    "watch out {log} --robot {robot} @date=2026-01-01;predict {log} --robot {robot};"
    "compare {log} --robot {robot} --methods map,pc-ols --out compared"
)
"""Everything that reads the result of one log and another log."""

_CASES: dict[str, tuple[str, ...]] = {
    "models": ("list", "inspect {tree}/symgen/robots/ur5e.urdf --json", "describe nothing"),
    **{
        f"robot-{name}": (
            f"{_BUILD} --urdf {made} --name {name}" if made else f"{_BUILD} --robot {name}",
        )
        for name, made in _ROBOTS.items()
    },
    # One log with measured torque.
    "panda-map": (
        f"{_PANDA} @save_statistics=true",
        "evaluate out fr3_simulated --robot {fr3} --json",
    ),
    "panda-no-refit": (f"{_PANDA} @refit=false @report=false --friction viscous,coulomb",),
    "panda-simulation": (f"{_PANDA} @preset=simulation",),
    "panda-real": (f"{_PANDA} @preset=real",),
    "panda-full": (f"{_PANDA} --method adam @preset=full @seed=3",),
    **{
        f"panda-{method}": (f"{_PANDA} --method {method}",)
        for method in ("adam", "lm", "log-cholesky", "pc-ols", "ols", "wls", "iv", "ekf", "nn")
    },
    "panda-robust": (f"{_PANDA} @robust=true",),
    "panda-auto": (f"{_PANDA} --friction auto,rotor --cutoff auto",),
    "panda-momentum": (f"{_PANDA} @regressor=momentum --cutoff 5 --friction none",),
    "panda-energy": (f"{_PANDA} @regressor=energy --cutoff 5",),
    "panda-delay": (f"{_PANDA} --delay auto @encoder_bias=true",),
    "panda-prior": (f"{_PANDA} --prior {{inputs}}/arm.toml",),
    "tx40": ("identify tx40_figaroh --robot {tx40} --out out",),
    "tx40-pc-ols": ("identify tx40_figaroh --robot {tx40} --method pc-ols --out out",),
    "lwr4": ("identify lwr4_flobaroid --robot {kuka_lwr4} --out out",),
    "lwr4-streamed": ("identify lwr4_flobaroid --robot {kuka_lwr4} @stream=true --out out",),
    "lwr4-two": (
        "identify lwr4_flobaroid --robot {kuka_lwr4} --run 1,2 --out out",
        "evaluate out lwr4_flobaroid --robot {kuka_lwr4} --run 3",
    ),
    "lwr4-three": ("identify lwr4_flobaroid --robot {kuka_lwr4} --run 1,2,3 --out out",),
    "fr3": (f"{_FR3} out", f"{_FR3} all --split all", "evaluate all fr3_simulated --robot {fr3}"),
    "fr3-streamed": (f"{_FR3} out @stream=true",),
    "dvrk-mtm": (
        "inspect {data}/dvrk/mtm_one.csv --robot {mtm} @log_rate=200 --recipe-out recipe.toml",
        f"{_DVRK}/mtm_one.csv --robot {{mtm}} --recipe recipe.toml --out out",
        f"{_DVRK}/mtm_two.csv --robot {{mtm}} --recipe recipe.toml --method ols --out two",
        "evaluate out {data}/dvrk/mtm_two.csv --robot {mtm} --recipe recipe.toml",
    ),
    "dvrk-psm": (
        "inspect {data}/dvrk/psm_one_no_weight.csv --robot {psm} @log_rate=200 --recipe-out "
        "recipe.toml",
        f"{_DVRK}/psm_one_no_weight.csv --robot {{psm}} --recipe recipe.toml --out out",
        "evaluate out {data}/dvrk/psm_two.csv --robot {psm} --recipe recipe.toml",
        *(
            f"{_DVRK}/{log}.csv --robot {{psm}} --recipe recipe.toml @report=false --out {log}"
            for log in ("psm_two", "psm_one_105_grams_parallel")
        ),
        "payload {data}/dvrk/psm_one_105_grams_parallel.csv --robot {psm} --recipe recipe.toml "
        "@link=link30 --empty {data}/dvrk/psm_one_no_weight.csv --out load",
        "friction out {data}/dvrk/psm_two.csv --robot {psm} --recipe recipe.toml --out friction",
    ),
    # Commanded torque, motor currents, a free base; what reads their results.
    "z1": (
        "inspect {data}/unitree_air/z1.npz --robot {z1} --recipe-out recipe.toml",
        "identify {data}/unitree_air/z1.npz --robot {z1} --cutoff 10 --delay auto --out out",
        *_READ.format(robot="{z1}", log="{data}/unitree_air/z1.npz").split(";"),
    ),
    "go2": (
        "inspect {data}/unitree_air/go2.npz --robot {go2} --json",
        _GO2_AIR,
        *_READ.format(robot="{go2}", log="{data}/unitree_air/go2.npz").split(";"),
    ),
    "go2-tied": (f"{_GO2_AIR} @symmetric=FL:FR @symmetric=RL:RR @tie=true",),
    "servo": (
        "inspect ~/servo.npz --robot {fr3}",
        f"{_SERVO} --delay auto --out auto",
        f"{_SERVO} --delay per-joint @encoder_bias=false --out per-joint",
        f"{_SERVO} --delay 0.02 --friction viscous,coulomb,offset --out fixed",
        f"{_SERVO} --delay auto @stream=true --out streamed",
        f"{_SERVO} ~/servo_late.npz --delay auto --out several",
        "export auto --robot {fr3} --to mjcf,actuators,friction --out models",
    ),
    "tiago": (
        "inspect {data}/tiago --robot {tiago} --recipe-out recipe.toml",
        "identify {data}/tiago --robot {tiago} --recipe recipe.toml --out out",
        *_READ.format(robot="{tiago}", log="{data}/tiago --recipe recipe.toml").split(";"),
    ),
    "currents": (
        f"{_CURRENT} --friction viscous,coulomb,offset --out out",
        f"{_CURRENT} --method pc-ols --out convex",
        "gains ~/current.csv --robot {fr3} --recipe {inputs}/currents.toml @cutoff=10 "
        "--total-mass 17.4 --recipe-out known.toml",
        "gains ~/current.csv --robot {fr3} --recipe {inputs}/currents.toml @cutoff=10 "
        "@weighed=fr3_link4=3.2",
        "identify ~/current.csv --robot {fr3} --recipe known.toml --cutoff 10 --out known",
    ),
    "icub-walking": (
        f"{_ICUB} @rows=base --cutoff 3 --split 0.5 --out out",
        *_READ.format(robot="{icub}", log="{inputs}/icub_walking.npz").split(";"),
    ),
    "go2-walking": (
        f"{_GO2_WALKS} @rows=all --cutoff 10 --out out",
        f"{_GO2_WALKS} @rows=base --out base",
        f"{_GO2_WALKS} @rows=joints --out joints",
        f"{_GO2_WALKS} {{inputs}}/go2_walking_two.npz --out several",
        *_READ.format(robot="{go2_free}", log="{inputs}/go2_walking_two.npz").split(";"),
    ),
    "ur10": (
        "inspect {data}/ur_collisions/Axis_1_1.csv.gz --robot {ur10} --recipe {inputs}/ur.toml",
        *(
            f"identify {{data}}/ur_collisions/{log}.csv.gz --robot {{ur10}} @report=false "
            f"--recipe {{inputs}}/ur.toml --out {log}"
            for log in ("Axis_1_2", "Axis_1_3", "Drift00_NF_1", "Drift00_NF_2", "Drift00_NF_3")
        ),
        "identify {data}/ur_collisions/Axis_1_1.csv.gz {data}/ur_collisions/Axis_3_1.csv.gz "
        "{data}/ur_collisions/Axis_5_1.csv.gz --robot {ur10} --recipe {inputs}/ur.toml --out out",
        "observe {data}/ur_collisions/Drift00_WF_1.csv.gz --model out --robot {ur10} --recipe "
        "{inputs}/ur.toml @within=0.1 --out observed",
    ),
    "so101": (
        "inspect {inputs}/so101/multisine.csv --robot {so101}",
        *(
            f"identify {{inputs}}/so101/{log}.csv --robot {{so101}} --cutoff 3 @report=false "
            f"--out {log}"
            for log in _SO101
        ),
    ),
    "gantry": (
        "simulate --robot {gantry} --ideal @viscous=1 @coulomb=0.5 --out log.csv",
        "identify log.csv --robot {gantry} --out out",
        "export out --robot {gantry} --out models",
    ),
    # Formats of one log, and several logs.
    "formats": tuple(
        f"identify ~/log.{kind} --robot {{fr3}} --cutoff 10 @report=false --out {kind}"
        + (" --friction viscous,coulomb @stream=true" * (kind in {"parquet", "mcap"}))
        for kind in ("csv.gz", "parquet", "h5", "mcap")
    ),
    "several": (
        "payload ~/loaded.csv --robot {fr3} --empty ~/empty.csv @cutoff=10 --out tool",
        "identify ~/empty.csv ~/loaded.csv ~/unit2.csv --robot {fr3} --cutoff 10 "
        "@payload_of=~/loaded.csv=tool/payload.json --delay auto --out out",
        "identify ~/unit1.csv ~/unit2.csv --robot {fr3} --cutoff 10 @stream=true --friction "
        "viscous,coulomb @refit=false --out streamed",
        "identify ~/unit1.csv ~/unit2.csv --robot {fr3} --cutoff 10 --method pc-ols @robust=true "
        "--out robust",
        *_READ.format(robot="{fr3}", log="~/unit3.csv").split(";"),
    ),
    # Uses of a result.
    "payload": (
        "payload ~/loaded.csv --robot {fr3} --empty ~/empty.csv @cutoff=10 --out tool",
        f"{_FR3} arm",
        "payload ~/loaded.csv --robot {fr3} --model arm @cutoff=10 @gain_error=0.01 --out model",
        "payload ~/loaded.csv --robot {fr3} @link=fr3_link7 --out urdf --json",
    ),
    "gains": (
        "gains ~/empty.csv ~/loaded.csv --robot {fr3} @cutoff=10 --payload 1,0,0,0.043 "
        "--recipe-out gains.toml",
        "identify ~/heavy.csv --robot {fr3} --recipe gains.toml --cutoff 10 --out out",
    ),
    "predict": (
        "predict fr3_simulated --robot {fr3} --more same --json",
        "predict panda_gaz --robot {fr3} @earlier_log=fr3_simulated @friction=viscous,coulomb",
        "predict panda_gaz --robot {fr3} @payload_only=true --noise 0.1",
        "predict {tree}/runtime/examples/fr3_trajectory.json --robot {fr3} --noise fr3_simulated",
    ),
    "compare": (
        "compare fr3_simulated --robot {fr3} --cutoff 10 --friction viscous,coulomb --out out",
        "compare panda_gaz --robot {fr3} --methods map,pc-ols,ols,lm --out panda",
        "compare lwr4_flobaroid --robot {kuka_lwr4} --methods map,pc-ols,wls @stream=true --out "
        "lwr4",
    ),
    "observe": (
        f"{_FR3} out --friction viscous,coulomb",
        "observe ~/pushed.csv --model out --robot {fr3} --free ~/unit1.csv @link=fr3_link4 "
        "@within=0.1 @mcap=true --out observed",
        "observe ~/pushed.csv --model out --robot {fr3} @within=0.1 @false_alarms='2 per day' "
        f"{_FREE} --out calibrated",
    ),
    "watch": (
        f"{_FR3} out --friction viscous,coulomb",
        *(
            f"watch out ~/{log}.csv --robot {{fr3}} @date=2026-01-0{day} --history history.jsonl "
            "@temperature=30"
            for day, log in enumerate(("unit1", "rubbing", "heavy", "loaded"), 1)
        ),
        "watch out ~/unit1.csv ~/rubbing.csv --robot {fr3} --json",
        "report history.jsonl --out trends.html",
    ),
    "fleet": (
        *(
            f"identify ~/unit{k}.csv --robot {{fr3}} --cutoff 10 @save_statistics=true --friction "
            f"viscous,coulomb,offset @report=false --out units/unit{k}"
            for k in (1, 2, 3)
        ),
        "fleet units --robot {fr3} --out fleet.toml --json",
        "identify ~/heavy.csv --robot {fr3} --cutoff 10 --prior fleet.toml --out new",
    ),
    "sample": (f"{_FR3} out", "sample out --robot {fr3} --count 5 --to mjcf,urdf @seed=1"),
    "export": (f"{_FR3} out", "export out --robot {fr3} --out models"),
    "friction": (
        f"{_FR3} out --friction viscous,coulomb,offset",
        "friction out ~/rubbing.csv --robot {fr3} --out today",
        "evaluate today ~/rubbing.csv --robot {fr3}",
    ),
    "inspect": tuple(
        f"inspect {log} --robot {{{robot}}} --json"
        for log, robot in (
            ("panda_gaz", "fr3"),
            ("fr3_simulated", "fr3"),
            ("tx40_figaroh", "tx40"),
            ("lwr4_flobaroid", "kuka_lwr4"),
            ("~/heavy.csv", "fr3"),
        )
    ),
    # Motions, virtual robots, campaigns.
    "simulate": (
        f"{_SIMULATE} @viscous=0.8 @coulomb=0.4 @keep_every=5 --out log.csv",
        f"{_SIMULATE} --engine mujoco --seed 1 @keep_every=5 --out real.npz",
        f"{_SIMULATE} --payload 1.8,0.01,0.02,0.167,0.1,0.08,0.1 --out loaded.npz",
        *(
            f"identify log.csv --robot {{fr3}} --method {method} @controller=log.loop.toml "
            f"--friction viscous,coulomb --cutoff 20 --out {method}"
            for method in ("iv", "didim", "ekf", "ukf")
        ),
        "compare log.csv --robot {fr3} --methods map,iv,didim,ols @controller=log.loop.toml "
        "--friction viscous,coulomb --out compared",
        "identify real.npz --robot {fr3} --cutoff 10 --out real",
    ),
    "excite": (
        f"{_EXCITE} --table 0 --export csv --export ros --out motion.json",
        "approach motion.json --robot {fr3} --from home --return --table 0 --obstacles "
        "{inputs}/cell.toml --export npz --out way.json",
        "predict motion.json --robot {fr3} @log_rate=50 --json",
    ),
    "excite-document": (f"{_EXCITE} @document=true --out motion.json",),
    "excite-limits": (
        f"{_EXCITE} --table 0 @basis=fourier --criterion d --carry 1,0,0,0.1,0.1,0.1,0.1 "
        "@payload_band=0.2,0.1 @friction_band=20 @viscous=1 @coulomb=0.5 @model_band=cad "
        "--obstacles {inputs}/cell.toml --export libfranka --speed 50 --out motion.json",
    ),
    "excite-spline": (f"{_EXCITE} @basis=bspline --criterion a @zero_jerk=true --out motion.json",),
    "excite-several": (
        f"{_EXCITE} @motions=2 --table 0 --noise fr3_simulated @noise_model=coloured --cutoff 10 "
        "--out motion.json",
    ),
    "excite-until": (
        f"{_UNTIL} v=500mNm --from home --return --out motion.json",
        f"{_UNTIL} 'payload 20 g' --out payload.json",
    ),
    "excite-ur5e": (
        "excite --robot {ur5e} --duration 4 @harmonics=3 @starts=2 @seed=4 @processes=2 --table "
        "0 --out motion.json",
    ),
    "static": ("excite --robot {fr3} @static=true @poses=6 --table 0 --out poses.json",),
    "campaign": (
        "campaign --robot {fr3} --target v=2Nm @stages=50 @rehearsal=false @later_duration=2.5 "
        "--out session",
    ),
    "campaign-payload": (
        "campaign --robot {fr3} --target payload=50g @stages=100 @rehearsal=false "
        "@later_duration=2.5 --json --out session",
    ),
    # The Python interface, tables, and input that is refused.
    "python": ("python identify {fr3}", "python payload {fr3} {inputs}/fr3"),
    "reproduce": (
        "reproduce list",
        "reproduce tables-B @robot={fr3} --out results",
        "report results --out report.html @markdown=tables.md",
    ),
    "refused": (
        "identify nothing.csv --robot {fr3}",
        "identify fr3_simulated --robot {tx40}",
        "identify fr3_simulated --robot {fr3} --method nothing",
        "identify fr3_simulated --robot {fr3} --method didim @stream=true",
        "identify fr3_simulated --robot {fr3} @tie=true",
        "identify fr3_simulated --robot {fr3} @rows=base",
        "identify fr3_simulated --robot {fr3} @encoder_bias=true @stream=true",
        "identify fr3_simulated panda_gaz --robot {fr3} --method ekf",
        "identify {inputs}/icub_walking.npz --robot {icub} --delay auto",
        "payload ~/loaded.csv --robot {fr3} --empty panda_gaz",
        "gains ~/empty.csv --robot {fr3}",
    ),
}

CASES = {
    name: tuple(line.replace("@", "--settings ").replace("~/", "{inputs}/fr3/") for line in lines)
    for name, lines in _CASES.items()
}
SCRIPTS = {
    "identify": """
import json, sys, runtime
lib = runtime.load(sys.argv[1])
log = runtime.read_recording("fr3_simulated")
friction = runtime.choose_default_friction(log, lib).terms
word = "friction" if hasattr(runtime.Settings, "friction") else "friction_columns"
for name, how in {"plain": {word: () if word == "friction" else None, "refit": False},
                  "command": {word: friction, "refit": True},
                  "ols": {word: friction, "method": "ols", "refit": False}}.items():
    result = runtime.identify(log, lib, **how)
    arrays = {"pi": result.pi, "phi": result.phi, "tau": result.predict(log.q, log.dq, 0 * log.dq)}
    facts = {key: values.tolist() for key, values in arrays.items()} | {"status": result.status}
    json.dump(facts | {"notes": list(result.notes)}, open(name + ".json", "w"))
""",
    "payload": """
import json, sys, runtime
lib = runtime.load(sys.argv[1])
empty, loaded = (runtime.read_recording(f"{sys.argv[2]}/{x}.csv") for x in ("empty", "loaded"))
found = runtime.identify_payload(loaded, lib, link="fr3_link7", empty=empty)
print(found.status)
json.dump({"pi": found.pi.tolist()}, open("payload.json", "w"))
""",
}
"""Programs of the word `python`."""
