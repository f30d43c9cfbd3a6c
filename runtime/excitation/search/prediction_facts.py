"""The expected accuracy of a motion as a JSON object, part `expected` of its file."""

from collections.abc import Iterable

from runtime.excitation.search.prediction import Prediction


def facts(prediction: Prediction) -> dict[str, object]:
    """The prediction as a JSON object."""

    def numbers(values: Iterable[float] | None) -> list[float] | None:
        return None if values is None else [float(value) for value in values]

    return {
        "torque_noise": numbers(prediction.noise),
        "rate_hz": prediction.rate,
        "earlier_logs_count": prediction.has_earlier_logs,
        "unknowns": "payload" if prediction.payload_only else "base parameters",
        **({"left_out": list(prediction.left_out)} if prediction.left_out else {}),
        "criteria": [
            {
                "samples": score.samples,
                "columns": score.columns,
                "friction": list(score.friction),
                "condition_number_of_unit_columns": score.condition,
                "relative_error": score.relative_error,
                "torque_error": score.torque_error,
                "half_axis": score.half_axis,
            }
            for score in prediction.scores
        ],
        "sigma": numbers(prediction.sigma),
        "sigma_with_friction": numbers(prediction.sigma_with_friction),
        "sigma_of_torque_per_joint": numbers(prediction.torque),
        "sigma_of_payload_mass": prediction.payload_mass,
        "sigma_of_payload_com": numbers(prediction.payload_com),
        "notes": list(prediction.notes),
    }
