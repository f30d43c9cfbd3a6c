"""Status and notes of an identified payload."""

from runtime.estimators.regression.residuals import NORMAL_95
from runtime.identification.payload.body import Body
from runtime.identification.payload.reading import ArmModel

_MODEL_ERROR = 0.1
"""Residual over the torque of the payload, above which the model of the arm dominates the error."""


def status_of(body: Body, weak: tuple[str, ...], converged: bool) -> str:
    """How the identification ended."""
    if not converged:
        return "not converged; check the recording for outliers and the unit of the torque"
    if body.mass < 3 * body.sigma[0]:
        return f"no significant payload ({1e3 * body.mass:.1f} g, σ {1e3 * body.sigma[0]:.1f} g)"
    if "mass" in weak:
        return "the recording does not determine the mass; move the payload against gravity"
    return f"identified {body.mass:.4f} kg ± {NORMAL_95 * body.sigma[0]:.4f} kg (95 %)"


def notes_of(
    weak: tuple[str, ...], share: float, model: ArmModel, differential: bool, gain_error: float
) -> tuple[str, ...]:
    """Assumptions and limits of the result."""
    notes = []
    if gain_error:
        notes.append(
            f"the intervals include independent errors of the torque gains of {100 * gain_error:g} "
            "% per joint"
        )
    else:
        notes.append(
            "the intervals assume that the torque gains are exact: a gain that is 10 % too large "
            "makes the mass 10 % too large; --gain-error 0.1 includes such errors"
        )
    if weak:
        notes.append(
            f"the prior rather than the data determines {', '.join(weak)}; record a motion with "
            "faster rotations about all axes of the payload"
        )
    if not (differential or model.is_exact):
        notes.append(
            "the intervals include the error of the arm's model, estimated from the residual; "
            "against a run without the payload it cancels, and they are far narrower"
        )
    if share > _MODEL_ERROR and not differential:
        notes.append(
            f"the residual is {100 * share:.0f} % of the payload's torque, so that the error of "
            "the arm's model exceeds that of the sensors; record the same motion without the "
            "payload, or give a model identified on the empty arm"
        )
    if not model.phi.size and not differential:
        notes.append("friction of the arm is taken as zero; give a model or an empty run")
    return tuple(notes)
