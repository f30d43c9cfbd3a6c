"""Keys of result.json on the origin of the torque: source, law, gains, delay and drives."""

from runtime.identification.result_key import Key

TORQUE_KEYS: tuple[Key, ...] = (
    Key(
        "torque_source",
        "text",
        "measured, commanded (by a control law) or current (times a gain)",
        is_optional=True,
    ),
    Key(
        "control_law",
        "table?",
        "law, kp, kd, effort_limit and gear of a commanded torque, one "
        "number per joint or for all; null for a measured one",
        is_optional=True,
    ),
    Key(
        "current_gains",
        "list?",
        "estimated gains of motor currents, one table per joint or "
        "motor; null where the recipe states them",
        is_optional=True,
    ),
    Key("current_gains[].channel", "text", "joint, or motor where the gear couples joints"),
    Key("current_gains[].gain", "number", "torque over current", unit="N·m/A"),
    Key(
        "current_gains[].sigma",
        "number?",
        "standard deviation with the URDF as prior; null where "
        "the current shows no torque of the links",
        unit="N·m/A",
    ),
    Key("current_gains[].ratio_to", "text", "channel to which the ratio is taken"),
    Key(
        "current_gains[].ratio_sigma",
        "number?",
        "relative standard deviation of that ratio without the URDF",
    ),
    Key(
        "current_gains[].verdict",
        "text",
        "determined, determined up to the common factor, from "
        "the masses of the URDF, or not identifiable from this motion",
    ),
    Key(
        "delay_s",
        "any",
        "{value, sigma} of the delay of the torque; one per joint in a list, or "
        "{log, value, sigma} per log; null where it was not estimated",
        unit="s",
        is_optional=True,
    ),
    Key(
        "symmetric",
        "list?",
        "armature and friction of mirrored joints, one table per pair and quantity; null where "
        "--symmetric was not given",
        is_optional=True,
    ),
    Key("symmetric[].left", "text", "left joint"),
    Key("symmetric[].right", "text", "right joint"),
    Key("symmetric[].quantity", "text", "armature or friction"),
    Key("symmetric[].values", "list", "left and right, per coefficient", "(2, m)"),
    Key("symmetric[].sigma", "list", "standard deviations", "(2, m)"),
    Key("symmetric[].distance", "number", "difference in its standard deviations"),
    Key("symmetric[].agrees", "boolean", "whether it is within the 95 % interval"),
    Key(
        "symmetric[].rise",
        "number?",
        "error of the held-out torque with exchanged drives over "
        "that with theirs; null where the sides agree",
    ),
    Key("symmetric[].sentence", "text?", "where the sides disagree and why; null where they agree"),
    Key(
        "drive",
        "list?",
        "drive of every joint; null where the torque is measured and no delay was estimated",
        "(n,)",
        is_optional=True,
    ),
    Key("drive[].joint", "text", "name of the joint"),
    Key("drive[].armature", "number?", "inertia of rotor and gear", unit="kg·m²"),
    Key("drive[].viscous", "number?", "viscous friction", unit="N·m·s/rad"),
    Key("drive[].coulomb", "number?", "Coulomb friction, with or without a memory", unit="N·m"),
    Key("drive[].offset", "number?", "torque offset", unit="N·m"),
    Key("drive[].encoder_bias", "number?", "b of q_true = q + b", unit="rad"),
    Key(
        "drive[].sigma",
        "table",
        "standard deviations under the same names; null where the "
        "motion does not determine the value",
    ),
    Key(
        "drive[].encoder_bias_verdict",
        "text",
        "identified, not identifiable from this motion, or not estimated",
    ),
)
