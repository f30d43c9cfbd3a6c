"""Schema of result.json: every key once, with type, shape, unit and meaning.

The writer (`result_file`) and both readers (`saved_result`, the report) use this module; the table
of the documentation is made from it. Files of format 1, older ones without a number included, are
migrated on reading: keys that they lack take the value that stands for "not recorded".
"""

import copy
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.common.files import json_of
from runtime.errors import RecordingError
from runtime.identification.drive.result import TORQUE_KEYS
from runtime.identification.result_key import MISSING, Key

FORMAT = 2
"""Number of the present format; a change that an older reader would misread raises it."""

_WORDS = {"text": "a text", "number": "a number", "integer": "an integer",
          "boolean": "true or false", "list": "a list", "table": "a table"}  # fmt: skip
_SI = "N·m or N"

KEYS: tuple[Key, ...] = (
    Key("format", "integer", f"number of the format, {FORMAT}", older=1),
    Key("method", "text", "name of the method"),
    Key("robot", "text", "name of the robot"),
    Key("model", "table?", "model that the parameters belong to", older=None),
    Key("model.model_hash", "text", "SHA-256 of the model"),
    Key("model.gravity", "list", "gravity in the base frame", "(3,)", "m/s²"),
    Key("model.joints", "list", "kind, parent, rotation, translation, axis of every joint", "(n,)"),
    Key("model.lumped", "list", "names of the fixed links that count into moving ones"),
    Key("status", "text?", "how the method ended, a sentence", older=""),
    Key("joints", "list", "names of the joints", "(n,)"),
    Key("units", "list", "unit of the torque of every joint, N*m or N", "(n,)"),
    Key("recording", "table?", "the data", older={}),
    Key("recording.name", "text?", "name of the recording", older="unnamed recording"),
    Key("recording.duration", "number?", "duration of all parts", unit="s", older=None),
    Key("recording.samples", "table", "samples per part: train, validation, test", older={}),
    Key("recording.history", "list", "sentences on every step of the preparation", older=[]),
    Key("recording.preparation", "table", "settings of the preparation that are not the default",
        older={}),
    Key("recording.split", "text", "instants of the parts, a phrase", unit="s", older=""),
    *TORQUE_KEYS,
    Key("torque_error_percent", "table", "100 ‖τ − τ̂‖/‖τ‖ on the test part"),
    Key("torque_error_percent.before", "list", "of the URDF without friction; null where τ = 0",
        "(n,)", "%"),
    Key("torque_error_percent.after", "list", "of the identified model; null where τ = 0", "(n,)",
        "%"),
    Key("torque_error_percent.before_overall", "number?", "of the URDF, all joints together",
        unit="%"),
    Key("torque_error_percent.after_overall", "number?",
        "of the identified model, all joints together", unit="%"),
    Key("torque_error_percent.urdf_friction", "list", "of the URDF with friction fitted",
        "(n,)", "%", is_optional=True),
    Key("torque_error_percent.urdf_friction_overall", "number",
        "of the URDF with friction fitted, all joints together", unit="%", is_optional=True),
    Key("torque_rms", "table", "root mean square of τ − τ̂ on the test part"),
    Key("torque_rms.before", "list", "of the URDF without friction", "(n,)", _SI),
    Key("torque_rms.after", "list", "of the identified model", "(n,)", _SI),
    Key("torque_rms.urdf_friction", "list", "of the URDF with friction fitted", "(n,)", _SI,
        is_optional=True),
    Key("links", "list", "one table per moving link", "(n,)"),
    Key("links[].name", "text", "name of the link"),
    Key("links[].mass", "number", "identified mass", unit="kg"),
    Key("links[].mass_before", "number", "mass of the URDF", unit="kg"),
    Key("links[].com", "list", "identified centre of mass in the link's frame", "(3,)", "m"),
    Key("links[].com_before", "list", "centre of mass of the URDF", "(3,)", "m"),
    Key("links[].min_relative_eigenvalue", "number?", "λ_min(P)/tr P; below 0 is not consistent"),
    Key("consistent", "boolean", "whether every link is physically consistent"),
    Key("gap_to_convex_optimum", "number?", "(L − L*)/L*; null when not computed", older=None),
    Key("uncertainty", "table?", "posterior of the parameters; null when not computed",
        older=None),
    Key("uncertainty.advice", "text", "what to record next, a sentence"),
    Key("uncertainty.n_eff", "number", "effective sample size of the residuals"),
    Key("uncertainty.inflation", "number", "samples per independent sample, N / N_eff"),
    Key("uncertainty.excited", "integer", "base parameters that the motion excites", older=0),
    Key("uncertainty.weakest_direction", "any", "worst-conditioned combination", older=None),
    Key("uncertainty.boundary", "boolean", "whether a link is close to a plate or a rod"),
    Key("uncertainty.links", "list", "mass_sigma [kg], com_sigma [m], verdict per parameter",
        "(n,)"),
    Key("uncertainty.pi_sigma", "list", "standard deviations of π", "(10 n,)", "SI", older=[]),
    Key("uncertainty.posterior_over_prior", "list", "posterior over prior variance of π",
        "(10 n,)", older=[]),
    Key("uncertainty.beta_sigma", "list", "standard deviations of β", "(n_b,)", "SI", older=[]),
    Key("uncertainty.beta_verdicts", "list", "identified or prior-dominated, per entry of β",
        "(n_b,)", older=[]),
    Key("uncertainty.noise", "list", "residual RMS per joint", "(n,)", _SI),
    Key("uncertainty.model_band", "list", "σ of the model's torque", "(n,)", _SI),
    Key("uncertainty.white", "list", "share of lags within the bounds of white noise", "(n,)"),
    Key("uncertainty.gain_limits", "list", "relative error of each torque gain that such a log "
        "shows in 95 of 100 cases; null for none, empty where not tested", "(n,)", older=[]),
    Key("loss", "number?", "L on the training part", older=None),
    Key("convex_optimum", "number?", "L*, smallest loss of a consistent model", older=None),
    Key("weights", "list", "diagonal of W in the loss", "(n,)", older=[]),
    Key("friction", "table?", "friction model; null without one", older=None),
    Key("friction.columns", "list", "names of the columns", "(k,)"),
    Key("friction.values", "list", "coefficients φ; a spring has one, in the first row", "(n, k)",
        "SI"),
    Key("friction.sigma", "list", "standard deviations of φ; null where the data determine none",
        "(n, k)", "SI", is_optional=True),
    Key("friction.interval_95", "list", "lower and upper end of the 95 % interval; null likewise",
        "(n, k, 2)", "SI", is_optional=True),
    Key("friction.coulomb_speed", "number", "ε, width of the smooth sign of dq", unit="rad/s"),
    Key("friction.stribeck_speed", "number", "v_s, width of the Stribeck peak", unit="rad/s",
        is_optional=True),
    Key("friction.dahl_stroke", "number", "z_c, travel of a reversal", unit="rad",
        is_optional=True),
    Key("friction.gear", "list", "gear matrix R of q_motor = R q", "(n, n)", is_optional=True),
    Key("friction.net", "table", "friction net: theta, scale", is_optional=True),
    Key("convergence", "table?", "losses over the iterations; null for closed forms", older=None),
    Key("convergence.iteration", "list", "numbers of the iterations"),
    Key("convergence.training", "list", "L on the training part"),
    Key("convergence.validation", "list?", "L on the validation part", older=None),
    Key("iterations", "integer?", "iterations of the method", older=None),
    Key("seconds", "number?", "time of the method alone", unit="s", older=None),
    Key("warnings", "list", "sentences to read before the result is used", older=[]),
    Key("pi", "list", "standard parameters π: m, m·c, I per link", "(10 n,)", "kg, kg·m, kg·m²"),
    Key("lam", "list?", "λ of π; null where π is not consistent", "(10 n,)", older=None),
    Key("beta", "list", "base parameters β = K π", "(n_b,)", "SI", older=[]),
    Key("condition_number", "number?", "cond of the normalised regressor; null when singular",
        older=None),
    Key("trained", "table?", "fit to the training part, whose errors, loss and gap are stated; "
        "null where pi is that fit", older=None, is_optional=True),
    Key("trained.pi", "list", "π of that fit", "(10 n,)", "kg, kg·m, kg·m²", is_optional=True),
    Key("trained.friction_values", "list", "φ of that fit", "(n, k)", "SI", is_optional=True),
    Key("sessions", "table?", "comparison of several logs; null for one", older=None),
    Key("sessions.names", "list", "names of the logs"),
    Key("sessions.payload_kg", "list", "known payload of every log", "(logs,)", "kg"),
    Key("sessions.train_samples", "list", "training rows of every log", "(logs,)", older=[]),
    Key("sessions.offsets", "list?", "torque offsets of every log", "(logs, n)", _SI, older=None),
    Key(
        *("sessions.delay_s", "list?", "delay of every log: name, value, sigma", "(logs,)", "s"),
        is_optional=True,
    ),
    Key("sessions.leave_one_out", "list", "errors of the fit to all other logs", "(logs,)"),
    Key("sessions.repeatability", "table", "spread of the fits to single logs"),
    Key("provenance", "table?", "how to compute the result again", older={}),
    Key("provenance.command", "text", "command line", older=""),
    Key("provenance.versions", "table", "versions of what computed the result", older={}),
    Key("provenance.files", "table", "SHA-256 of the raw files, by name", older={}),
    Key("provenance.model_hash", "text", "SHA-256 of the model", older=""),
    Key("provenance.seed", "integer?", "seed of mini-batches and nets", older=None),
)  # fmt: skip


def read_facts(path: Path) -> dict[str, Any]:
    """Facts of a result.json in the present format, their types checked."""
    facts = json_of(path)
    if not isinstance(facts, dict):
        raise TypeError(f"result: expected a table, got {facts!r:.40}")
    if "free_base" in facts:
        raise RecordingError(
            f"'{path}' is the result of a robot with a free base, expected one of a fixed base; "
            "use result.json and identified.urdf of its folder as they are, or build the robot "
            "without --floating"
        )
    number = facts.get("format", 1)
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise TypeError(f"'format': expected an integer above 0, got {number!r:.40}")
    if number > FORMAT:
        raise RecordingError(
            f"'{path}' has the format {number}{_writer(facts)}, expected {FORMAT} or less; "
            "update symgen, or identify again with this version"
        )
    if number < FORMAT:
        facts = migrated(facts)
    else:
        require_keys(facts)
    require_kinds(facts)
    return facts


def migrated(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts of format 1 with the keys that format 2 has added."""
    now: dict[str, Any] = copy.deepcopy(dict(facts))
    if isinstance(now.get("joints"), list) and not now.get("units"):
        now["units"] = [""] * len(now["joints"])
    for key in KEYS:
        if key.older is MISSING:
            continue
        for table, name in _places(now, key.path):
            if (
                (table.get(name) is None and not key.kind.endswith("?"))
                or name not in table
                or (table[name] is None and key.older == {})
            ):
                table[name] = copy.deepcopy(key.older)
    now["format"] = FORMAT
    return now


def require_keys(facts: Mapping[str, Any]) -> None:
    """Refuse facts that lack a key of the present format."""
    for key in KEYS:
        for table, name in _places(facts, key.path):
            if name not in table and not key.is_optional:
                raise KeyError(name)


def require_kinds(facts: Mapping[str, Any]) -> None:
    """Refuse a value of another kind than its key."""
    for key in KEYS:
        for table, name in _places(facts, key.path):
            if name in table and not key.accepts(table[name]):
                word = _WORDS[key.kind.rstrip("?")]
                raise TypeError(f"'{name}': expected {word}, got {table[name]!r:.40}")


def markdown_table() -> str:
    """Table of all keys for the documentation: key, type, shape, unit, meaning."""
    lines = ["| key | type | shape | unit | meaning |", "|---|---|---|---|---|"]
    for key in KEYS:
        kind = key.kind.replace("?", " or null") + (", optional" if key.is_optional else "")
        lines.append(f"| `{key.path}` | {kind} | {key.shape} | {key.unit} | {key.meaning} |")
    return "\n".join(lines) + "\n"


def _places(facts: Mapping[str, Any], path: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Tables that have or could have a key, each with the key's name."""
    *parents, name = path.split(".")
    tables: list[Any] = [facts]
    for parent in parents:
        key = parent.removesuffix("[]")
        values = [table.get(key) for table in tables if isinstance(table, dict)]
        if parent.endswith("[]"):
            values = [each for value in values if isinstance(value, list) for each in value]
            if not all(isinstance(each, dict) for each in values):
                raise TypeError(f"'{key}': expected a list of tables")
        tables = values
    yield from ((table, name) for table in tables if isinstance(table, dict))


def _writer(facts: Mapping[str, Any]) -> str:
    """The version that wrote a file, where it is recorded."""
    try:
        return f" (written by symgen {facts['provenance']['versions']['symgen']})"
    except (KeyError, TypeError):
        return ""
